"""BodyTerms: what rigid bodies know of the equations of their system beside its Lagrangian, as data of the system."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array
from cgraph.extend import Builder

BiasForce = tuple[Node, Node]  # a velocity, and the force that works on it
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


class BodyEquations(Protocol):
    """Equations that bodies state; where they give None, they follow from the Lagrangian."""

    @property
    def whole(self) -> BodyEquations | None:
        """Equations with all inertial numbers of all bodies, where fewer may cost digits."""

    def bias_forces(self, q: Sequence[Node], qd: Sequence[Node], qdd: Sequence[Node] | None) -> Sequence[BiasForce]:
        """Forces f at velocities z with sum of f dz/dqd = d/dt dL/dqd - dL/dq: the bias, where qdd is None, 0."""

    def regrouped_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """Lagrangians of as few inertial numbers as there can be, with the same derivatives in sum."""

    def mass_matrix(self, q: Sequence[Node], qd: Sequence[Node], lagrangian: Node, build: Builder) -> list[list[Node]]:
        """The lower triangle of M by composite inertias."""

    def momentum_rates(self, q: Sequence[Node], qd: Sequence[Node], p: Sequence[Node]) -> list[Node] | None:
        """dL/dq, of quasi-velocities as `Kinematics.slopes` has it, at velocities qd of momenta p."""

    def torque_derivatives(self, state: MotionState, build: Builder) -> TorqueDerivatives | None:
        """Torques of a motion and their derivatives, without damping and applied forces."""


@dataclass(frozen=True)
class BodyTerms:
    """Terms of a system of rigid bodies beside its Lagrangian.

    lengths: as of `System`.  surely_regular: each body alone has inertia along the velocities of its joint, so that no
    motion is without.  require_values: raises ValueError for values of parameters with which the bodies cannot be.
    bodies: the `Mechanism`, or the `Table` of `Rows`.  linearized: of rows alone, A and B at a state and tau.
    """

    equations: BodyEquations
    lengths: tuple[float, ...]
    surely_regular: bool
    require_values: Callable[[Mapping[str, ArrayLike]], None]
    bodies: Any = None
    linearized: Callable[..., tuple[Array, Array]] | None = None
