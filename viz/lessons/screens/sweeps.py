"""Sweeps: a formula as a graph, its values from the inputs up, its slopes from the output down, and rates once more up."""

import math
import re
from collections.abc import Mapping
from html import escape

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import columns, counted
from cgraph.extend import Names, cotangents
from dynamics import inverse_dynamics, momentum
from dynamics.systems.kinematics import changes

from ...graph_drawing.dot import to_dot
from ...graph_drawing.levels import levels_of
from ..glossary import term
from ..screen import Figure, Screen
from ..subject import Subject, lagrangian_graph, number

# fmt: off   (a table of rules)
RULES = {
    "add": "+ passes it to both arguments as it is",
    "sub": "− passes it to the first argument as it is, to the second with the other sign",
    "neg": "− passes it on with the other sign",
    "mul": "× passes to each factor its slope times the other factor",
    "cos": "cos x passes to x its slope times −sin x",
    "sin": "sin x passes to x its slope times cos x",
    "pow": "xʸ passes to x its slope times y xʸ⁻¹, such as 2x for a square",
}
# fmt: on
OTHERS = "any other operation passes on its slope times its own derivative"
ROWS = 60  # nodes that the page walks through
DRAWN = 40  # nodes, at most, of a graph that is drawn
SIGNS = {"values": " = ", "slopes": ": slope ", "rates": ": rate "}  # in the picture, before what a sweep finds
PUSH = 0.1  # by which a coordinate is changed


def formula_graph(subject: Subject) -> Screen:
    """The screen on what a computational graph is."""
    graph, name = lagrangian_graph(subject.system), f"q{subject.system.nq - 1}"
    (before,), (after,) = subject.evaluate(graph), subject.evaluate(graph, **{name: subject.values[name] + PUSH})
    (other,) = subject.evaluate(graph, **{name: subject.values[name] - PUSH})
    size = max(abs(float(each)) for each in (before, after, other))
    changes = max(abs(after - before), abs(other - before)) > 1e-12 * size
    used = [edge.source for edge in graph.edges] + list(graph.outputs.values())
    reached = name in {node.name for node in used if not node.args}
    shown = f"<b>{subject.told(name)}</b>"
    why = (
        f"<p>Edges lead from {shown} up to L, so its value takes part. L goes from {number(before)} to {number(after)}.</p>"
        if changes
        else f"<p>Edges lead from {shown} up to L, but what comes by them cancels: L stays {number(before)}.</p>"
        if reached
        else f"<p>No edge leads from {shown} up to L: the formula of L does not contain it. L stays {number(before)}.</p>"
    )
    return Screen(
        "formula-graph",
        "A formula as a graph",
        4,
        f"<p>A computer keeps the formula of L as a {term('computational graph')}. A {term('node')} is an {term('input')}, "
        f"a number, or one operation. An {term('edge')}, an arrow, leads from a node to every operation that uses it. "
        f"This graph has {len(graph.nodes)} nodes; inputs are at the bottom, L is at the top.</p>"
        f"<p>To compute L one walks from the bottom to the top, in a {term('forward sweep')}: every node computes its value "
        "from the values below it. v₁, v₂, … are names of values on the way.</p>" + _told_picture(graph),
        f"{shown} is changed by {PUSH:g}{subject.unit(name)}. All other inputs, the velocities too, are held. What does "
        "L do?",
        (
            "It changes",
            "It stays as it is",
            f"It changes only if {subject.told(f'qd{subject.system.n - 1}')} changes, too",
        ),
        0 if changes else 1,
        why + "<p>In this graph a coordinate q and its velocity q̇ are two inputs of their own: no edge leads from one "
        "to the other. Keep this in mind.</p>",
        f"L is {number(before)} in this moment.",
        f"Press Next and watch the values go up{_as_drawn(graph)} from the inputs to L.{_left_out(graph)}",
        *_walk(
            subject,
            graph,
            "values",
            _values(subject, graph),
            "The graph of L. Inputs are at the bottom.",
            "Write the value of every node beside it, from the bottom to the top, with four digits.",
            "The values of all nodes.",
        ),
    )


