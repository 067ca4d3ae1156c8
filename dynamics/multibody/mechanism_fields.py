"""The fields of a mechanism, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from numpy.typing import ArrayLike

from .body import Body
from .external_force import Force
from .joint_force import JointForce
from .link_cache import SharedParts
from .loops import Loop


@dataclass(frozen=True, eq=False)
class Structure:
    """The fields of a `Mechanism`, see there."""

    bodies: Sequence[Body]
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    forces: Sequence[Force | JointForce] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    locked: Mapping[str, float | ArrayLike] = field(default_factory=dict)
    base_parameters: bool = False
    left_out: tuple[str, ...] = ()
    loops: Sequence[Loop] = ()
    shared: SharedParts = field(default_factory=SharedParts, repr=False, kw_only=True)

    @property
    def parameter_values(self) -> dict[str, float]:
        """Values of the parameters: those that forces name, 0 where nothing else is said."""
        names = [each for force in self.forces for each in force.components if isinstance(each, str)]
        return dict.fromkeys(names, 0.0) | dict(self.parameters)
