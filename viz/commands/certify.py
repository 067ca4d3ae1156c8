"""`cgraph certify`: equations that a scene's graphs must fulfil, and their agreement with other software."""

from __future__ import annotations

import argparse
from typing import Any

from dynamics import MechanismError, scenes
from dynamics.io.load import compiled
from dynamics.verification.certificate import certify

from .arguments import Commands, answer, counting, say, scene_of, takes_a_scene, unless_json, whole


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "certify",
        help="equations that a scene's graphs must fulfil, and agreement with peers; status 1 if any fails",
    )
    takes_a_scene(parser)
    parser.add_argument("--states", type=counting, default=20, metavar="N", help="random states (default: 20)")
    parser.add_argument("--seed", type=whole, default=0, metavar="S", help="of the random states (default: 0)")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the residuals; 1 where one exceeds its bound."""
    scene = scene_of(options)
    certificate = certify(scene, options.states, options.seed, twin=_twin(options.scene, options.floating))
    answer(unless_json(options, {"scene": scene.name} | certificate.to_dict(), certificate))
    if certificate.passed:
        return 0
    failed = [residual.equation for residual in certificate.residuals if not residual.passed]
    say(f"{scene.name}: {len(failed)} residual(s) exceed their bound: {'; '.join(failed)}")
    return 1


def _twin(scene: str, floating: bool) -> Any:
    """MuJoCo's own model of a file; None for other scenes, and where MuJoCo cannot read the file."""
    if not scenes.is_model_file(scene):
        return None
    try:
        return compiled(scene, floating=floating)
    except (MechanismError, ImportError) as error:
        say(f"compared is the model that was read, not the file: {error}")
        return None