def backward_sweep(subject: Subject) -> Screen:
    """The screen on slopes."""
    graph, count = lagrangian_graph(subject.system), subject.system.n + subject.system.nq
    slopes = _swept(subject, graph, "slopes")
    return Screen(
        "sweeps",
        "Backward: the slopes of L",
        5,
        f"<p>Lagrange’s equation asks for ∂L/∂q and for p = ∂L/∂q̇, here {count} {term('slope', 'slopes')} of L: by how "
        "much L changes for each unit of an input.</p><p>They are found by the "
        f"{term('chain rule')}, node by node, in a {term('backward sweep')} from the top to the bottom. L itself has the "
        "slope 1. Then every node passes its slope down to what it is made of:</p>"
        f"<ul>{_rules(graph)}</ul>{_example(subject, graph, slopes)}<p>Where several edges leave a node, what comes back by them adds up.</p>",
        f"How many backward sweeps over the graph give all {count} slopes?",
        ("1", f"{count}, one for each slope", f"{len(graph.nodes)}, one for each node"),
        0,
        "<p>One sweep, because it passes every node and arrives at every input. From the bottom to the top, on the other "
        "hand, one would need a sweep for each input.</p>",
        "Forward, a sweep gives the slopes of all nodes by one input; backward, those of one output by all inputs, and L "
        "is one number.",
        f"Step through both sweeps, values upwards, then slopes downwards{_as_drawn(graph, '')}. Multiply a few of the slopes "
        f"by hand.{_left_out(graph)}",
        *_walk(
            subject,
            graph,
            "slopes",
            slopes,
            "The graph of L, with the values of all nodes.",
            "Write the slope of L by every node beside it, from the top to the bottom, with four digits. Begin with 1 at the top.",
            "The slopes of L by all nodes. At the bottom are ∂L/∂q and p = ∂L/∂q̇.",
        ),
    )


def forward_sweep(subject: Subject) -> Screen:
    """The screen on the rate of the momentum."""
    graph = cg.simplify(momentum(subject.system))
    counts = {name: len(inverse_dynamics(subject.system, name).nodes) for name in ("chain_rule", "chain_rule_literal")}
    swept, written = counts.values()
    few = " With one coordinate the table has little in it, so there is little to be saved." * (subject.system.n == 1)
    return Screen(
        "forward-sweep",
        "Forward: a rate in one sweep",
        5,
        f"<p>The {term('momentum')} p depends on q and q̇, which change at the rates q̇ and q̈. By the "
        f"{term('chain rule')}</p>"
        '<p class="display">dp/dt = (∂p/∂q) q̇ + (∂p/∂q̇) q̈.</p>'
        f"<p>Written out, these are tables of {subject.system.n} × {subject.system.nq + subject.system.n} slopes times the rates. But a "
        f"{term('forward sweep')} over the graph of p carries with every node the rate of its value: it starts with the "
        "rates q̇ and q̈ at the inputs and ends with dp/dt at the top. No table is ever made. By the chain rule the rate of a node "
        "is the sum, over what it is made of, of slope times rate: a product a b has the rate ȧ b + a ḃ.</p>"
        + _told_picture(graph),
        f"The graph of τ with every slope written out has {counted(written, 'node')}. The one by a forward sweep has …",
        ("fewer", "as many", "more"),
        0 if swept < written else 1 if swept == written else 2,
        f"<p>{counted(swept, 'node')} for {written}.{few} q and q̇ stay two separate inputs: there is no dt and no earlier state.</p>",
        "Both are right, to the last digits; they differ in size alone.",
        f"Press Next: every node of p computes its value and, with it, its rate{_as_drawn(graph, '')}. The inputs q and q̇ have the "
        f"rates q̇ and q̈, a parameter has 0, and at p stands dp/dt. Work a few of the rates out by hand.{_left_out(graph)}",
        *_walk(
            subject,
            graph,
            "rates",
            _swept(subject, graph, "rates"),
            "The graph of p, with the values of all nodes. Inputs are at the bottom.",
            "Write the rate of every node beside it, from the bottom to the top, with four digits. Begin with q̇ at q and q̈ at q̇; "
            "a parameter has the rate 0.",
            "The rates of all nodes. At the top is dp/dt.",
        ),
    )


