"""Forces and torques on bodies, from outside."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node

from ..algebra.spatial import Triple
from ..bodies.body import MechanismError, unknown_body, vector
from ..parameters import names_in
from ..sweeps.kinematic_chain import KinematicChain

FORCE = "force"  # tag
FRAMES = ("world", "body")
Component = Node | float | str


class HasParameters:
    """Base of forces: what of them may be parameters, and the names of these."""

    @property
    def components(self) -> tuple[Component, ...]:
        """Names of the parameters that it uses, and that are 0 without a value; of one of your own what it reads."""
        return ()

    @property
    def quantities(self) -> Mapping[str, Callable[[str, object], object]]:
        """Fields that may be parameters, and the checks of their values."""
        return {}

    @property
    def names(self) -> set[str]:
        """Set of the names of its parameters and variables."""
        return set(names_in([*self.components, *[getattr(self, name) for name in self.quantities]]))


@dataclass(frozen=True, eq=False)
class Force(HasParameters):
    """A force on a body at a point, and a torque on the body, from outside the mechanism.

    Parameters
    ----------
    body : str
        Name of the body.
    value, torque : sequence of 3
        Force [N] and torque [N m] in the axes of `frame`. A component is a number, a parameter's name, or a node over
        q0.., qd0.., t and parameters.
    at : array_like, (3,)
        The point, in the body's frame [m].
    frame : str
        "world", or "body": force and torque then turn with the body.

    Examples
    --------
    >>> import dynamics as dyn
    >>> cart = dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    >>> pushed = dyn.Mechanism([cart], forces=[dyn.Force("cart", ("push", 0.0, 0.0))])
    >>> dyn.forward_dynamics(pushed).evaluate({"q0": 0.0, "qd0": 0.0, "tau0": 0.0, "push": 4.0})
    {'qdd0': 2.0}
    """

    body: str
    value: Sequence[Component] = (0.0, 0.0, 0.0)
    at: ArrayLike = (0.0, 0.0, 0.0)
    frame: str = "world"
    torque: Sequence[Component] = (0.0, 0.0, 0.0)

    @property
    def components(self) -> tuple[Component, ...]:
        """The six components, force first."""
        return (*self.value, *self.torque)


def check_force(force: Force, bodies: Collection[str]) -> None:
    """Raises MechanismError unless the force is three and three components at a point of one of `bodies`."""
    if not isinstance(force.body, str) or force.body not in bodies:
        raise unknown_body(f"there is a force on the unknown body {force.body!r:.80}", force.body, bodies)
    where = f"the force on body {force.body!r}"
    vector(f"{where}: at", force.at)
    if force.frame not in FRAMES:
        raise MechanismError(f"{where}: frame must be one of {', '.join(FRAMES)}, got {force.frame!r}")
    given: Any
    for what, given in (("value", force.value), ("torque", force.torque)):
        if isinstance(given, str | Node) or not isinstance(given, Sequence | np.ndarray) or len(given) != 3:
            raise MechanismError(f"{where}: {what} must have three components, got {given!r:.80}")
        for each in given:
            finite = isinstance(each, numbers.Real) and math.isfinite(each)
            if not (finite or isinstance(each, str | Node)):
                raise MechanismError(
                    f"{where}: a component of {what} must be a finite number, a parameter's name or a node, "
                    f"got {each!r:.60}"
                )


def powers(force: Force, chain: KinematicChain, parameters: Mapping[str, Node]) -> list[tuple[Node, Node]]:
    """Components of v and w of the body, and those of force and torque on them: virtual power is f . v + torque . w."""
    value, torque = (_nodes(each, parameters) for each in (force.value, force.torque))
    if force.frame == "body":
        value, torque = chain.direction(value), chain.direction(torque)
    motion = chain.motion(force.at)
    return list(zip((*motion.velocity, *motion.omega), (*value, *torque), strict=True))


def _nodes(components: Sequence[Component], parameters: Mapping[str, Node]) -> Triple:
    x, y, z = (
        parameters[each] if isinstance(each, str) else each if isinstance(each, Node) else cg.constant(float(each))
        for each in components
    )
    return x, y, z
