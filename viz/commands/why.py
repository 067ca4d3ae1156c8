"""`cgraph why`: what makes a torque, by which paths it depends on an input, and where the rate jumps or kinks."""

from __future__ import annotations

import argparse

import cgraph as cg
import dynamics as dyn

from . import arguments, library
from .command import Command, flag
from .points import REST, filled

KINDS = {"jump": "jumps, ", "kink": "kinks, the slope of ", "smooth": "no change near this state"}
SHOWN = 12  # inputs that a line of text names
PATHS = 5  # that are listed and drawn where nothing else is said


def add(parser: Command) -> None:
    """The command's arguments."""
    arguments.takes_equations(parser)
    parser.add_argument(
        "output",
        metavar="WHAT",
        nargs="?",
        help="a torque, such as tau0 or tau.knee of a joint by its name; or a cause: gravity, 'inertia of LINK'",
    )
    parser.add_argument("input", metavar="INPUT", nargs="?", help="why it depends on this, such as q2, or q.hip")
    parser.late = "output", "input"
    flag(parser, "--nan", "where a value that is not finite, or a derivative by INPUT, comes from")
    flag(parser, "--switches", "on which surfaces the rate jumps or kinks, and by how much near --at")
    parser.add_argument(
        "--k",
        type=arguments.counting,
        default=PATHS,
        metavar="K",
        help=f"paths to list, heaviest first (default: {PATHS})",
    )
    parser.add_argument("--at", type=arguments.point, default={}, metavar="A=1,B=2", help=f"at which state; {REST}")
    arguments.may_draw_and_print(parser)


def run(options: argparse.Namespace) -> int | None:
    """Print causes, then paths and what they add up to; of two that are not connected, where the chain stops."""
    if options.switches:
        _switches(options)
        return None
    if not options.output and not options.nan:
        raise ValueError("why needs to know WHAT: a torque, such as tau0, or a cause, such as gravity")
    if options.svg and not (options.input or options.nan):
        raise ValueError("--svg draws the paths from INPUT: name one, as in `why SCENE tau0 q1`")
    arguments.check_picture(options)
    scene = arguments.scene_of(options)
    graph, _, verdict = arguments.equations_of(options, scene)
    names = library.Names(graph, dyn.display_names(scene))
    at = filled(graph, scene, options.at)
    if options.nan:
        return _nan(options, scene, names, at)
    table = None if verdict is None else library.CauseTable(scene, graph, verdict.formulation, at)
    output = (table and table.named(options.output)) or names.meant(options.output)
    state, alone = f"At {_state(options, names, at)}:", ""
    asked: library.Causes | library.CauseInAll | library.Slopes
    if output in graph.outputs or output in names.by_name or table is None:
        if options.input is not None:
            _dependence(options, scene, names, verdict, table, output, at)
            return None
        if table is not None and output in graph.outputs:
            asked, alone = table.of(output), library.tree_alone(scene)
        else:
            asked = library.Slopes(names, output, at)
    else:
        asked = in_all = table.in_all(options.output, options.input or "")
        if options.svg:
            raise ValueError(f"--svg draws paths between two nodes, and {in_all.name!r} is a cause")
    arguments.answer(
        arguments.unless_json(options, {"at": at} | asked.to_dict(), f"{state}\n{asked}\n{alone}".rstrip())
    )
    return None


def _state(options: argparse.Namespace, names: library.Names, at: dict[str, float]) -> str:
    """The state in words: all of one that was asked for, else the first of its numbers."""
    shown, most = [f"{names.shown(name)}={x:g}" for name, x in at.items()], len(at) if options.at else SHOWN
    return ", ".join([*shown[:most], *([f"and {len(at) - most} more"] if len(at) > most else [])])


