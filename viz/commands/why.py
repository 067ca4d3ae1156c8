"""`cgraph why`: along which paths an output of a scene's equations depends on an input, or why it does not."""

from __future__ import annotations

import argparse
import json

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Names, cotangents
from dynamics import forward_dynamics, inverse_dynamics

from ..graph_drawing.dot import to_dot
from .arguments import Commands, draw, may_draw_and_print, scene_of, takes_a_formulation, takes_a_scene, whole
from .point_arguments import REST, filled, point, point_text


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("why", help="the paths by which an output depends on an input, and what they weigh")
    takes_a_scene(parser)
    parser.add_argument("output", metavar="OUTPUT", help="such as tau0")
    parser.add_argument("input", metavar="INPUT", help="such as q2")
    which = parser.add_mutually_exclusive_group()
    takes_a_formulation(which)
    which.add_argument("--forward", action="store_true", help="of forward dynamics, with outputs such as qdd0")
    parser.add_argument("--k", type=whole, default=10, metavar="K", help="paths to list, heaviest first (default: 10)")
    parser.add_argument("--at", type=point, default={}, metavar="A=1,B=2", help=f"where paths are weighed; {REST}")
    may_draw_and_print(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the paths and what they add up to; of two that are not connected, where the chain stops."""
    scene = scene_of(options)
    graph = forward_dynamics(scene) if options.forward else inverse_dynamics(scene, options.formulation)
    at = filled(graph, scene, options.at)
    answer = cg.why(graph, options.output, options.input, at=at, k=options.k)
    if not answer.count:
        stops = cg.why_not(graph, options.output, options.input)
        print(json.dumps({"depends": False} | stops.to_dict(), indent=1) if options.json else stops)
        if options.svg:
            here = set(graph.nodes)  # an input that nothing uses is none of the graph's nodes
            marks = {
                f"made from {stops.input}": stops.reached & here,
                f"{stops.output} is made from it": stops.made_from & here,
            }
            draw(options, to_dot(graph, marked=marks, caption=f"{stops.output} does not depend on {stops.input}"))
        return 0
    assert answer.derivative is not None
    all_listed = len(answer.paths) == answer.count
    total = sum([path.value or 0.0 for path in answer.paths]) if all_listed else answer.derivative
    derivative = _by_reverse_sweep(graph, options.output, options.input, at)
    gap = abs(total - derivative)
    if options.json:
        balance = {"sum_over_all_paths": total, "derivative_by_reverse_sweep": derivative, "difference": gap}
        print(json.dumps({"depends": True, "at": at} | answer.to_dict() | balance, indent=1))
    else:
        what = "sum of path products" if all_listed else f"sum over all {answer.count} path products"
        print(f"At {point_text(at)}:\n{answer}\n|{what} - derivative by a reverse sweep| = {gap:.2g}")
    if options.svg:
        caption = f"{answer.output} depends on {answer.input}: {len(answer.paths)} of {answer.count} paths"
        draw(options, to_dot(graph, marked_edges=answer.edges, caption=caption))
    return 0


def _by_reverse_sweep(graph: Graph, output: str, source: str, at: dict[str, float]) -> float:
    """d output / d source by the library's reverse mode, which knows no paths."""
    names = Names(graph)
    (bar,) = cotangents({names.output(output): cg.constant(1.0)}, [names.one(source)])
    return float(Graph(graph.inputs, {"bar": bar}).evaluate(at)["bar"])
