"""Mechanisms: trees of rigid bodies, on joints of one axis or several freedoms, or free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node, _shared
from cgraph._shared import Array, or_nearest, real_array, require_flag, require_mapping
from cgraph.extend import Builder, building

from ...systems.arguments import parameter_value
from ...systems.body_terms import BodyTerms
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..bodies.body import WORLD, Body, Joint, MechanismError, MechanismWarning, body_name, quantities, vector
from ..bodies.composed_joints import locked_parts, outer_names, require_parents
from ..bodies.joint_coordinates import (
    coordinate_names,
    joint_limits,
    lengths,
    neutral,
    per_velocity,
    places,
    quasi_velocities,
    velocity_names,
)
from ..bodies.limits import Limits
from ..forces.contact import Contact, check_contact, touch
from ..forces.external_force import Force
from ..forces.joint_force import JointForce, check_any_force, generalized_forces
from ..loops import Loop, check_loops, of_loops, position_rows, velocity_rows
from ..parameters import Quantity, bound, entries, names_in, symbol, vanishes
from ..sweeps.kinematic_chain import KinematicChain, kinematic_chains
from ..sweeps.kinematic_tree import Carrier, lock_joints, merge_fixed_bodies, parents_first, require_inertia, resists
from ..sweeps.links import Link, Numbers
from .joint_positions import skeleton
from .structure import Structure, bound_body, bound_force, changed, checked_parts, listed, require_values, used_names
from .tree_equations import TreeEquations

__all__ = [
    "WORLD",
    "Body",
    "Contact",
    "Force",
    "Joint",
    "Loop",
    "Mechanism",
    "MechanismError",
    "MechanismWarning",
    "as_mechanism",
    "require_mechanism",
]

SHOWN = 6  # names of a kind that a repr shows, at most


@dataclass(frozen=True, eq=False)
class Mechanism(Structure):
    """A tree of rigid bodies under gravity. Coordinates are its moving joints, parents first.

    Parameters
    ----------
    bodies : sequence of Body
        In any order.
    gravity : array_like, (3,)
        In the world's axes [m/s^2]. In place of a number may stand a parameter, as in a `Body`.
    forces : sequence of Force, JointForce and Contact
        On bodies from outside, beside the joint forces tau; they enter the equations as J^T f. Along joints:
        `JointSpring`, `JointLimit`, `JointFriction`, `Actuator`. And where bodies touch: `Contact`.
    parameters : mapping
        {name: value} of the parameters that bodies, joints, gravity and forces have. They are inputs of the graphs, and
        `simulate` binds them. Each needs a value with which the mechanism can be; only one that a `Force` or
        `Actuator` alone names is 0 without.
    locked : mapping
        {body: coordinate [rad or m]} of joints that stand still: their bodies are welded on, see `lock`.
    base_parameters : bool
        Written with few inertial numbers, a body's given to its parent where they move alike. Smaller graphs of the
        same motion; but a partial Lagrangian is then not the energy of its body. See `dyn.base_parameters`.
    left_out : tuple of str
        Of a mechanism that was read from a file: what the file has and the mechanism has not, a sentence each.
    loops : sequence of Loop
        What holds bodies of the tree together, beside their joints, and closes it to loops. Motions, accelerations
        and linearizations are with them; mass matrix, bias, inverse dynamics, tables and the like are the tree's.
    starts : mapping
        {name: {"q.knee" or "qd.knee" or a parameter: number}} of states to start from, see `dyn.start`: the keyframes
        of a file.

    Raises
    ------
    MechanismError
        For an unknown parent, a cycle, a repeated name, numbers that are not finite or out of range, a negative
        moment of inertia, a coordinate that moves no mass and has no armature, a force on an unknown body, a parameter
        that nothing uses, one without value, and a value that makes any of this. Positive moments that no rigid body
        can have, the largest above the sum of the others, are a `MechanismWarning`: the equations hold with them.

    Examples
    --------
    >>> import dynamics as dyn
    >>> rod = dyn.Body("rod", dyn.Joint("revolute", (0.0, 1.0, 0.0)), mass=1.0, center=(0.0, 0.0, -0.5))
    >>> dyn.Mechanism([rod])
    <Mechanism of 1 bodies, 1 coordinate(s) rod; gravity 0, 0, -9.81>
    >>> rod = dyn.Body("rod", dyn.Joint("revolute", (0.0, 1.0, 0.0)), mass="m", center=(0.0, 0.0, -0.5))
    >>> dyn.Mechanism([rod], (0.0, 0.0, -10.0), parameters={"m": 1.0}).parameters
    {'m': 1.0}
    """

    ode = None  # it has a Lagrangian, see `Model`

    def __post_init__(self) -> None:
        quantities("gravity", self.gravity)
        require_flag("base_parameters", self.base_parameters)
        kinds = {"bodies": (Body,), "forces": (Force, JointForce, Contact), "loops": (Loop,), "left_out": (str,)}
        for what, allowed in kinds.items():  # kept, so that an iterator is read once
            object.__setattr__(self, what, listed(what, allowed, getattr(self, what)))
        parts = [part for body in self.bodies for part in checked_parts(body)]
        for name, state in require_mapping("starts", self.starts, "name: state").items():
            require_mapping(f"start {name!r:.60}", state, "name: number")
        for name, value in require_mapping("parameters", self.parameters, "name: value").items():
            parameter_value(name, value)  # before one is put in
        self._require_values(self.parameters, parts)
        check_loops(self.loops, self.bodies)
        seen: set[str] = set()
        for name in self.coordinates:
            if name in seen:
                raise MechanismError(f"two joints that move have the name {name!r}")
            seen.add(name)
        carried = {body.name for body in self.bodies}
        for force in self.forces:
            check_any_force(force, carried, self.bodies)
        used = used_names(self.bodies, self.gravity, self.forces)
        for name in self.parameters:
            if name not in used:
                raise MechanismError(
                    f"the mechanism has no body, joint or force that uses the parameter {name!r}: put its name in "
                    "place of a number, or have `components` of a JointForce of your own name it"
                )
        for name, value in self.parameter_values.items():
            parameter_value(name, value)

    def _repr_html_(self) -> str | None:
        """The equations that a notebook shows as formulas, when a drawing package is installed (extra `viz`)."""
        return _shared.render_html("model", self)

    def __repr__(self) -> str:
        return f"<Mechanism of {'; '.join(_summary(self))}>"

    @cached_property
    def parts(self) -> tuple[Body, ...]:
        """All bodies as the equations have them, parents first: a locked joint a weld, those of several parts apart."""
        parts = [part for body in self.bodies for part in checked_parts(body)]
        require_parents(self.bodies)
        return tuple(parents_first(lock_joints(parts, locked_parts(self.bodies, self.standing))))

    @property
    def moving(self) -> tuple[Body, ...]:
        """The bodies that move, parents first, with all that is welded to them merged into their inertia.

        Where there are parameters, what is welded is kept beside: `bind` them to see sums.
        """
        return self._merged[0]

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates: the joints', which are the bodies' where a joint has none of its own."""
        return coordinate_names(self.moving)

    @property
    def velocities(self) -> tuple[str, ...]:
        """Names of the velocities, which are those of the coordinates but for ball and free joints."""
        return velocity_names(self.moving)

    @property
    def limits(self) -> dict[str, Limits]:
        """{coordinate: its limits}, of position, velocity and effort; infinite where there are none, see `Limits`."""
        return joint_limits(self.moving)

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism itself, as a `Model` has it."""
        return self

    @property
    def carriers(self) -> dict[str, Carrier]:
        """Placement of every body in the frame of the moving body that carries it."""
        return self._merged[1]

    @cached_property
    def _merged(self) -> tuple[tuple[Body, ...], dict[str, Carrier]]:
        moving, carriers = merge_fixed_bodies(self.parts)
        numbers = [bound_body(part, self.parameters) for part in self.parts]
        if numbers != list(self.parts):
            numbers = [part for body in numbers for part in checked_parts(body)]
        require_inertia(moving if numbers == list(self.parts) else merge_fixed_bodies(numbers)[0])
        return tuple(moving), carriers

    @cached_property
    def _bound(self) -> Mechanism:
        return self.bind(self.parameter_values)

    @cached_property
    def _equations(self) -> TreeEquations:
        return TreeEquations(self, self.moving, self._lifts)

    @property
    def _lifts(self) -> dict[str, Numbers]:
        """What of each moving body, and of all that is welded to it, is weightless."""
        lifts: dict[str, Numbers] = {}
        with building(Builder()):
            for body in self.parts:
                carrier = self.carriers[body.name]
                if carrier.name != WORLD and not vanishes(body.gravity_compensation):
                    center = spatial.placed(carrier.position, carrier.orientation, np.asarray(body.center))
                    mass: Any = symbol(body.gravity_compensation) * symbol(body.mass)
                    known = lifts.get(carrier.name, Numbers(0.0, np.zeros(3), np.zeros((3, 3))))
                    moment = spatial.added(known.moment, mass * center)
                    lifts[carrier.name] = known._replace(mass=known.mass + mass, moment=moment)
        return lifts

    @cached_property
    def system(self) -> System:
        """The Lagrangian system: a partial Lagrangian for each body, tagged with name and energy; forces likewise."""
        if not self.moving:
            raise MechanismError("the mechanism has no joint that moves")
        regular = all([bool(body.joint.armature) or resists(body) for body in self._bound.moving])
        system = System(
            lambda q, qd, t: self._equations.partial_lagrangians(q, qd),
            self.coordinates,
            self.parameter_values,
            forces=self._generalized_forces if self.forces else None,
            damping=per_velocity(self.moving, [symbol(body.joint.damping) for body in self.moving]),
            quasi_velocities=quasi_velocities(self.moving),
            constraints=lambda q, t: position_rows(
                self.loops, self.moving, self.carriers, self.standing, self._equations.states(q, ())
            ),
            velocity_constraints=lambda q, qd, t: velocity_rows(self.loops, lambda body: self._chain(body, q, qd)),
            body_terms=BodyTerms(self._equations, lengths(self._bound.moving), regular, self._require_values),
        )
        system.constraints = of_loops(system.constraints, self.loops, self.moving)
        return system

    def _require_values(self, values: Mapping[str, ArrayLike], bodies: Sequence[Body] | None = None) -> None:
        with outer_names(self.bodies):
            require_values(self.parts if bodies is None else bodies, self.gravity, self.forces, values)

    def _generalized_forces(self, q: list[Node], qd: list[Node], t: Node, p: dict[str, Node]) -> list[Node]:
        return generalized_forces(
            self.forces, lambda body: self._chain(body, q, qd), self.moving, (q, qd), p, self.locked
        )

    def _chain(self, body: str, q: Sequence[Node], qd: Sequence[Node]) -> KinematicChain:
        ends = [self.carriers[name] for name in (body, WORLD)]
        return kinematic_chains(ends, self.moving, self._equations.states(q, qd))[0]

    @property
    def links(self) -> list[Link]:
        """Links of the moving bodies: the numbers of which motion and energy are made."""
        return self._equations.links

    @property
    def parents(self) -> list[int]:
        """Index of the moving body that carries each moving body, -1 for the world."""
        return self._equations.parents

    def position(self, body: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> Graph:
        """Position of a point of a body in the world. Inputs q0.. and parameters of positions; outputs x, y, z [m].

        at: (3,) [m], the point, in the body's frame. Raises MechanismError for an unknown body.
        """
        chain, point = self.chain(body), _point(body, at)
        with building(Builder()), cg.tag(body):
            place = chain.motion(point).position
        return cg.simplify(Graph([*self.system.q, *self._lengths], dict(zip("xyz", place, strict=True))))

    def motion(self, body: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> Graph:
        """Motion of a body in the world: inputs q0.., qd0.., parameters of positions; outputs in the world's axes.

        x, y, z [m] and vx, vy, vz [m/s] of a point; wx, wy, wz [rad/s], the body's angular velocity; R_0_0, R_0_1, ..
        row by row, its axes as columns.
        at: (3,) [m], the point, in the body's frame. Raises MechanismError for an unknown body.
        """
        chain, point = self.chain(body), _point(body, at)
        with building(Builder()), cg.tag(body):
            return chain.graph(point, self.system.q, [*self.system.qd, *self._lengths])

    def contact(self, contact: Contact) -> Graph:
        """A contact in a state: inputs q0.., qd0.., parameters; outputs in the world's axes.

        depth [m], negative where the bodies are apart; normal [N], N of `Contact`; x, y, z [m], the point where the
        force acts; vx, vy, vz [m/s], the velocity of the body there against the other; fx, fy, fz [N], the force on the
        body, friction and all; energy [J], stored.
        contact: one of the `forces`, or another. Raises MechanismError for one that bodies cannot have.
        """
        if not isinstance(contact, Contact):
            raise MechanismError(f"a contact is a Contact, got {type(contact).__name__}: {contact!r:.60}")
        check_contact(contact, self.carriers)
        with building(Builder()), cg.tag(contact.body):
            outputs = touch(contact, self.chain(contact.body), self.chain(contact.to)).outputs()
        names = dict.fromkeys([*names_in(self._lengths), *sorted(contact.names)])
        return cg.simplify(Graph([*self.system.q, *self.system.qd, *cg.variables(list(names))], outputs))

    @property
    def _lengths(self) -> list[Node]:
        """The parameters of where joints are."""
        return cg.variables(list(names_in([each for body in self.bodies for each in entries(body.joint.position)])))

    def chain(self, body: str) -> KinematicChain:
        """The joints between a body and the world, at q0.. and qd0... Raises MechanismError for an unknown body."""
        name = body if isinstance(body, str) and body in self.carriers else body_name(self.bodies, body)
        return self._chain(name, self.system.q, self.system.qd)

    def joint_positions(self, q: ArrayLike) -> Array:
        """Places of joints and tips [m] in a drawing, (T, k, 2), x to the right and y up, for q, (T, n) [rad or m].

        Joints come in the order of the coordinates, then the tips. See `joint_positions.skeleton`, which says how they
        are connected and from where a motion in space is seen.
        """
        return skeleton(self._bound, q).points

    def bind(self, values: Mapping[str, float] | None = None) -> Mechanism:
        """The mechanism with numbers in place of parameters; of all at their values, or of those in `values`.

        Raises MechanismError as a Mechanism does, and for a parameter that there is not.
        """
        if values is None:
            return self._bound
        given = require_mapping("values", values, "name: number")
        chosen = {name: parameter_value(name, value) for name, value in given.items()}
        if unknown := [name for name in chosen if name not in self.parameter_values]:
            known = or_nearest(unknown[0], list(self.parameter_values))
            raise MechanismError(f"the mechanism has no parameter {unknown[0]!r} ({known})")
        if not chosen:
            return self
        self._require_values({**self.parameter_values, **chosen})
        bodies = tuple([bound_body(body, chosen) for body in self.bodies])
        forces = tuple([bound_force(force, chosen) for force in self.forces])
        return changed(self, chosen, bodies=bodies, gravity=bound(self.gravity, chosen), forces=forces)

    def map_state_from(self, other: Mechanism, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
        """The state (q, qd) of another mechanism as one of this: joints of bodies of the same name keep theirs.

        A joint that was locked stands where it was locked, one that is new at 0, both still. Raises ValueError for
        states of another shape.
        """
        other = require_mechanism(other, "map_state_from")
        rows = [real_array(name, each) for name, each in (("q", q), ("qd", qd))]
        counts = len(other.coordinates), len(other.velocities)
        for name, row, count in zip(("q", "qd"), rows, counts, strict=True):
            if row.shape != (count,):
                raise ValueError(f"{name} must have shape ({count},), one for each joint, got {row.shape}")
        states = zip(other.moving, places(other.moving), strict=True)
        theirs = {body.name: (rows[0][place.q], rows[1][place.u]) for body, place in states}
        locked = locked_parts(other.bodies, other.standing)
        result = np.array(neutral(self.moving)), np.zeros(len(self.velocities))
        for body, place in zip(self.moving, places(self.moving), strict=True):
            if body.name in theirs:
                result[0][place.q], result[1][place.u] = theirs[body.name]
            elif body.name in locked:
                result[0][place.q] = locked[body.name]
        return result


def as_mechanism(model: Model) -> Mechanism | None:
    """The bodies behind a model: a mechanism's own, a scene's; None of a Lagrangian or first-order system alone."""
    return None if isinstance(model, type) else cast("Mechanism | None", getattr(model, "mechanism", None))


def require_mechanism(model: Model, what: str) -> Mechanism:
    """The bodies behind a model. Raises MechanismError, saying that `what` needs them, where there are none."""
    mechanism = as_mechanism(model)
    if mechanism is None:
        raise MechanismError(f"{what} takes rigid bodies, a Mechanism or a scene of one, got {model!r:.80}")
    return mechanism


def _summary(mechanism: Mechanism) -> list[str]:
    """What a mechanism has: bodies, coordinates, what acts on them, parameters and gravity."""
    some = _first(mechanism.coordinates)
    counted = f"{len(mechanism.bodies)} bodies, {len(mechanism.coordinates)} coordinate(s) {some}".rstrip()
    named = {
        "locked": list(mechanism.locked),
        "forces on": [", ".join(getattr(force, "shares", [force.body])) for force in mechanism.forces],
        "loops": [loop.label for loop in mechanism.loops],
    }
    parts = [counted + (", ..." if len(mechanism.coordinates) > SHOWN else "")]
    parts += [f"{what} {_first(names)}" for what, names in named.items() if names]
    parts += [f"parameters {', '.join(mechanism.parameter_values)}"] if mechanism.parameter_values else []
    return [*parts, f"gravity {', '.join([_shown(each) for each in entries(mechanism.gravity)])}"]


def _first(names: Sequence[str]) -> str:
    return ", ".join(names[:SHOWN])


def _shown(number: Quantity) -> str:
    names = names_in([number])
    return f"({', '.join(names)})" if names else f"{float(number):g}"


def _point(body: str, at: ArrayLike) -> Array:
    return vector(f"position on body {body!r}: at", at)