def _dependence(
    options: argparse.Namespace,
    scene: dyn.scenes.Scene,
    names: library.Names,
    verdict: dyn.Verdict | None,
    table: library.CauseTable | None,
    output: str,
    at: dict[str, float],
) -> None:
    """Causes of a derivative, then the heaviest paths, in the listing's numbers, with a picture of these alone."""
    graph = names.graph
    found = cg.why(graph, output, options.input, at=at, k=options.k, names=dyn.display_names(scene))
    if not found.count:
        _not_connected(options, scene, names, output)
        return
    assert found.derivative is not None
    causes = table.of(output, options.input) if table is not None and output in graph.outputs else None
    all_listed = len(found.paths) == found.count
    total = sum([path.value or 0.0 for path in found.paths]) if all_listed else found.derivative
    (bar,) = library.cotangents({names.output(output): cg.constant(1.0)}, [names.one(options.input)])
    derivative = float(cg.Graph(graph.inputs, {"bar": bar}).evaluate(at)["bar"])
    gap = abs(total - derivative)
    balance = {"sum_over_all_paths": total, "derivative_by_reverse_sweep": derivative, "difference": gap}
    what = "sum of path products" if all_listed else f"sum over all {found.count} path products"
    alone = "" if table is None else library.tree_alone(scene)
    text = [f"At {_state(options, names, at)}:", *([str(causes)] if causes else []), str(found)]
    text += [f"|{what} - derivative by a reverse sweep| = {gap:.2g}", *([alone] if alone else [])]
    data = {"depends": True, "of_the_tree": bool(alone), "at": at} | found.to_dict() | balance
    data |= {"causes": causes.to_dict()} if causes else {}
    wrong = verdict is not None and verdict.differs
    arguments.answer_and_draw(
        options,
        arguments.unless_json(options, data, "\n".join(text)),
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
    arguments.answer_and_draw(
        options, arguments.unless_json(options, found.to_dict(), found), names.graph, scene, marked=marked
    )
    return 1 if found.what else 0


def _switches(options: argparse.Namespace) -> None:
    """Print the surfaces on which the rate jumps or kinks, drawn in it as the nodes that switch."""
    if options.output:
        raise ValueError(f"--switches is about the whole rate, and not about {options.output!r}")
    scene = arguments.scene_of(options)
    rate = dyn.hamilton_equations(scene) if options.momentum else dyn.state_equation(scene)
    names, at = library.Names(rate, dyn.display_names(scene)), filled(rate, scene, options.at)
    found = library.surfaces(scene, at, "momentum" if options.momentum else "velocity")
    lines = [f"Near {_state(options, names, at)}:"]
    for each in found:
        by = ", ".join([f"{names.shown(name)} by {value:.6g}" for name, value in each.by.items()])
        tags = f"  [{', '.join(each.tags)}]" if each.tags else ""
        lines.append(f"  {each.formula}{tags}: {KINDS[each.kind]}{by}")
    text = "\n".join(lines) if found else "The rate is smooth: nothing in it switches."
    data = {"at": at, "surfaces": [each._asdict() for each in found]}
    marked = {"switches": {node for node in rate.nodes if node.op.name in library.SWITCHED}}
    arguments.answer_and_draw(options, arguments.unless_json(options, data, text), rate, scene, marked=marked)


def _not_connected(options: argparse.Namespace, scene: dyn.scenes.Scene, names: library.Names, output: str) -> None:
    graph = names.graph
    stops = cg.why_not(graph, output, options.input, names=dyn.display_names(scene))
    alone = "" if options.forward else library.tree_alone(scene)
    source, conserved = names.meant(options.input), dyn.conserved(scene).quantities if options.momentum else {}
    told = [  # of a momentum whose rate was asked for, or whose coordinate the rate was asked by
        f"The momentum of {name!r} is constant while no torque acts on it: neither L nor a force depends on it."
        for i, name in enumerate(scene.velocities)
        if output == f"p{i}_dot" or (source == f"q{i}" and scene.coordinates[i] == name)
        if f"p.{name}" in conserved
    ]
    data = {"depends": False, "of_the_tree": bool(alone)} | stops.to_dict()
    data |= {"constant": "\n".join(told)} if told else {}
    here = set(graph.nodes)  # an input that nothing uses is none of the graph's nodes
    arguments.answer_and_draw(
        options,
        arguments.unless_json(options, data, "\n".join(filter(None, [str(stops), alone, *told]))),
        graph,
        scene,
        marked={
            f"made from {stops.input}": stops.reached & here,
            f"{stops.output} is made from it": stops.made_from & here,
        },
        caption=f"{stops.output} does not depend on {stops.input}",
    )
