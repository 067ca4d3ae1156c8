"""Joint forces: springs, limits, dry friction, actuators; and all forces along the velocities of a mechanism."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import check_name, real_array, real_number
from cgraph.extend import Builder, building, cotangents

from ...systems.kinematics import gathered
from ..algebra.spatial import ZERO
from ..bodies.body import Body, MechanismError, quantity, unknown_body
from ..bodies.joint_coordinates import places
from ..joints import COMPOSITIONS
from ..parameters import Quantity, symbol
from ..sweeps.kinematic_chain import KinematicChain
from .contact import FORCE, Contact, Force, HasParameters, check_contact, check_force, powers, touch

Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class JointForce(HasParameters, ABC):
    """A force along the freedoms of a joint, smooth or with kinks, one of the `forces` of a mechanism.

    On a joint that is locked it has no effect. `JointSpring`, `JointLimit`, `JointFriction` and `Actuator` are such;
    one of your own says its force in `along` and what it refuses in `check`. Parameters that `along` reads are named by
    the property `components`, and are 0 where the mechanism's `parameters` say nothing else.

    Parameters
    ----------
    body : str or mapping of str to float
        The name of the body on the joint. Or {body: c} of several joints of one coordinate each, which it acts on as
        MuJoCo's fixed tendon does: its coordinate is the sum of c q, and every joint gets c times the force.

    Examples
    --------
    >>> import dynamics as dyn
    >>> class Cubic(dyn.JointForce):
    ...     components = ("c",)
    ...     def check(self, body):
    ...         pass
    ...     def along(self, q, qd, parameters):
    ...         return [-parameters["c"] * q[0] ** 3]
    >>> cart = dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    >>> sprung = dyn.Mechanism([cart], forces=[Cubic("cart")], parameters={"c": 8.0})
    >>> dyn.forward_dynamics(sprung).evaluate({"q0": 0.5, "qd0": 0.0, "tau0": 0.0, "c": 8.0})
    {'qdd0': -0.5}
    """

    body: str | Mapping[str, float]

    @property
    def shares(self) -> Mapping[str, float]:
        """{body: how far its joint moves the coordinate of the force}."""
        return {self.body: 1.0} if isinstance(self.body, str) else self.body

    @property
    def label(self) -> str:
        """What errors call it."""
        bodies = " and ".join(map(repr, self.body)) if isinstance(self.body, Mapping) else repr(self.body)
        return f"{type(self).__name__} on body {bodies}"

    @abstractmethod
    def check(self, body: Body) -> None:
        """Raises MechanismError for a joint that it cannot act on, and for numbers out of range."""

    @abstractmethod
    def along(self, q: Sequence[Node], qd: Sequence[Node], parameters: Mapping[str, Node]) -> list[Node]:
        """The force on every velocity of the joint."""

    def _require(self, what: str, value: object, at_least: float = -math.inf) -> None:
        where = self.label
        number = real_number(f"{where}: {what}", value)
        if not (math.isfinite(number) and number >= at_least):
            bound = f" and at least {at_least:g}" if math.isfinite(at_least) else ""
            raise MechanismError(f"{where}: {what} must be finite{bound}, got {number!r}")

    def _require_axis(self, body: Body) -> None:
        if len(body.joint.neutral) != 1:
            raise MechanismError(
                f"{type(self).__name__} acts on joints of one coordinate, and that of body {body.name!r} is "
                f"{body.joint.kind}"
            )


@dataclass(frozen=True, eq=False)
class JointLimit(JointForce):
    """A limit of a joint, as a stiff spring beyond it: k x (1 + d x_dot), x >= 0 how far beyond, never pulling back.

    Hunt and Crossley's contact, IEEE J. Robotics Autom. 1975: unlike with a damper alone, the force is continuous.

    Parameters
    ----------
    body : str or mapping of str to float
        The body on the joint, a hinge or slide, or several, see `JointForce`.
    lower, upper : float
        The range of its coordinate [rad or m]; infinite where there is no limit.
    stiffness : float
        k > 0 [N m/rad or N/m].
    damping : float
        d >= 0 [s/rad or s/m]; a body that arrives with the speed v is thrown back with about v (1 - 2/3 d v).

    Examples
    --------
    >>> import dynamics as dyn
    >>> cart = dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    >>> track = dyn.Mechanism([cart], forces=[dyn.JointLimit("cart", -1.0, 1.0, stiffness=1e4)])
    >>> dyn.forward_dynamics(track).evaluate({"q0": 1.001, "qd0": 0.0, "tau0": 0.0})["qdd0"].__round__(6)
    -5.0
    """

    lower: float
    upper: float
    stiffness: float
    damping: float = 0.0

    def check(self, body: Body) -> None:
        """Raises MechanismError for a joint of several coordinates, an empty range, and numbers out of range."""
        self._require_axis(body)
        if not (real_number("lower", self.lower) < real_number("upper", self.upper)):
            raise MechanismError(f"{self.label}: lower must be below upper, got {self.lower!r} and {self.upper!r}")
        self._require("stiffness", self.stiffness, 0.0)
        self._require("damping", self.damping, 0.0)

    def along(self, q: Sequence[Node], qd: Sequence[Node], parameters: Mapping[str, Node]) -> list[Node]:
        """The force of both ends."""
        force = cg.constant(0.0)
        for sign, end in ((1.0, self.upper), (-1.0, self.lower)):
            if math.isfinite(end):
                beyond = cg.maximum(sign * (q[0] - end), 0.0)
                push = self.stiffness * beyond
                if self.damping:
                    push = push * cg.maximum(1.0 + sign * self.damping * qd[0], 0.0)
                force = force - sign * push
        return [force]


@dataclass(frozen=True, eq=False)
class JointSpring(JointForce):
    """A spring and a damper of joints: -k (q - r) - d qd, r the nearest of lower <= r <= upper to q; no energy is kept.

    Parameters
    ----------
    body : str or mapping of str to float
        See `JointForce`; the joints are hinges and slides.
    stiffness, damping : float
        k and d, at least 0 [N m/rad or N/m, N m s or N s/m].
    lower, upper : float
        Where it pulls nowhere [rad or m].

    Examples
    --------
    >>> import dynamics as dyn
    >>> fingers = [dyn.Body(name, dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0) for name in ("left", "right")]
    >>> hand = dyn.Mechanism(fingers, forces=[dyn.JointSpring({"left": 1.0, "right": -1.0}, stiffness=8.0)])
    >>> dyn.forward_dynamics(hand).evaluate({"q0": 0.5, "q1": 0.0, "qd0": 0.0, "qd1": 0.0, "tau0": 0.0, "tau1": 0.0})
    {'qdd0': -2.0, 'qdd1': 2.0}
    """

    stiffness: float
    damping: float = 0.0
    lower: float = 0.0
    upper: float = 0.0

    def check(self, body: Body) -> None:
        """Raises MechanismError for a joint of several coordinates, and for numbers out of range."""
        self._require_axis(body)
        self._require("stiffness", self.stiffness, 0.0)
        self._require("damping", self.damping, 0.0)
        self._require("lower", self.lower)
        self._require("upper", self.upper, self.lower)

    def along(self, q: Sequence[Node], qd: Sequence[Node], parameters: Mapping[str, Node]) -> list[Node]:
        """The force on the coordinate."""
        rest = cg.constant(self.lower) if self.lower == self.upper else _within(q[0], (self.lower, self.upper))
        return [-(self.stiffness * (q[0] - rest) + self.damping * qd[0])]


@dataclass(frozen=True, eq=False)
class JointFriction(JointForce):
    """Dry friction of a joint: -loss sign(qd), which sticks, or -loss tanh(qd / velocity), which creeps.

    A motion with the first comes to rest where qd is 0, stays while what pulls is at most `loss`, and then breaks away:
    it slides on the surface qd = 0 between the two signs, by the share of each that holds qdd at 0. Graphs of their
    own, as `forward_dynamics`, do not know a share: sign(0) is 0.

    Parameters
    ----------
    body : str or mapping of str to float
        The body on the joint, or several, see `JointForce`.
    loss : float
        The force of every freedom that slides [N m or N]. In its place may stand a parameter, as in a `Body`.
    velocity : float
        At which about three quarters of it act [rad/s or m/s]; 0 is the first law, the default.

    Examples
    --------
    >>> import dynamics as dyn
    >>> cart = dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    >>> rough = dyn.Mechanism([cart], forces=[dyn.JointFriction("cart", loss=4.0)])
    >>> run = dyn.simulate(rough, [0.0], [1.0], t_end=9.0)
    >>> run.q[-1].round(9), run.qd[-1]
    (array([0.25]), array([0.]))
    """

    quantities: ClassVar = {"loss": quantity}

    loss: Quantity
    velocity: float = 0.0

    def check(self, body: Body) -> None:
        """Raises MechanismError for numbers out of range."""
        quantity(f"{self.label}: loss", self.loss)
        self._require("velocity", self.velocity, 0.0)

    def along(self, q: Sequence[Node], qd: Sequence[Node], parameters: Mapping[str, Node]) -> list[Node]:
        """The force on every velocity."""
        shares = [cg.tanh(rate / self.velocity) if self.velocity else cg.sign(rate) for rate in qd]
        return [-symbol(self.loss) * share for share in shares]


@dataclass(frozen=True, eq=False)
class Actuator(JointForce):
    """An actuator of a joint with affine gain and bias, as MuJoCo's motors, position and velocity servos are.

    force = gain . (1, l, v) * input + bias . (1, l, v), with l = gear q, v = gear qd; the joint gets gear * force.

    Parameters
    ----------
    body : str or mapping of str to float
        The body on the joint, a hinge or slide, or several, see `JointForce`.
    input : str
        The parameter that controls it; 0 where a run says nothing else.
    gear : float
        Transmission ratio.
    gain, bias : sequence of 3 floats
        Of 1, length and velocity: a motor has (1, 0, 0) and zeros; a position servo (kp, 0, 0) and (0, -kp, -kv).
    input_range, force_range, joint_range : pair of floats, optional
        Between which input, force, and the force on the joint are cut off.

    Examples
    --------
    >>> import dynamics as dyn
    >>> cart = dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    >>> servo = dyn.Actuator("cart", "target", gain=(50.0, 0.0, 0.0), bias=(0.0, -50.0, 0.0))
    >>> track = dyn.Mechanism([cart], forces=[servo])
    >>> dyn.forward_dynamics(track).evaluate({"q0": 0.1, "qd0": 0.0, "tau0": 0.0, "target": 0.3})["qdd0"].__round__(6)
    5.0
    """

    input: str
    gear: float = 1.0
    gain: Sequence[float] = (1.0, 0.0, 0.0)
    bias: Sequence[float] = (0.0, 0.0, 0.0)
    input_range: Range | None = None
    force_range: Range | None = None
    joint_range: Range | None = None

    @property
    def components(self) -> tuple[str, ...]:
        """The name of the input."""
        return (self.input,)

    def check(self, body: Body) -> None:
        """Raises MechanismError for a joint of several coordinates, and for numbers that are not finite."""
        self._require_axis(body)
        where = self.label
        check_name(f"the input of the {where}", self.input, spaces=False)
        self._require("gear", self.gear)
        for what, numbers in (("gain", self.gain), ("bias", self.bias)):
            if (row := real_array(f"{where}: {what}", numbers)).shape != (3,) or not np.isfinite(row).all():
                raise MechanismError(f"{where}: {what} needs three finite numbers, got {numbers!r:.60}")
        for what, pair in (("input", self.input_range), ("force", self.force_range), ("joint", self.joint_range)):
            if pair is not None:
                row = real_array(f"{where}: {what}_range", pair)
                if row.shape != (2,) or not row[0] <= row[1]:
                    raise MechanismError(f"{where}: {what}_range must be (lower, upper), got {pair!r:.60}")

    def along(self, q: Sequence[Node], qd: Sequence[Node], parameters: Mapping[str, Node]) -> list[Node]:
        """The force on the joint."""
        gain, bias = (_affine(numbers, self.gear * q[0], self.gear * qd[0]) for numbers in (self.gain, self.bias))
        force = _within(gain * _within(parameters[self.input], self.input_range) + bias, self.force_range)
        return [_within(self.gear * force, self.joint_range)]


def _affine(numbers: Sequence[float], length: Node, velocity: Node) -> Node:
    terms = [number * node for number, node in zip(numbers[1:], (length, velocity), strict=True) if number]
    return sum(terms, cg.constant(float(numbers[0])))


def _within(node: Node, limits: Range | None) -> Node:
    return node if limits is None else cg.minimum(cg.maximum(node, float(limits[0])), float(limits[1]))


AnyForce = Force | JointForce | Contact


def check_any_force(force: AnyForce, carried: Collection[str], bodies: Sequence[Body]) -> None:
    """Raises MechanismError for a force that bodies, or the joint of one, cannot have.  carried: names of bodies."""
    if isinstance(force, JointForce):
        _check_joint_force(force, bodies)
    elif isinstance(force, Contact):
        check_contact(force, carried)
    else:
        check_force(force, carried)


def _check_joint_force(force: JointForce, bodies: Sequence[Body]) -> None:
    named = {body.name: body for body in bodies}
    for name, share in force.shares.items() if isinstance(force.body, str | Mapping) else [(force.body, 1.0)]:
        if not isinstance(name, str) or name not in named:
            raise unknown_body(f"there is a force on the joint of the unknown body {name!r:.80}", name, named)
        body = named[name]
        force._require(f"the coefficient of {name!r}", share)
        if body.joint.kind in COMPOSITIONS or not isinstance(force.body, str):
            force._require_axis(body)
        if not body.joint.type.moves:
            raise MechanismError(f"there is a force on the joint of body {body.name!r}, which does not move")
        force.check(body)


def generalized_forces(
    forces: Sequence[object],
    chain: Callable[[str], KinematicChain],
    moving: Sequence[Body],
    state: tuple[Sequence[Node], Sequence[Node]],
    parameters: Mapping[str, Node],
    locked: Mapping[str, Any],
) -> list[Node]:
    """Q = J^T f + J_w^T torque of all forces on bodies together, and those of joints: one node for each velocity.

    Virtual power is linear in qd: one reverse sweep, seeded with the forces, gives its slope along qd.
    chain: the joints between a body and the world.  moving: bodies.  state: q and qd.
    locked: coordinates of joints that stand still.
    """
    build, (q, qd) = Builder(), state
    total: list[Node] = [ZERO] * len(qd)
    for force in forces:
        if isinstance(force, Force | Contact):
            with building(build), cg.tag(force.body, FORCE):
                if isinstance(force, Force):
                    pairs = powers(force, chain(force.body), parameters)
                else:
                    at_touch = touch(force, chain(force.body), chain(force.to))
                    pairs = [*zip(at_touch.velocity, at_touch.force, strict=True)]
                shares = cotangents(gathered(pairs), qd, build)
                total = [sum_ + share for sum_, share in zip(total, shares, strict=True)]
    where = {body.name: place for body, place in zip(moving, places(moving), strict=True)}
    for force in [each for each in forces if isinstance(each, JointForce)]:
        joints = [(share, where[name]) for name, share in force.shares.items() if name in where]
        with building(Builder()), cg.tag(*force.shares, FORCE):
            for share, at in joints:
                coordinates, rates = q[at.q], qd[at.u]
                if not isinstance(force.body, str):
                    still = [share * float(locked.get(name, 0.0)) for name, share in force.shares.items()]
                    coordinates = [sum([share * q[each.q.start] for share, each in joints], cg.constant(sum(still)))]
                    rates = [sum([share * qd[each.u.start] for share, each in joints], ZERO)]
                along = force.along(coordinates, rates, parameters)
                for k, node in zip(range(at.u.start, at.u.stop), along, strict=True):
                    total[k] = total[k] + share * node
    return total
