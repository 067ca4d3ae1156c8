"""BodySystem: the Lagrangian system of bodies, which know more of their equations than their energy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from cgraph import Node
from cgraph.extend import Builder

from .system import BiasForce, System
from .torque_derivatives import MotionState, TorqueDerivatives


class BodySystem(System):
    """The system of bodies that give their bias themselves, by bias_forces(q, qd), and derivatives, likewise."""

    def __init__(
        self,
        bias_forces: Callable[[Sequence[Node], Sequence[Node]], Sequence[BiasForce]],
        torque_derivatives: Callable[[MotionState, Builder], TorqueDerivatives],
        *of_system: Any,
        require_values: Callable[[Mapping[str, ArrayLike]], None],
        lengths: tuple[float, ...],
        **more: Any,
    ) -> None:
        super().__init__(*of_system, **more)
        self._bias_forces, self._require_values, self._lengths = bias_forces, require_values, lengths
        self._torque_derivatives = torque_derivatives

    @property
    def lengths(self) -> tuple[float, ...]:
        """1 of lengths, and of angles what they move the bodies by [m]."""
        return self._lengths

    def _require_consistent(self) -> None:
        """Nothing: the types of joints are known to be."""

    def require_values(self, values: Mapping[str, ArrayLike]) -> None:
        """Raises ValueError for values with which the bodies cannot be."""
        self._require_values(values)

    def bias_forces(self) -> Sequence[BiasForce]:
        """The pairs (velocity, force) that the bodies state; see `System.bias_forces`."""
        return self._bias_forces(self.q, self.qd)

    def torque_derivatives(self, qdd: Sequence[Node], build: Builder) -> TorqueDerivatives:
        """In closed form; see `System.torque_derivatives`."""
        return self._torque_derivatives((self.q, self.qd, qdd), build)
