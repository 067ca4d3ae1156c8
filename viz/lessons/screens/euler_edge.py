"""The Euler edge: a step of time inside the graph, by which a velocity reaches its coordinate."""

import numpy as np

from cgraph import Graph, Node, constant, variable
from dynamics.equations.formulations.lagrange_terms import COUPLING, EULER, after_a_step

from ...graph_drawing.dot import to_dot
from ..glossary import term
from ..screen import Figure, Screen
from ..subject import DT, Subject, number

INSIDE = "L"  # tag of what is not the step: one box of the picture
DRAWN = 2  # joints; of more, one


def euler_edge(subject: Subject) -> Screen:
    """The screen of a system."""
    velocity, name, rise = _pushed(subject)
    coordinate, pushed = f"<b>{subject.told(name)}</b>", f"<b>{subject.told(velocity)}</b>"
    unit, speed = subject.unit(name), subject.unit(velocity)
    by_rate = rise / DT
    step = after_a_step(subject.system)
    play = subject.play(
        "rows",
        {"graph": Graph(step.inputs, {f"{name}_old": variable(f"{name}_old"), name: step.outputs[name]})},
        sliders=[
            {"name": f"{velocity}_old", "shown": f"{subject.told(velocity)} before the step", "low": -3.0, "high": 3.0,
             "value": subject.values[f"{velocity}_old"]},
        ],
        dt=True,
        header=["quantity", "value"],
        rows=[[f"{subject.told(name)} {when} the step", each] for when, each in (("before", f"{name}_old"), ("after", name))],
    )  # fmt: skip
    return Screen(
        "euler-edge",
        "A step of time in the graph",
        5,
        f"<p>Lagrange’s equation needs dp/dt, the rate of the momentum. But time is no {term('input')} of the graph of L. "
        "How can a graph be differentiated with respect to time?</p><p>One idea: write into the graph what a simulation "
        f"does in a short step of length {term('dt')}. That is a step of {term('Euler’s method')}, every quantity moving "
        "along its rate:</p>"
        '<p class="display">q̇ = q̈ dt + q̇_old &nbsp; and &nbsp; <b>q = q̇ dt + q_old</b></p>'
        f"<p>The second is the {term('Euler relation')}. The inputs are now the {term('state')} before the step, marked "
        "_old, the accelerations and dt. The picture shows the step, with the graph of L as one box. The node with "
        f"{coordinate} in it adds up that coordinate; “×2” at an edge stands for two edges.</p>",
        f"In <em>this</em> graph {pushed} is raised by 1{speed}, through its input {subject.told(velocity + '_old')}. dt = {DT:g} s and {subject.told(name + '_old')} are "
        f"held. What does {coordinate} do?",
        (
            "It stays: a velocity and a coordinate are separate inputs",
            f"It moves by {number(rise)}{unit}",
            f"It moves by {number(by_rate)}{unit}",
        ),
        1 if rise else 0,
        f"<p>Along the edge from {pushed} through × to {coordinate} the change is multiplied by dt, so it is small, but it is there. In the graph of L "
        "alone there was no such edge: there q and q̇ were separate inputs, as the partial derivatives ∂L/∂q and ∂L/∂q̇ "
        "want them.</p>",
        "Listen for “but velocity does move position!” True along a motion, and the chain rule uses it; not in ∂L/∂q̇, "
        "where a state is varied that nothing has moved yet.",
        f"Move dt and the velocity, and watch {coordinate}. For which dt does the velocity have no influence?",
        play,
        figure=_figure(subject),
    )


def _pushed(subject: Subject) -> tuple[str, str, float]:
    """A velocity, the coordinate that it moves the most through the step, and by how much for one unit of it."""
    step, k = after_a_step(subject.system), subject.watched
    names = [f"q{i}" for i in range(subject.system.nq)]
    graph = Graph(step.inputs, {name: step.outputs[name] for name in names})
    old = f"qd{k}_old"  # which moves qd by as much
    moved = subject.evaluate(graph, **{old: subject.values[old] + 1.0}) - subject.evaluate(graph)
    place = int(np.abs(moved).argmax())
    return f"qd{k}", names[place], float(moved[place])


def _figure(subject: Subject) -> Figure:
    graph = step_graph(subject)
    edges = [edge for edge in graph.edges if COUPLING in edge.target.tags and edge.source.name != "dt"]
    into = [edge for edge in graph.edges if COUPLING in edge.source.tags]
    plain, marked = (
        to_dot(graph, names=subject.names, collapse=[INSIDE], clusters=False, legend=False, marked_edges=each)
        for each in ((), [*edges, *into])
    )
    one = f" Of {subject.system.n} coordinates one is drawn; the others are alike." if subject.system.n > DRAWN else ""
    return Figure(
        subject.svg(plain),
        subject.svg(marked),
        f"A step of length dt, and L of the state after it. Inputs are at the bottom, L is at the top.{one}",
        "Draw over the edges by which a velocity q̇ reaches a coordinate q. Then draw, in another color, the way of "
        "the slope from L back to q̇ through q.",
        f"In vermillion, an orange red, the Euler relation: from q̇ through × to q.{one}",
    )


def step_graph(subject: Subject) -> Graph:
    """L after a step, its own nodes tagged as one part; of many joints the step of one, the others as numbers."""
    graph, system = after_a_step(subject.system), subject.system
    drawn = {*range(system.n)} if system.n <= DRAWN and system.nq == system.n else {subject.watched}
    kept = {f"qd{i}" for i in drawn} | {f"q{i}" for i in range(system.nq) if system.nq > system.n or i in drawn}
    copies: dict[Node, Node] = {}
    for node in graph.nodes:
        if not node.args:
            copies[node] = node
        elif node.name and EULER in node.tags and node.name not in kept:
            copies[node] = constant(subject.values[node.name])
        else:
            label = node.label if EULER in node.tags else node.label.tagged(frozenset({INSIDE}))
            copies[node] = Node(node.op, tuple([copies[arg] for arg in node.args]), label, name=node.name)
    return Graph(graph.inputs, {"L": copies[graph.outputs["L"]]})
