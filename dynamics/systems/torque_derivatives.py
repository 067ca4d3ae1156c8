"""TorqueDerivatives: inverse dynamics of a motion with its derivatives, as nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from cgraph import Node

MotionState = tuple[Sequence[Node], Sequence[Node], Sequence[Node]]  # q, qd, qdd


class TorqueDerivatives(NamedTuple):
    """Torques of a motion (q, qd, qdd), (n,), and rows of their derivatives, (n, n) each.

    by_q: by small displacements xi, dq = G xi, at fixed qd and qdd; where qd are the rates of q, by q.
    mass: by qdd, symmetric.
    """

    torques: list[Node]
    by_q: list[list[Node]]
    by_qd: list[list[Node]]
    mass: list[list[Node]]
