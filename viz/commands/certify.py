"""`cgraph certify`: equations that a scene's graphs must fulfil, and their agreement with other software."""

from __future__ import annotations

import argparse

from dynamics import scenes
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
    twin = None if options.scene in scenes.names() else compiled(options.scene)
    if twin is not None and twin.nv != scene.system.n:  # joints were left out
        say(f"{scene.name}: MuJoCo gets the model without what was left out, too")
        twin = None
    certificate = certify(scene, options.states, options.seed, twin=twin)
    answer(unless_json(options, {"scene": scene.name} | certificate.to_dict(), certificate))
    if certificate.passed:
        return 0
    failed = [residual.equation for residual in certificate.residuals if not residual.passed]
    say(f"{scene.name}: {len(failed)} residual(s) exceed their bound: {'; '.join(failed)}")
    return 1
