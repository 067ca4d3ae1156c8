"""Elimination, the last unknown first: what a joint feels of all that is beyond it."""

from html import escape

import numpy as np

from cgraph._shared import Array, counted
from dynamics import forward_dynamics, mass_matrix

from ...pages.document import Table
from ..glossary import term
from ..screen import Screen
from ..subject import SHOWN, Subject, number

_SAME = 1e-9  # of an inertia: a smaller difference is rounding


def elimination(subject: Subject) -> Screen:
    """The screen of a system."""
    graph, n = mass_matrix(subject.system), subject.system.n
    matrix = subject.evaluate(graph).reshape(n, n)
    pivots = _pivots(matrix)
    locked, free = float(matrix[0, 0]), float(pivots[0])
    first, tip = escape(subject.joints[0]), escape(subject.joints[-1])
    same = locked - free <= _SAME * locked
    rows = [[name, number(matrix[i, i]), number(pivots[i])] for i, name in enumerate(subject.joints[:SHOWN])]
    play = subject.play("elimination", {"graph": graph}, n=n, sliders=subject.sliders(), joints=subject.joints)
    size, one = len(forward_dynamics(subject.system).nodes), subject.joint
    unknown = f"{term('elimination', 'Elimination')} takes one unknown after the other out of the equations"
    return Screen(
        "elimination",
        "Elimination, the last first",
        5,
        f"<p>The other way round: τ is given, and the accelerations are asked. The equations are M q̈ = τ − b, with the "
        f"{term('mass matrix')} M. "
        + (
            f"Its entry M<sub>11</sub> = {number(locked)} is the inertia that <b>{first}</b> has while every other {one} is "
            f"<em>locked</em>. {unknown}, that of <b>{tip}</b> first. What is left on the diagonal, the {term('pivot')} of "
            f"{first}, is the inertia that it has while every other {one} moves <em>freely</em>.</p>"
            if n > 1
            else f"Here it has one entry, M<sub>11</sub> = {number(locked)}, the inertia of <b>{first}</b>. {unknown}, and what "
            f"is left on the diagonal is called a {term('pivot')}. Here there is one unknown alone.</p>"
        ),
        f"How large is the pivot of {first}, beside M<sub>11</sub> = {number(locked)}?",
        ("As large", "Smaller", "Larger"),
        0 if same else 1,
        "<p>"
        + (
            "There is nothing that could give way."
            if n == 1
            else f"No other {one} gives way when this one is accelerated, in this moment."
            if same
            else "What moves freely gives way, and so less inertia is felt."
        )
        + (
            " Each pivot is M<sub>ii</sub> less squares: D<sub>i</sub> = M<sub>ii</sub> − Σ<sub>k&gt;i</sub> "
            f"L<sub>ki</sub>² D<sub>k</sub>. From the last to the first, a {one} has to know those after it alone."
            if n > 1
            else ""
        )
        + f" cgraph does this on the graph of L itself: the accelerations of this system take {counted(size, 'node')}.</p>"
        + Table("Inertia", [one, "all others locked" if n > 1 else "M", "pivot"], rows).html(),
        f"The pivot is {number(free)}."
        + " A door with a second door hinged to it is easier to push than one with both in line and welded." * (n > 1),
        ""
        if n == 1
        else f"Take out one {one} after the other, the last first. Orange: the pivot. Then move the system and start again."
        if n <= 2 * SHOWN
        else "",
        play,
    )


def _pivots(matrix: Array) -> Array:
    """D of M = L^T D L, eliminated from the last coordinate to the first."""
    left = matrix.copy()
    for k in range(len(left) - 1, 0, -1):
        left[:k, :k] -= np.outer(left[:k, k], left[k, :k]) / left[k, k]
    return np.diag(left).copy()
