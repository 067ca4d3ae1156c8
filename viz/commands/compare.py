"""`cgraph compare`: what two formulations of a scene's equations have in common, and what only one of them has."""

from __future__ import annotations

import argparse
import json

import cgraph as cg
from dynamics import FORMULATIONS, inverse_dynamics
from dynamics.equations.node_classes import formulation_classes

from ..graph_drawing.dot import to_dot
from .arguments import Commands, draw, may_draw_and_print, scene_of, state_names, takes_a_scene


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("compare", help="compare two formulations of a scene's equations, node by node")
    takes_a_scene(parser)
    parser.add_argument(
        "--formulations",
        nargs=2,
        default=("euler_embedded", "chain_rule"),
        choices=sorted(FORMULATIONS),
        metavar=("LEFT", "RIGHT"),
        help=f"two of {', '.join(sorted(FORMULATIONS))} (default: euler_embedded chain_rule)",
    )
    may_draw_and_print(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the totals of both sides and the classes of what only one of them has."""
    scene = scene_of(options)
    left, right = (inverse_dynamics(scene, name) for name in options.formulations)
    state = [name for graph in (left, right) for names in state_names(graph, scene.system.n) for name in names]
    comparison = cg.compare(left, right, atoms=dict.fromkeys(state), classify=formulation_classes)
    if options.json:
        named = dict(zip(("left", "right"), options.formulations, strict=True))
        sizes = {"left_nodes": len(left.nodes), "right_nodes": len(right.nodes), "in_both": len(comparison.common)}
        print(json.dumps({"scene": scene.name} | named | sizes | comparison.to_dict(), indent=1))
    else:
        both = len(comparison.common)
        for side, name, graph, only in zip(
            ("left", "right"),
            options.formulations,
            (left, right),
            (comparison.only_left, comparison.only_right),
            strict=True,
        ):
            print(f"{side}: {name}, {len(graph.nodes)} nodes = {both} in both + {len(only)} only {side}")
        print(comparison)
    if options.svg:
        together = comparison.overlay()
        marks = dict(
            zip(
                [f"only {name}" for name in options.formulations],
                (together.only_left, together.only_right),
                strict=True,
            )
        )
        caption = f"{scene.name}: {options.formulations[0]} and {options.formulations[1]} in one"
        draw(options, to_dot(together.graph, marked=marks, caption=caption.replace("_", " ")))
    return 0
