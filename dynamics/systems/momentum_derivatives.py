"""MomentumDerivatives: how velocities and rates of momenta depend on coordinates and momenta, as nodes."""

from __future__ import annotations

from typing import NamedTuple

from cgraph import Node


class MomentumDerivatives(NamedTuple):
    """Rows, (n, n) each, at a state (q, u), whose momenta are p = dL/du; by small displacements xi, dq = G xi.

    by_q: du/dxi at fixed p.  inverse: du/dp, M^-1.  second: d(G^T dL/dq)/dxi, where u moves with xi at fixed p.
    velocities: u of momenta p that are variables, over (q, p), (n,); or none.
    """

    by_q: list[list[Node]]
    inverse: list[list[Node]]
    second: list[list[Node]]
    velocities: list[Node]
