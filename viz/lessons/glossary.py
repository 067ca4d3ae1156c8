"""Glossary of a lesson: its terms, links to them where they are first used, and what they mean at the end."""

import re
from html import escape

# fmt: off   (a table of terms)
TERMS = {
    "acceleration": "The rate of a velocity, written q̈. Here it is given: the lesson asks what makes the system accelerate so.",
    "backward sweep": "A walk through a graph from its output to its inputs. Every node passes its slope on to its arguments, by the chain rule.",
    "by definition": "The way of the paper’s Figure 1 to get d/dt: a step of time is written into the graph, and the graph is differentiated with respect to dt.",
    "chain rule": "The derivative of f(g(x)) is f′(g(x)) · g′(x): along a path of a graph the slopes multiply, and over several paths they add up.",
    "computational graph": "A formula as boxes and arrows: a node for each input, number and operation, an edge from everything that an operation uses.",
    "constraint": "A row z(q, q̇) that has to stay zero while the system moves, such as the length of a rod.",
    "coordinate": "A number that says where a part of the system is: an angle or a length, written q with the part’s name.",
    "dt": "The length of a step of time, in seconds. It is a small number, and an input of a graph with a step in it.",
    "edge": "An arrow of a graph: one use of a node by an operation.",
    "elimination": "Solving linear equations by taking out one unknown after the other.",
    "Euler relation": "A step of Euler’s method inside a graph: q = q̇ dt + q_old, the coordinate after a step from the one before.",
    "Euler’s method": "The simplest way to compute a motion: in a step dt every quantity moves along its present rate.",
    "forward sweep": "A walk through a graph from its inputs to its output. It computes values, or how fast they change.",
    "generalized force": "What drives a coordinate, written τ: a torque where the coordinate is an angle, a force where it is a length.",
    "inertial term": "The first term of Lagrange’s equation, dp/dt: the rate of the momentum.",
    "input": "A node without arguments: a number that is given from outside.",
    "kinetic energy": "Energy of motion, K: mass times speed squared, by two, summed over all parts.",
    "Lagrange’s equation": "τ = dp/dt − ∂L/∂q, one for each coordinate: what force or torque a motion needs. It is Newton’s law, for any coordinates.",
    "Lagrangian": "Kinetic minus potential energy, L = K − V, as a formula of coordinates q and velocities q̇.",
    "mass matrix": "The numbers M by which accelerations are multiplied in the equations of motion, M q̈ = τ − b; an entry on the diagonal is an inertia.",
    "momentum": "The slope of L by a velocity, p = ∂L/∂q̇. For a mass m on a line it is m times the velocity.",
    "multiplier": "The unknown force, written λ, that keeps a constraint at zero.",
    "node": "A box of a graph: an input, a number or an operation.",
    "order": "By how much smaller steps help: the error of a method of order k falls by 2 to the k-th when the step is halved.",
    "partial derivative": "∂L/∂q: how fast L changes with q while every other input is held. In a graph it is called a slope.",
    "pivot": "What is left on the diagonal when all unknowns that were to go first are taken out.",
    "potential energy": "Energy of place, V, such as that of a weight or a spring.",
    "rk4": "The classical Runge-Kutta method: a weighted mean of four slopes makes a step; its order is 4.",
    "slope": "A partial derivative: by how much the output changes for each unit of a node, everything else that is given held.",
    "spurious": "In a graph only because a derivative went through the Euler relation: there by mistake.",
    "state": "All coordinates and velocities at one moment.",
    "torque": "What turns a joint, written τ, in newton metres.",
    "velocity": "The rate of a coordinate, dq/dt, written q̇, read “q dot”.",
}
# fmt: on


def term(name: str, shown: str = "") -> str:
    """A link to a term of the glossary."""
    assert name in TERMS, name
    return f'<a class="term" href="#{_anchor(name)}">{escape(shown or name)}</a>'


def glossary(html: str) -> str:
    """The terms that a page links to, in order, as its last part."""
    linked = {*re.findall(r'class="term" href="#([\w-]+)"', html)}
    rows = [
        f'<dt id="{_anchor(name)}">{escape(name)}</dt><dd>{escape(text)}</dd>'
        for name, text in sorted(TERMS.items(), key=lambda row: row[0].lower())
        if _anchor(name) in linked
    ]
    return f'<details id="glossary"><summary>Glossary</summary>\n<dl>{"".join(rows)}</dl></details>'


def _anchor(name: str) -> str:
    return f"term-{re.sub(r'[^a-z0-9]+', '-', name.lower())}"
