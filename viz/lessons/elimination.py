"""Elimination from the tip to the base: what a joint feels of all that is beyond it."""

from __future__ import annotations

from html import escape

import numpy as np

from cgraph.extend import Array
from dynamics import forward_dynamics, mass_matrix

from ..pages.document import Table
from .subject import SHOWN, Screen, Subject, number

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
    size = len(forward_dynamics(subject.system).nodes)
    return Screen(
        "elimination",
        "Elimination from tip to base",
        4,
        f"<p>Accelerations come from M q̈ = τ − b. The entry M<sub>11</sub> = {number(locked)} is the inertia that "
        + (
            f"<b>{first}</b> feels while all other joints are <em>locked</em>. Elimination takes one joint after the other "
            f"out of the equations, <b>{tip}</b> first. What is left on the diagonal, the <b>pivot</b> of {first}, is the "
            "inertia that it feels while all others swing <em>freely</em>.</p>"
            if n > 1
            else f"<b>{first}</b> feels. Elimination takes one joint after the other out of the equations, and what is left "
            "on the diagonal is its <b>pivot</b>. Here there is one coordinate alone.</p>"
        ),
        f"How large is that pivot, beside M<sub>11</sub> = {number(locked)}?",
        ("as large", "smaller", "larger"),
        0 if same else 1,
        "<p>"
        + (
            "<b>A.</b> There is no other joint that could give way."
            if n == 1
            else "<b>A.</b> No other joint gives way when this one is accelerated, at this state."
            if same
            else "<b>B.</b> The joints that swing freely give way, and so less inertia is felt."
        )
        + " Each pivot is M<sub>ii</sub> less a square: D<sub>i</sub> = M<sub>ii</sub> − Σ<sub>k</sub> "
        "L<sub>ki</sub>² D<sub>k</sub>. From the tip to the base, a joint has to know the joints beyond it alone, as the "
        "articulated bodies of robotics do. cgraph does this on the graph of L itself: accelerations of this system "
        f"take {size} nodes.</p>"
        + Table("Inertia felt at a joint", ["joint", "all others locked", "pivot"], rows).html(),
        "Take out joint after joint, from the tip. Orange: the pivot. Then move the joints and start again.",
        play if n <= 2 * SHOWN else None,
        f"The pivot is {number(free)}. A door with a second door hinged to it is easier to push than one with both in line "
        "and welded.",
    )


def _pivots(matrix: Array) -> Array:
    """D of M = L^T D L, eliminated from the last coordinate to the first."""
    left = matrix.copy()
    for k in range(len(left) - 1, 0, -1):
        left[:k, :k] -= np.outer(left[:k, k], left[k, :k]) / left[k, k]
    return np.diag(left).copy()
