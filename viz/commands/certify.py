"""`cgraph certify`: equations that a scene's graphs must fulfil, and agreement with other software."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import dynamics as dyn

from . import library
from .arguments import answer, counting, scene_of, takes_a_scene, unless_json, whole
from .command import Command, flag, say

if TYPE_CHECKING:
    from mujoco import MjModel


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    parser.add_argument("--states", type=counting, default=20, metavar="N", help="random states (default: 20)")
    parser.add_argument("--seed", type=whole, default=0, metavar="S", help="of the random states (default: 0)")
    flag(parser, "--json", "print as JSON")


def run(options: argparse.Namespace) -> int:
    """Print the residuals; 1 where one exceeds its bound."""
    scene = scene_of(options)
    certificate = library.certify(scene, options.states, options.seed, twin=_twin(options.scene, options.floating))
    answer(unless_json(options, {"scene": scene.name} | certificate.to_dict(), certificate))
    if certificate.passed:
        return 0
    failed = [residual.equation for residual in certificate.residuals if not residual.passed]
    say(f"{scene.name}: {len(failed)} residual(s) exceed their bound: {'; '.join(failed)}")
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
