"""`cgraph why`: along which paths an output of a scene's equations depends on an input, or why it does not."""

from __future__ import annotations

import argparse

import cgraph as cg
import dynamics as dyn
from cgraph import extend

from . import library
from .arguments import (
    REST,
    answer_and_draw,
    check_picture,
    equations_of,
    filled,
    may_draw_and_print,
    point,
    point_text,
    scene_of,
    takes_a_scene,
    takes_equations,
    unless_json,
    whole,
)
from .command import Command


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    parser.add_argument("output", metavar="OUTPUT", help="such as tau0, or tau.knee of a joint by its name")
    parser.add_argument("input", metavar="INPUT", help="such as q2, or q.hip")
    takes_equations(parser)
    parser.add_argument("--k", type=whole, default=10, metavar="K", help="paths to list, heaviest first (default: 10)")
    parser.add_argument("--at", type=point, default={}, metavar="A=1,B=2", help=f"where paths are weighed; {REST}")
    may_draw_and_print(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the paths and what they add up to; of two that are not connected, where the chain stops."""
    check_picture(options)
    scene = scene_of(options)
    graph, _ = equations_of(options, scene)
    names = extend.Names(graph, dyn.display_names(scene))
    at = filled(graph, scene, options.at)
    found = cg.why(graph, options.output, options.input, at=at, k=options.k, names=dyn.display_names(scene))
    if not found.count:
        _not_connected(options, scene, names)
        return
    assert found.derivative is not None
    all_listed = len(found.paths) == found.count
    total = sum([path.value or 0.0 for path in found.paths]) if all_listed else found.derivative
    derivative = _by_reverse_sweep(names, options.output, options.input, at)
    shown = {names.shown(name): value for name, value in at.items()}
    gap = abs(total - derivative)
    balance = {"sum_over_all_paths": total, "derivative_by_reverse_sweep": derivative, "difference": gap}
    what = "sum of path products" if all_listed else f"sum over all {found.count} path products"
    alone = "" if options.forward else library.tree_alone(scene)
    text = f"At {point_text(shown)}:\n{found}\n|{what} - derivative by a reverse sweep| = {gap:.2g}"
    text = f"{text}\n{alone}" if alone else text
    answer_and_draw(
        options,
        unless_json(options, {"depends": True, "of_the_tree": bool(alone), "at": at} | found.to_dict() | balance, text),
        graph,
        scene,
        marked_edges=found.edges,
        caption=f"{found.output} depends on {found.input}: {len(found.paths)} of {found.count} paths",
    )


def _not_connected(options: argparse.Namespace, scene: dyn.scenes.Scene, names: extend.Names) -> None:
    graph = names.graph
    stops = cg.why_not(graph, options.output, options.input, names=dyn.display_names(scene))
    alone = "" if options.forward else library.tree_alone(scene)
    constant = _constant(scene, names, options) if options.momentum else ""
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


def _constant(scene: dyn.scenes.Scene, names: extend.Names, options: argparse.Namespace) -> str:
    """Sentence on a constant momentum whose rate was asked for, or whose coordinate the rate was asked by; or ""."""
    output, source = names.meant(options.output), names.meant(options.input)
    told = [
        library.constant_momentum(name)
        for i, name in enumerate(scene.velocities)
        if output == f"p{i}_dot" or (source == f"q{i}" and scene.coordinates[i] == name)
        if name in dyn.conserved_momenta(scene)
    ]
    return "\n".join(told)


def _by_reverse_sweep(names: extend.Names, output: str, source: str, at: dict[str, float]) -> float:
    """d output / d source by the library's reverse mode, which knows no paths."""
    (bar,) = extend.cotangents({names.output(output): cg.constant(1.0)}, [names.one(source)])
    return float(cg.Graph(names.graph.inputs, {"bar": bar}).evaluate(at)["bar"])
