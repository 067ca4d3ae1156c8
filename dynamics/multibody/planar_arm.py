"""Planar arms: serial chains of links that swing in a vertical plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import real_number

from ..systems.system import BiasForce, BodySystem, System, per_coordinate, sequence

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Link:
    """One link; the joint that carries it is at its upper end."""

    mass: float  # kg
    length: float  # m, joint to joint
    center: float  # m, joint to centre of mass
    inertia: float  # kg m^2, about the centre of mass


class _Motion(NamedTuple):
    """A link and its motion."""

    tag: str
    link: Link
    omega: Node  # angular velocity
    sin: Node  # of its angle from the vertical
    cos: Node
    velocity: tuple[Node, Node] | None  # of its joint; None: fixed


@dataclass(frozen=True)
class PlanarArm:
    """A serial arm of revolute joints in a vertical plane, hanging from a fixed base.

    Joint angles [rad] are relative to the parent link, zero hanging straight down, positive counter-clockwise.
    `system` is its Lagrangian system; every function of `dynamics` takes the arm itself.
    """

    links: tuple[Link, ...]
    damping: tuple[float, ...]  # N m s, each joint
    gravity: float  # m/s^2, downwards

    def __repr__(self) -> str:
        masses, lengths = (sum([getattr(link, name) for link in self.links]) for name in ("mass", "length"))
        size = f"{len(self.links)} link(s): {masses:g} kg, {lengths:g} m"
        return f"<PlanarArm of {size}{', damped' if any(self.damping) else ''}; gravity {self.gravity:g}>"

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple([f"joint {i + 1}" for i in range(len(self.links))])

    @property
    def parameters(self) -> dict[str, float]:
        """None: all its numbers are constants."""
        return {}

    @property
    def ode(self) -> None:
        """None: an arm has a Lagrangian, see `Model`."""
        return None

    @cached_property
    def system(self) -> System:
        """The Lagrangian system, one partial Lagrangian L_i = K_i - P_i for each link, tagged with link and energy."""
        names = [f"joint {i + 1}" for i in range(len(self.links))]
        return BodySystem(
            self._bias_forces, lambda q, qd, t: self._partial_lagrangians(q, qd), names, damping=self.damping
        )

    def _motions(self, q: Sequence[Node], qd: Sequence[Node]) -> list[_Motion]:
        motions: list[_Motion] = []
        angle: Node | float = 0.0
        omega: Node | float = 0.0
        velocity: tuple[Node, Node] | None = None
        for i, link in enumerate(self.links):
            name = f"link {i + 1}"
            with cg.tag(name):
                angle = q[i] if i == 0 else angle + q[i]
                omega = qd[i] if i == 0 else omega + qd[i]
                s, c = cg.sin(angle), cg.cos(angle)
                motions.append(_Motion(name, link, omega, s, c, velocity))
                if i + 1 < len(self.links):
                    with cg.tag("kinetic"):
                        speed = link.length * omega
                        x, y = speed * c, speed * s
                        velocity = (x, y) if velocity is None else (velocity[0] + x, velocity[1] + y)
        return motions

    def _partial_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        # With the first moment m c and the inertia about the joint, m c^2 + I, in place of the velocity of the centre
        # of mass, K_i = 1/2 m v.v + m c w (v . n) + 1/2 (m c^2 + I) w^2: fewer nodes. v is the joint's velocity, w the
        # link's angular velocity, n = (cos, sin) of its angle the direction in which w moves it.
        partials: list[Node] = []
        height: Node | None = None  # of the joint
        for name, link, omega, s, c, velocity in self._motions(q, qd):
            moment = link.mass * link.center
            with cg.tag(name, "kinetic"):
                kinetic = 0.5 * (moment * link.center + link.inertia) * (omega * omega)
                if velocity is not None:
                    x, y = velocity
                    kinetic = kinetic + 0.5 * link.mass * (x * x + y * y) + moment * (omega * (x * c + y * s))
            with cg.tag(name, "potential"):
                potential = -(moment * self.gravity) * c
                if height is not None:
                    potential = link.mass * self.gravity * height + potential
                drop = link.length * c
                height = -drop if height is None else height - drop
            with cg.tag(name):
                partials.append(kinetic - potential)
        return partials

    def _bias_forces(self, q: Sequence[Node], qd: Sequence[Node]) -> list[BiasForce]:
        """The Newton-Euler equations at qdd = 0, where no link's angular velocity changes; gravity lifts the base.

        A link needs the force m a - m c w^2 e at its joint, which moves with a, and the torque m c (a . n) about it,
        with e = (sin, -cos) the direction of the link.
        """
        found: list[BiasForce] = []
        a: tuple[Node, Node] = cg.constant(0.0), cg.constant(self.gravity)
        energies = ("kinetic", "potential") if self.gravity else ("kinetic",)  # that it comes of
        for name, link, omega, s, c, velocity in self._motions(q, qd):
            moment = link.mass * link.center
            with cg.tag(name, "kinetic"):
                square = omega * omega
                inward = -s * square, c * square
            with cg.tag(name, *energies):
                found.append((omega, moment * (a[0] * c + a[1] * s)))
                if velocity is not None:
                    found += [
                        (v, link.mass * each + moment * e) for v, each, e in zip(velocity, a, inward, strict=True)
                    ]
                a = a[0] + link.length * inward[0], a[1] + link.length * inward[1]
        return found

    def joint_positions(self, q: Array) -> Array:
        """Places of base, joints and tip [m], (T, n + 1, 2), x to the right and y up, for joint angles q, (T, n)."""
        angle = np.cumsum(np.asarray(q, dtype=np.float64), axis=1)
        length = np.array([link.length for link in self.links])
        steps = np.stack([length * np.sin(angle), -length * np.cos(angle)], axis=-1)
        return np.concatenate([np.zeros((len(angle), 1, 2)), np.cumsum(steps, axis=1)], axis=1)


def planar_arm(
    masses: Sequence[float],
    lengths: Sequence[float],
    damping: float | Sequence[float] = 0.0,
    mass_model: str = "rod",
    gravity: float = 9.81,
) -> PlanarArm:
    """A planar arm, links from the base outwards.

    masses [kg] and lengths [m]: positive, one for each link.  damping [N m s]: at least 0, for all joints or each.
    mass_model: "rod", a slender uniform rod with inertia m l^2 / 12; "point", the mass at the link's far end.
    gravity [m/s^2].  Raises ValueError when a number is out of range or the counts differ.
    """
    masses, lengths = sequence("masses must be", masses), sequence("lengths must be", lengths)
    if len(masses) != len(lengths) or not len(masses):
        raise ValueError(f"an arm needs as many masses as lengths, at least one; got {len(masses)} and {len(lengths)}")
    if mass_model not in ("rod", "point"):
        raise ValueError(f'mass_model must be "rod" or "point", got {mass_model!r}')
    if not math.isfinite(real_number("gravity", gravity)):
        raise ValueError(f"gravity must be finite, got {gravity!r} m/s^2")
    for i, (mass, length) in enumerate(zip(masses, lengths, strict=True)):
        for what, value, unit in (("mass", mass, "kg"), ("length", length, "m")):
            if not (math.isfinite(real_number(f"link {i + 1}: {what}", value)) and value > 0.0):
                raise ValueError(f"link {i + 1}: {what} must be positive and finite, got {value!r} {unit}")
    links = [
        Link(mass, length, length / 2, mass * length * length / 12)
        if mass_model == "rod"
        else Link(mass, length, length, 0.0)
        for mass, length in zip(map(float, masses), map(float, lengths), strict=True)
    ]
    joints = [f"joint {i + 1}" for i in range(len(links))]
    return PlanarArm(tuple(links), per_coordinate("damping", damping, joints, minimum=0.0), float(gravity))
