"""`cgraph why`: what makes a torque, by which paths it depends on an input, and where the rate jumps or kinks."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, NamedTuple

import cgraph as cg
import dynamics as dyn

from . import library
from .arguments import (
    answer,
    answer_and_draw,
    check_picture,
    counting,
    equations_of,
    may_draw_and_print,
    point,
    scene_of,
    takes_a_scene,
    takes_equations,
    unless_json,
    verdict_of,
)
from .command import Command
from .points import REST, SHOWN, filled, point_text

if TYPE_CHECKING:
    from ..models.causes import CauseTable

KINDS = {"jump": "jumps, ", "kink": "kinks, the slope of ", "smooth": "no change near this state"}
PATHS = 5  # that are listed and drawn where nothing else is said


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    parser.add_argument(
        "output",
        metavar="WHAT",
        nargs="?",
        help="a torque, such as tau0 or tau.knee of a joint by its name; or a cause: gravity, 'inertia of LINK'",
    )
    parser.add_argument("input", metavar="INPUT", nargs="?", help="why it depends on this, such as q2, or q.hip")
    parser.late = "output", "input"
    takes_equations(parser)
    parser.add_argument(
        "--nan", action="store_true", help="where a value that is not finite, or a derivative by INPUT, comes from"
    )
    parser.add_argument(
        "--switches", action="store_true", help="on which surfaces the rate jumps or kinks, and by how much near --at"
    )
    parser.add_argument(
        "--k", type=counting, default=PATHS, metavar="K", help=f"paths to list, heaviest first (default: {PATHS})"
    )
    parser.add_argument("--at", type=point, default={}, metavar="A=1,B=2", help=f"at which state; {REST}")
    may_draw_and_print(parser)


def run(options: argparse.Namespace) -> int | None:
    """Print causes, then paths and what they add up to; of two that are not connected, where the chain stops."""
    if options.switches:
        _switches(options)
        return None
    if not options.output and not options.nan:
        raise ValueError("why needs to know WHAT: a torque, such as tau0, or a cause, such as gravity")
    if options.svg and not (options.input or options.nan):
        raise ValueError("--svg draws the paths from INPUT: name one, as in `why SCENE tau0 q1`")
    check_picture(options)
    scene = scene_of(options)
    verdict = verdict_of(options, scene)
    graph, _ = equations_of(options, scene, verdict)
    names = library.Names(graph, dyn.display_names(scene))
    at = filled(graph, scene, options.at)
    state = (
        f"At {point_text({names.shown(name): value for name, value in at.items()}, len(at) if options.at else SHOWN)}:"
    )
    if options.nan:
        return _nan(options, scene, names, at)
    table = None if verdict is None else library.CauseTable(scene, graph, verdict.formulation, at)
    output = (table and table.named(options.output)) or names.meant(options.output)
    if output in graph.outputs or output in names.by_name or table is None:
        question = _Question(scene, names, verdict, table, output, at, state)
        (_value if options.input is None else _dependence)(options, question)
        return None
    causes = table.in_all(options.output, options.input or "")
    if options.svg:
        raise ValueError(f"--svg draws paths between two nodes, and {causes.name!r} is a cause")
    answer(unless_json(options, {"at": at} | causes.to_dict(), f"{state}\n{causes}"))
    return None


class _Question(NamedTuple):
    """What is asked of an output, and where: its scene, the names of its graph, and a state with its words."""

    scene: dyn.scenes.Scene
    names: library.Names
    verdict: dyn.Verdict | None
    table: CauseTable | None  # of torques
    output: str
    at: dict[str, float]
    state: str


def _value(options: argparse.Namespace, question: _Question) -> None:
    """Causes of an output; of one that is no torque, its derivatives."""
    scene, names, _, table, output, at, state = question
    graph = names.graph
    if table is not None and output in graph.outputs:
        causes = table.of(output)
        text, data = f"{causes}\n{library.tree_alone(scene)}".rstrip(), causes.to_dict()
    else:
        slopes = library.Slopes(names, output, at)
        text, data = str(slopes), slopes.to_dict()
    answer(unless_json(options, {"at": at} | data, f"{state}\n{text}"))


def _dependence(options: argparse.Namespace, question: _Question) -> None:
    """Causes of a derivative, then the heaviest paths, in the listing's numbers, with a picture of these alone."""
    scene, names, verdict, table, output, at, state = question
    graph = names.graph
    found = cg.why(graph, output, options.input, at=at, k=options.k, names=dyn.display_names(scene))
    if not found.count:
        _not_connected(options, scene, names, output)
        return
    assert found.derivative is not None
    causes = table.of(output, options.input) if table is not None and output in graph.outputs else None
    all_listed = len(found.paths) == found.count
    total = sum([path.value or 0.0 for path in found.paths]) if all_listed else found.derivative
    derivative = _by_reverse_sweep(names, output, options.input, at)
    gap = abs(total - derivative)
    balance = {"sum_over_all_paths": total, "derivative_by_reverse_sweep": derivative, "difference": gap}
    what = "sum of path products" if all_listed else f"sum over all {found.count} path products"
    alone = "" if table is None else library.tree_alone(scene)
    text = [state, *([str(causes)] if causes else []), str(found)]
    text += [f"|{what} - derivative by a reverse sweep| = {gap:.2g}", *([alone] if alone else [])]
    data = {"depends": True, "of_the_tree": bool(alone), "at": at} | found.to_dict() | balance
    data |= {"causes": causes.to_dict()} if causes else {}
    wrong = verdict is not None and verdict.differs
    answer_and_draw(
        options,
        unless_json(options, data, "\n".join(text)),
        graph,
        scene,
        only=found.nodes,
        formulas={node: names.line(node).partition("  ")[0] for node in found.nodes if node.args},
        marked=found.nodes & verdict.nodes if verdict else (),
        marked_edges=found.edges & verdict.edges if verdict and wrong else found.edges,
        caption=f"{found.output} depends on {found.input}: {len(found.paths)} of {found.count} paths",
    )


