"""Sweeps: how a graph is differentiated, once forward for values and once backward for all slopes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Names, columns, cotangents
from dynamics import inverse_dynamics

from ..graph_drawing.dot import plain_drawing
from ..graph_drawing.render import render_svg
from .subject import Screen, Subject, inline, lagrangian_graph, number

ROWS = 120  # nodes that the page walks through
DRAWN = 40  # nodes, at most, of a graph that is drawn


def sweeps(subject: Subject) -> Screen:
    """The screen of a system."""
    graph, n = lagrangian_graph(subject.system), subject.system.n
    whole, literal = (
        len(inverse_dynamics(subject.system, name).nodes) for name in ("chain_rule", "chain_rule_literal")
    )
    choices = ("1", f"{n + subject.system.nq}, one for each", f"{len(graph.nodes)}, one for each node")
    return Screen(
        "sweeps",
        "The chain rule in sweeps",
        3,
        f"<p>The third way needs no dt. p depends on q and q̇, which change at the rates q̇ and q̈: dp/dt = (∂p/∂q) q̇ + "
        f"(∂p/∂q̇) q̈. First we need all of p = ∂L/∂q̇ and ∂L/∂q, {n + subject.system.nq} slopes of L. Its graph has "
        f"{len(graph.nodes)} nodes; a <b>sweep</b> walks through it once and applies the chain rule at every node.</p>",
        f"How many backward sweeps over the graph of L give all {n + subject.system.nq} slopes?",
        choices,
        0,
        "<p><b>A.</b> Backward, every node passes its slope on to its arguments, and what reaches a node twice adds up. "
        "So one sweep arrives at all inputs at once. A second sweep, forward along (q̇, q̈), then gives all of dp/dt, "
        f"and no ∂p/∂q is ever written out. The whole torque takes {whole} nodes; with every gradient written out it "
        f"takes {literal}. q and q̇ stay two separate inputs: there is no dt and no earlier state.</p>",
        "Step through both sweeps: values come down the table, slopes up."
        + (f" Of {len(graph.nodes)} nodes the last {ROWS} are shown." if len(graph.nodes) > ROWS else ""),
        {"kind": "sweeps", "rows": _rows(subject, graph)},
        "Forward mode would take a sweep for each input; backward mode one for each output, and L is one number.",
        _picture(subject, graph),
    )


def _picture(subject: Subject, graph: Graph) -> str:
    """The graph of L, where it is small enough."""
    if len(graph.nodes) > DRAWN:
        return ""
    return inline(render_svg(plain_drawing(graph, subject.names)), "sweep", "The graph of L")


def _rows(subject: Subject, graph: Graph) -> list[dict[str, object]]:
    """The nodes: formula, value, slope of L by the node, and what an input's slope is."""
    (end,) = graph.outputs.values()
    nodes = [node for node in graph.nodes if node.value is None][-ROWS:]
    bars = cotangents({end: cg.constant(1.0)}, nodes)
    values = subject.evaluate(Graph(graph.inputs, {str(k): node for k, node in enumerate(nodes)}))
    slopes = subject.evaluate(Graph(graph.inputs, {str(k): bar for k, bar in enumerate(bars)}))
    place = {node: k for k, node in enumerate(graph.nodes)}
    numbers = Names(graph).number  # those of the listing, and of the equations on the page
    called = {node: f"v{numbers[node]}" if node.args else subject.shown(str(node.name)) for node in nodes}
    return [
        {
            "node": called[node],
            "box": f"sweep-n{place[node]}",
            "text": _text(node, called) if node.args else "",
            "value": value if math.isfinite(value) else None,
            "slope": slope if math.isfinite(slope) else None,
            "what": _what(node),
        }
        for node, value, slope in zip(nodes, values.tolist(), slopes.tolist(), strict=True)
    ]


def _text(node: Node, called: Mapping[Node, str]) -> str:
    """The operation on its arguments, these by name or number."""
    parts = [number(arg.value) if arg.value is not None else called.get(arg, "…") for arg in node.args]
    if columns(node.op).infix:
        return f" {columns(node.op).symbol} ".join(parts)
    return f"{columns(node.op).symbol}{parts[0]}" if columns(node.op).signs else f"{node.op.name}({', '.join(parts)})"


def _what(node: Node) -> str:
    """Meaning of the slope at an input."""
    name = node.name or ""
    if node.args or not name[-1:].isdigit():
        return ""
    return "p = ∂L/∂q̇" if name.startswith("qd") else "∂L/∂q" if name.startswith("q") else ""