def _rules(graph: Graph) -> str:
    """The chain rule at the operations of a graph, as items of a list."""
    ops = {node.op.name for node in graph.nodes if node.args}
    rules = [text for name, text in RULES.items() if name in ops]
    return "".join([f"<li>{text};</li>" for text in rules + [OTHERS] * bool(ops - {*RULES})])


def _example(subject: Subject, graph: Graph, slopes: Mapping[Node, float]) -> str:
    """The rule of a product at the highest node that is a number times another node, in the digits that are shown."""
    called, levels = _called(graph), levels_of(graph)
    products = [
        node for node in called if node.op.name == "mul" and sum([arg.value is not None for arg in node.args]) == 1
    ]
    if not products:
        return ""
    node = max(products, key=lambda each: (levels[each], slopes[each]))
    factor, other = sorted(node.args, key=lambda arg: arg.value is None)
    assert factor.value is not None
    name = called.get(other) or subject.shown(str(other.name))
    slope = number(slopes[node])
    passed = number(float(f"{slopes[node]:.4g}") * float(f"{factor.value:.4g}"))
    return (
        f"<p>For example, {called[node]} = {number(factor.value)} × {escape(name)} has the slope {slope}, so it passes "
        f"{slope} × {number(factor.value)} = {passed} down to {escape(name)}.</p>"
    )


def _left_out(graph: Graph) -> str:
    return f" Of {len(graph.nodes)} nodes the last {ROWS} are shown." if len(graph.nodes) > ROWS else ""


def _as_drawn(graph: Graph, end: str = ",") -> str:
    return "" if len(graph.nodes) > DRAWN else f", as in the picture{end}"


def _told_picture(graph: Graph) -> str:
    """Words in place of a picture that is not there, for a screen with something to play."""
    many = len(graph.nodes) > DRAWN
    told = "the same lesson on a two-link arm, <code>cgraph lesson</code>, has one"
    return f"<p>With {len(graph.nodes)} nodes the graph is too large for a picture here; {told}.</p>" if many else ""


def _walk(
    subject: Subject, graph: Graph, kind: str, found: Mapping[Node, float], caption: str, task: str, answer: str
) -> tuple[dict[str, object], str, Figure | None]:
    """The play of a sweep, its picture and its figure, which are there where the graph is small enough.

    kind: what the sweep finds, of `SIGNS`.  found: this of every node.  task: what to write on paper.
    """
    rows = _rows(subject, graph, kind, found)
    play = {"kind": "sweeps", "rows": rows, "slopes": kind == "slopes", "rates": kind == "rates"}
    if len(graph.nodes) > DRAWN:
        return play, "", None
    called = _called(graph)
    names = {**called, **{node: subject.shown(str(node.name)) for node in graph.nodes if not node.args and node.name}}

    def drawn(at: Mapping[Node, float], sign: str) -> str:
        texts = {node: f"{names[node]}{sign}{number(at[node])}" for node in names if node in at}
        inputs = {str(node.name): text for node, text in texts.items() if not node.args}
        formulas = {node: text for node, text in {**called, **texts}.items() if node.args}
        return subject.svg(
            to_dot(graph, names={**subject.names, **inputs}, formulas=formulas, clusters=False, legend=False)
        )

    ops = {node.op for node in called}
    if any([op.arity > 1 and not op.commutative for op in ops]):
        caption += " The numbers 1 and 2 at edges tell arguments apart."
    if any([op.name == "pow" for op in ops]):
        caption += " xʸ is a power."
    plain = drawn({} if kind == "values" else _values(subject, graph), SIGNS["values"])
    svg = re.sub(r'\bid="', f'id="{kind}-', drawn({}, ""))  # the page's script lights up nodes by their ids
    picture = f'<div class="graph-picture" role="img" aria-label="The graph, inputs at the bottom">{svg}</div>'
    return play, picture, Figure(plain, drawn(found, SIGNS[kind]), caption, task, answer)


