"""The Lagrangian of a planar arm written plainly, by positions and velocities of its centers of mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import cgraph as cg
from cgraph import Node


class PlainLink(Protocol):
    """Numbers or nodes of a link, as `PlanarLink` says them."""

    @property
    def mass(self) -> float | Node:
        """Of the link [kg]."""

    @property
    def length(self) -> float | Node:
        """From joint to joint [m]."""

    @property
    def center(self) -> float | Node:
        """From the joint to the center of mass [m]."""

    @property
    def inertia(self) -> float | Node:
        """About the center of mass [kg m^2]."""


def by_centers(q: Sequence[Node], qd: Sequence[Node], links: Sequence[PlainLink], gravity: float | Node) -> list[Node]:
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
