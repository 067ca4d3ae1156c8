"""BodySystem: the Lagrangian system of bodies, which know more of their equations than their energy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Any, Protocol

from numpy.typing import ArrayLike

from cgraph import Node
from cgraph.extend import Builder

from .system import BiasForce, System
from .torque_derivatives import MotionState, TorqueDerivatives


class BodyEquations(Protocol):
    """What bodies know of their equations; see the methods of `System` of the same names, also for None."""

    @property
    def whole(self) -> BodyEquations | None:
        """The same with all inertial numbers of all bodies, where fewer may cost digits."""

    def bias_forces(self, q: Sequence[Node], qd: Sequence[Node], qdd: Sequence[Node] | None) -> Sequence[BiasForce]:
        """The pairs (velocity, force) of a motion; see `System.bias_forces` for None."""

    def regrouped_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """Those of as few inertial numbers as there can be, with the same derivatives in sum."""

    def mass_matrix(self, q: Sequence[Node], qd: Sequence[Node], lagrangian: Node, build: Builder) -> list[list[Node]]:
        """The lower triangle of M."""

    def momentum_rates(self, q: Sequence[Node], qd: Sequence[Node], p: Sequence[Node]) -> list[Node] | None:
        """Rates of the momenta p of velocities qd."""

    def torque_derivatives(self, state: MotionState, build: Builder) -> TorqueDerivatives | None:
        """Derivatives of the torques of a motion."""


class BodySystem(System):
    """The system of bodies that give bias, derivatives and rates of momenta themselves, by equations of theirs."""

    def __init__(
        self,
        equations: BodyEquations,
        *of_system: Any,
        require_values: Callable[[Mapping[str, ArrayLike]], None],
        lengths: tuple[float, ...],
        surely_regular: bool,
        **more: Any,
    ) -> None:
        super().__init__(*of_system, **more)
        self._equations, self._require_values, self._lengths = equations, require_values, lengths
        self._surely_regular = surely_regular

    @property
    def surely_regular(self) -> bool:
        """Where each body alone has inertia along the velocities of its joint: then no motion is without."""
        return self._surely_regular

    @cached_property
    def forms(self) -> list[System]:
        """The system, and one with the energy of base numbers, which is another but for its derivatives."""
        fewest = copy(self)
        vars(fewest).pop("lagrangian", None)
        fewest.partial_lagrangians = tuple(self._equations.regrouped_lagrangians(self.q, self.qd))
        return [self, fewest]

    @property
    def whole(self) -> System | None:
        """The same with all inertial numbers of all bodies, where fewer may cost digits; else None."""
        equations = self._equations.whole
        if equations is None:
            return None
        result = copy(self)
        result._equations = equations
        return result

    @property
    def lengths(self) -> tuple[float, ...]:
        """1 of lengths, and of angles what they move the bodies by [m]."""
        return self._lengths

    def _require_consistent(self) -> None:
        """Nothing: the types of joints are known to be."""

    def require_values(self, values: Mapping[str, ArrayLike]) -> None:
        """Raises ValueError for values with which the bodies cannot be."""
        self._require_values(values)

    def bias_forces(self, qdd: Sequence[Node] | None = None) -> Sequence[BiasForce]:
        """The pairs (velocity, force) that the bodies state; see `System.bias_forces`."""
        return self._equations.bias_forces(self.q, self.qd, qdd)

    def mass_matrix(self, lagrangian: Node, build: Builder | None = None) -> list[list[Node]]:
        """By composite inertias; see `System.mass_matrix`."""
        return self._equations.mass_matrix(self.q, self.qd, lagrangian, build or Builder())

    def momentum_rates(self, p: Sequence[Node]) -> list[Node] | None:
        """By composite momentum; see `System.momentum_rates`."""
        return self._equations.momentum_rates(self.q, self.qd, p)

    def torque_derivatives(self, qdd: Sequence[Node], build: Builder) -> TorqueDerivatives | None:
        """In closed form; see `System.torque_derivatives`."""
        return self._equations.torque_derivatives((self.q, self.qd, qdd), build)
