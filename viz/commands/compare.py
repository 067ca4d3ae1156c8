"""`cgraph compare`: what two formulations of a scene's equations have in common, and what only one of them has."""

from __future__ import annotations

import argparse

import cgraph as cg
from dynamics import FORMULATIONS, display_names, inverse_dynamics
from dynamics.equations.node_classes import formulation_classes

from .. import theme
from .arguments import (
    Commands,
    answer_and_draw,
    check_picture,
    may_draw_and_print,
    scene_of,
    state_names,
    takes_a_scene,
    unless_json,
)


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "compare", help="compare two formulations of a scene's equations, node by node; status 1 where they differ"
    )
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
    """Print the totals of both sides and the classes of what only one of them has; 1 where one has anything."""
    check_picture(options)
    scene = scene_of(options)
    left, right = (inverse_dynamics(scene, name) for name in options.formulations)
    state = [name for graph in (left, right) for names in state_names(graph, scene) for name in names]
    called = display_names(scene)
    comparison = cg.compare(left, right, atoms=dict.fromkeys(state), classify=formulation_classes, names=called)
    named = dict(zip(("left", "right"), options.formulations, strict=True))
    both = len(comparison.common)
    sizes = {"left_nodes": len(left.nodes), "right_nodes": len(right.nodes), "in_both": both}
    only = comparison.only_left, comparison.only_right
    lines = [
        f"{side}: {named[side]}, {len(graph.nodes)} nodes = {both} in both + {len(rest)} only {side}"
        for side, graph, rest in zip(named, (left, right), only, strict=True)
    ]
    data = {"scene": scene.name} | named | sizes | comparison.to_dict()
    together = comparison.overlay()
    groups = [f"only {name}" for name in options.formulations], (together.only_left, together.only_right)
    answer_and_draw(
        options,
        unless_json(options, data, "\n".join([*lines, str(comparison)])),
        together.graph,
        marked=dict(zip(*groups, strict=True)),
        names=theme.called(called),
        caption=f"{scene.name}: {' and '.join(options.formulations)} in one".replace("_", " "),
    )
    return 1 if any(only) else 0