def _nan(options: argparse.Namespace, scene: dyn.scenes.Scene, names: library.Names, at: dict[str, float]) -> int:
    """Print where a number that is not finite comes from; status 1 where there is one."""
    output = options.output and names.meant(options.output)
    found = cg.why_nan(names.graph, at, output or None, options.input, names=dyn.display_names(scene))
    marked = {found.node} & set(names.graph.nodes)
    answer_and_draw(options, unless_json(options, found.to_dict(), found), names.graph, scene, marked=marked)
    return 1 if found.what else 0


def _switches(options: argparse.Namespace) -> None:
    """Print the surfaces on which the rate jumps or kinks, drawn in it as the nodes that switch."""
    if options.output:
        raise ValueError(f"--switches is about the whole rate, and not about {options.output!r}")
    scene = scene_of(options)
    rate = dyn.hamilton_equations(scene) if options.momentum else dyn.state_equation(scene)
    names, at = library.Names(rate, dyn.display_names(scene)), filled(rate, scene, options.at)
    found = library.surfaces(scene, at, "momentum" if options.momentum else "velocity")
    lines = [f"Near {point_text({names.shown(name): x for name, x in at.items()}, len(at) if options.at else SHOWN)}:"]
    for each in found:
        by = ", ".join([f"{names.shown(name)} by {value:.6g}" for name, value in each.by.items()])
        tags = f"  [{', '.join(each.tags)}]" if each.tags else ""
        lines.append(f"  {each.formula}{tags}: {KINDS[each.kind]}{by}")
    text = "\n".join(lines) if found else "The rate is smooth: nothing in it switches."
    data = {"at": at, "surfaces": [each._asdict() for each in found]}
    marked = {"switches": {node for node in rate.nodes if node.op.name in library.SWITCHED}}
    answer_and_draw(options, unless_json(options, data, text), rate, scene, marked=marked)


def _not_connected(options: argparse.Namespace, scene: dyn.scenes.Scene, names: library.Names, output: str) -> None:
    graph = names.graph
    stops = cg.why_not(graph, output, options.input, names=dyn.display_names(scene))
    alone = "" if options.forward else library.tree_alone(scene)
    constant = _constant(scene, names, options, output) if options.momentum else ""
    here = set(graph.nodes)  # an input that nothing uses is none of the graph's nodes
    answer_and_draw(
        options,
        unless_json(
            options,
            {"depends": False, "of_the_tree": bool(alone)}
            | stops.to_dict()
            | ({"constant": constant} if constant else {}),
            "\n".join(filter(None, [str(stops), alone, constant])),
        ),
        graph,
        scene,
        marked={
            f"made from {stops.input}": stops.reached & here,
            f"{stops.output} is made from it": stops.made_from & here,
        },
        caption=f"{stops.output} does not depend on {stops.input}",
    )


def _constant(scene: dyn.scenes.Scene, names: library.Names, options: argparse.Namespace, output: str) -> str:
    """Sentence on a constant momentum whose rate was asked for, or whose coordinate the rate was asked by; or ""."""
    source = names.meant(options.input)
    told = [
        library.constant_momentum(name)
        for i, name in enumerate(scene.velocities)
        if output == f"p{i}_dot" or (source == f"q{i}" and scene.coordinates[i] == name)
        if name in dyn.conserved_momenta(scene)
    ]
    return "\n".join(told)


def _by_reverse_sweep(names: library.Names, output: str, source: str, at: dict[str, float]) -> float:
    """d output / d source by the library's reverse mode, which knows no paths."""
    (bar,) = library.cotangents({names.output(output): cg.constant(1.0)}, [names.one(source)])
    return float(cg.Graph(names.graph.inputs, {"bar": bar}).evaluate(at)["bar"])
