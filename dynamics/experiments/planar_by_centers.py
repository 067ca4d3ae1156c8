"""The Lagrangian of a planar arm written plainly, by positions and velocities of its centers of mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cgraph as cg
from cgraph import Node


def by_centers(q: Sequence[Node], qd: Sequence[Node], links: Sequence[Any], gravity: Any) -> list[Node]:
    """The partial Lagrangians, K = m v.v / 2 + I w^2 / 2.

    links: with mass, length, center and inertia. These and gravity are numbers or nodes.
    """
    partials: list[Node] = []
    angle, omega = q[0], qd[0]
    x, y, height = cg.constant(0.0), cg.constant(0.0), cg.constant(0.0)  # velocity of the joint, and its height
    for i, link in enumerate(links):
        if i:
            angle, omega = angle + q[i], omega + qd[i]
        s, c = cg.sin(angle), cg.cos(angle)
        r = link.center
        u, v = x + r * omega * c, y + r * omega * s
        kinetic = 0.5 * link.mass * (u * u + v * v) + 0.5 * link.inertia * (omega * omega)
        partials.append(kinetic - link.mass * gravity * (height - r * c))
        r = link.length
        x, y, height = x + r * omega * c, y + r * omega * s, height - r * c
    return partials