def _called(graph: Graph) -> dict[Node, str]:
    """v7 of every operation: the numbers of the listing, and of the equations on the page."""
    numbers = Names(graph).number
    return {node: f"v{numbers[node]}" for node in graph.nodes if node.args}


def _values(subject: Subject, graph: Graph) -> dict[Node, float]:
    """Values of all nodes that are no numbers."""
    found = graph.values({name: subject.values[name] for name in graph.input_names})
    return {node: float(value) for node, value in found.items() if node.value is None}


def _swept(subject: Subject, graph: Graph, kind: str) -> dict[Node, float]:
    """Slopes of the one output by all nodes that are no numbers, backward, or their rates, forward from the inputs'."""
    nodes = [node for node in graph.nodes if node.value is None]
    if not nodes:
        return {}
    if kind == "slopes":
        found = cotangents({graph.only_output(): cg.constant(1.0)}, nodes)
    else:
        seeds = {node: cg.constant(subject.rates.get(str(node.name), 0.0)) for node in nodes if not node.args}
        found = changes(seeds, nodes)
    values = subject.evaluate(Graph(graph.inputs, {str(k): node for k, node in enumerate(found)}))
    return dict(zip(nodes, values.tolist(), strict=True))


def _rows(subject: Subject, graph: Graph, kind: str, swept: Mapping[Node, float]) -> list[dict[str, object]]:
    """The nodes from the bottom of the picture up: formula, value, slope of L or rate, and what an input's slope is."""
    ends = {node: name if name == "L" else subject.shown(name) for name, node in graph.outputs.items() if node.args}
    levels, place = levels_of(graph), {node: k for k, node in enumerate(graph.nodes)}
    values = _values(subject, graph)
    nodes = sorted(values, key=lambda node: (levels[node], place[node]))[-ROWS:]
    called = {**{node: subject.shown(str(node.name)) for node in nodes if not node.args}, **_called(graph)}

    def finite(found: Mapping[Node, float], node: Node) -> float | None:
        return found[node] if math.isfinite(found[node]) else None

    return [
        {
            "node": ends.get(node, called[node]),
            "box": f"{kind}-n{place[node]}",
            "text": _text(node, called) if node.args else "",
            "value": finite(values, node),
            "slope": finite(swept, node) if kind == "slopes" else None,
            "rate": finite(swept, node) if kind == "rates" else None,
            "what": _what(node),
        }
        for node in nodes
    ]


def _text(node: Node, called: Mapping[Node, str]) -> str:
    """The operation on its arguments, these by name or number."""
    parts = [number(arg.value) if arg.value is not None else called.get(arg, "…") for arg in node.args]
    if node.op.name == "pow":
        return " to the power ".join(parts)
    if columns(node.op).infix:
        return f" {columns(node.op).symbol} ".join(parts)
    return f"{columns(node.op).symbol}{parts[0]}" if columns(node.op).signs else f"{node.op.name}({', '.join(parts)})"


def _what(node: Node) -> str:
    """Meaning of the slope at an input."""
    name = node.name or ""
    if node.args or not name[-1:].isdigit():
        return ""
    return "p = ∂L/∂q̇" if name.startswith("qd") else "∂L/∂q" if name.startswith("q") else ""
