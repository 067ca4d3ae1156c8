"""`cgraph compare`: what two formulations or both forms of a scene's equations share, and what only one of them has."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping

import cgraph as cg
import dynamics as dyn
from cgraph import _shared

from . import arguments, library
from .command import Command, flag
from .points import filled


def add(parser: Command) -> None:
    """The command's arguments."""
    arguments.takes_a_scene(parser)
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--formulations",
        nargs=2,
        default=("by_definition", "chain_rule"),
        type=arguments.formulation,
        choices=arguments.FORMULATIONS,
        metavar=("LEFT", "RIGHT"),
        help=f"two of {', '.join(arguments.FORMULATIONS)} (default: by_definition chain_rule)",
    )
    flag(which, "--momentum", f"the state equation and {arguments.MOMENTUM_FORM}")
    flag(which, "--sizes", "sizes of p and dp/dt and of tau by the paper's three formulations alone")
    arguments.may_draw_and_print(parser)


def run(options: argparse.Namespace) -> int:
    """Print the totals of both sides and the classes of what only one of them has; 1 where one has anything."""
    arguments.check_picture(options)
    scene = arguments.scene_of(options)
    if options.sizes:
        _sizes(options, scene)
        return 0
    names = [] if options.momentum else dict.fromkeys(options.formulations)
    verdicts = {name: dyn.formulation_verdict(scene, name) for name in names}
    graphs = library.both_forms(scene) if options.momentum else {name: each.graph for name, each in verdicts.items()}
    named = dict(zip(("left", "right"), graphs if options.momentum else options.formulations, strict=True))
    left, right = (graphs[name] for name in named.values())
    of_velocities = [] if options.momentum else [left, right]
    state = [name for each in of_velocities for part in arguments.state_names(each, scene) for name in part]
    called = dyn.display_names(scene)
    classes = library.form_classes if options.momentum else library.formulation_classes(verdicts.values())
    comparison = cg.compare(left, right, atoms=dict.fromkeys(state), classify=classes, names=called)
    both = len(comparison.common)
    sizes = {"left_nodes": len(left.nodes), "right_nodes": len(right.nodes), "in_both": both}
    only = comparison.only_left, comparison.only_right
    lines = [
        f"{side}: {named[side]}, {_shared.counted(len(graph.nodes), 'node')} = {both} in both + {len(rest)} only {side}"
        for side, graph, rest in zip(named, (left, right), only, strict=True)
    ]
    data = {"scene": scene.name} | named | sizes | comparison.to_dict()
    data |= {"verdicts": {name: each.to_dict() for name, each in verdicts.items()}} if verdicts else {}
    told = [f"{each}\n{each.off}" if each.excess else str(each) for each in verdicts.values()]
    if options.momentum:
        agreement, text = _forms(scene, graphs)
        data, lines = data | agreement, [text, *lines]
    together = comparison.overlay()
    groups = [f"only {name}" for name in named.values()], (together.only_left, together.only_right)
    arguments.answer_and_draw(
        options,
        arguments.unless_json(options, data, "\n".join([*lines, str(comparison), *told])),
        together.graph,
        scene,
        marked=dict(zip(*groups, strict=True)),
        caption=f"{scene.name}: {' and '.join(named.values())} in one".replace("_", " "),
    )
    return 1 if any(only) else 0


def _sizes(options: argparse.Namespace, scene: dyn.scenes.Scene) -> None:
    """Print `formulation_sizes`. Raises for --svg."""
    if options.svg:
        raise ValueError("--sizes has no picture: `cgraph draw` draws one graph of them")
    sizes = dyn.formulation_sizes(scene)
    rows = [(*key, *map(str, size)) for key, size in sizes.items()]
    fields = next(iter(sizes.values()))._fields
    text = "\n".join(library.table(("", "", *[name.replace("_", " ") for name in fields]), rows, (0, 1)))
    data = [{"term": term, "formulation": name} | size._asdict() for (term, name), size in sizes.items()]
    arguments.answer(arguments.unless_json(options, data, text))


def _forms(scene: dyn.scenes.Scene, graphs: Mapping[str, cg.Graph]) -> tuple[dict[str, _shared.Json], str]:
    """Sizes of both forms, and how far they agree at a state, as data and as text."""
    sizes, at = library.form_sizes(graphs), filled(graphs[library.LAGRANGE], scene, {})
    apart = library.form_agreement(scene, graphs, at)
    agreement = (
        f"At a state, velocities differ by {apart['velocities']:.1g}, and p_dot from dp/dt along the accelerations by "
        f"{apart['momentum_rates']:.1g}, relative to the largest."
    )
    told = {name: each if math.isfinite(each) else None for name, each in apart.items()}
    return {"sizes": sizes, "agreement": told}, f"{size_table(sizes)}\n{agreement}"


def size_table(sizes: Mapping[str, Mapping[str, int]]) -> str:
    """A line for each form of `form_sizes`, under a header."""
    words = {
        library.LAGRANGE: f"{library.LAGRANGE}, of (q, qd)",
        library.HAMILTON: f"{library.HAMILTON}, of (q, p), p = dL/dqd",
        library.VELOCITIES_ALONE: f"  the {library.VELOCITIES_ALONE}",
    }
    rows = [(words[name], *map(str, each.values())) for name, each in sizes.items()]
    return "\n".join(library.table(("", *next(iter(sizes.values()))), rows))
