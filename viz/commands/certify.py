"""`cgraph certify`: equations that a scene's graphs must fulfil, agreement with other software; bits of a motion."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import dynamics as dyn

from . import library
from .arguments import answer, counting, say, scene_of, takes_a_scene, unless_json, whole
from .command import Command

if TYPE_CHECKING:
    from mujoco import MjModel


STATES, SEED = 20, 0  # unless others are asked for


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    parser.add_argument(
        "--states", type=counting, default=STATES, metavar="N", help=f"random states (default: {STATES})"
    )
    parser.add_argument("--seed", type=whole, default=SEED, metavar="S", help=f"of the random states (default: {SEED})")
    parser.add_argument(
        "--bits",
        action="store_true",
        help="instead: the bits of one motion by calls, loops, batches, threads, another process and C",
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the residuals; 1 where one exceeds its bound, or with --bits where bits differ."""
    scene = scene_of(options)
    if options.bits:
        if (options.states, options.seed) != (STATES, SEED):
            raise ValueError("--bits is of one motion from the scene's start: --states and --seed say nothing of it")
        return _bits(scene, options)
    certificate = library.certify(scene, options.states, options.seed, twin=_twin(options.scene, options.floating))
    answer(unless_json(options, {"scene": scene.name} | certificate.to_dict(), certificate))
    if certificate.passed:
        return 0
    failed = [residual.equation for residual in certificate.residuals if not residual.passed]
    say(f"{scene.name}: {len(failed)} residual(s) exceed their bound: {'; '.join(failed)}")
    return 1


def _bits(scene: dyn.scenes.Scene, options: argparse.Namespace) -> int:
    """Print the digests of a motion; 1 where they differ."""
    moving = library.moving_start(scene)
    if moving is not scene:
        say(f"{scene.name}: {library.rest_text(scene, moving)}")
    found = library.same_bits(moving, options.scene)
    answer(unless_json(options, {"scene": scene.name} | found.to_dict(), found))
    if found.passed:
        return 0
    say(f"{scene.name}: other bits by {', '.join(way.name for way in found.ways if not way.same)}")
    return 1


def _twin(scene: str, floating: bool) -> MjModel | None:
    """MuJoCo's own model of a file; None for other scenes, and where MuJoCo cannot read the file."""
    if not dyn.scenes.is_model_file(scene):
        return None
    try:
        return library.compiled(scene, floating=floating)
    except (dyn.MechanismError, ImportError) as error:
        say(f"compared is the model that was read, not the file: {error}")
        return None
