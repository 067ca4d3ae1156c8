"""Mechanisms: trees of rigid bodies, on joints of one axis or several freedoms, or free; their equations as nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node, _shared
from cgraph._shared import Array, or_nearest, real_array, require_flag, require_mapping
from cgraph.extend import Builder, building, hessian_nodes

from ...systems.arguments import parameter_value
from ...systems.body_terms import BiasForce, BodyTerms, MotionState, TorqueDerivatives
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..bodies.body import WORLD, Body, Joint, Limits, MechanismError, MechanismWarning, body_name, quantities, vector
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
from ..forces.contact import Contact, Force, check_contact, touch
from ..forces.joint_force import JointForce, check_any_force, generalized_forces
from ..joints import JointType
from ..loops import Loop, check_loops, of_loops, position_rows, velocity_rows
from ..parameters import Quantity, bound, entries, names_in, symbol
from ..sweeps.equation_links import base_parameter_links, equation_links, without_axial_moments
from ..sweeps.kinematic_chain import KinematicChain, kinematic_chains
from ..sweeps.kinematic_tree import GROUND, Carrier, Place, placed_bodies, require_inertia, resists
from ..sweeps.links import Link, LinkState, Numbers, link, link_states, motion_axes
from ..sweeps.mass_matrix import PlacedLink, mass_matrix_columns, momentum_rates, size_of
from ..sweeps.outward import Motion, base_acceleration, energy, ground, motions, wrenches
from .joint_positions import skeleton
from .structure import Structure, bound_body, bound_force, changed, checked_parts, listed, require_values, used_names

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
WORTH = 0.9  # of the nodes of a mass matrix from the Lagrangian, at most, for one by composite inertias
UNEVEN = 200.0  # times a body's moments of inertia, at most, for base numbers that are not looked at further


class TreeEquations:
    """Nodes of the motion of bodies, parents first, under a structure's gravity."""

    def __init__(self, structure: Structure, bodies: Sequence[Body], lifts: Mapping[str, Numbers]) -> None:
        self.bodies, self.base_parameters, self.lifts = bodies, structure.base_parameters, lifts
        self.gravity = quantities("gravity", structure.gravity)

    @cached_property
    def parents(self) -> list[int]:
        """Index of the body that carries each body, -1 for the world."""
        index = {body.name: i for i, body in enumerate(self.bodies)}
        return [index.get(body.parent, -1) for body in self.bodies]

    @cached_property
    def links(self) -> list[Link]:
        """Links of the bodies, in the bodies' own frames."""
        return self._regrouped(self._own)[0] if self.base_parameters else self._own

    @cached_property
    def _types(self) -> list[JointType]:
        return [body.joint.type for body in self.bodies]

    @cached_property
    def ground(self) -> Motion:
        """The world at rest."""
        inner = [link for link, parent in zip(self.links, self.parents, strict=True) if parent >= 0]
        axial = all([joint.has_axis for joint in self._types])
        in_plane = axial and all([link.parallel for link in inner])
        return ground(self.gravity, in_plane=in_plane)

    @cached_property
    def _turning(self) -> bool:
        """Whether the directions of all joints turn with their bodies, which closed forms take for granted."""
        return all([joint.turns_with_body for joint in set(self._types)])

    @cached_property
    def _own(self) -> list[Link]:
        outer = [self.bodies[i].joint if i >= 0 else None for i in self.parents]
        links = [link(body, joint) for body, joint in zip(self.bodies, outer, strict=True)]
        for i, body in enumerate(self.bodies):
            if lift := self.lifts.get(body.name):
                links[i] = replace(links[i], lift=lift.turned(motion_axes(body.joint).T))
        return links

    @cached_property
    def _placed(self) -> list[Link]:
        """The links in the frames of the equations."""
        return equation_links(self._own, self._types, self.parents)

    @cached_property
    def _links(self) -> tuple[list[Link], Array]:
        """The links of the equations, and the first moment of what of their inertia is the world's."""
        return self._regrouped(self._placed) if self.base_parameters else (self._placed, np.zeros(3))

    @cached_property
    def _fewest(self) -> list[Link]:
        """The links in as few inertial numbers as there can be, unless these would have to be computed in the graph."""
        return self._regrouped(self._placed, fewer=True)[0] if self._numeric else self._links[0]

    @cached_property
    def whole(self) -> TreeEquations | None:
        """Equations without base numbers, where these are larger than the bodies' by decades; else None."""
        numbers = zip(self._fewest, self._links[0], strict=True)
        if not self._numeric or all([_size(few) <= UNEVEN * _size(own) for few, own in numbers]):
            return None
        result = copy(self)
        vars(result)["_fewest"] = self._links[0]
        return result

    def _regrouped(self, links: Sequence[Link], *, fewer: bool = False) -> tuple[list[Link], Array]:
        return base_parameter_links(links, self._types, self.parents, fewer=fewer)

    @cached_property
    def _numeric(self) -> bool:
        """Whether no link has parameters."""
        joints = [isinstance(number, Node) for link in self._own for number in link.numbers]
        return not any(joints) and all([link.is_numeric for link in self._own])

    def states(
        self,
        q: Sequence[Node],
        u: Sequence[Node],
        links: Sequence[Link] | None = None,
        u_dot: Sequence[Node] | None = None,
    ) -> list[LinkState]:
        """The links, by default the bodies' own, at a state."""
        return link_states(self.bodies, links or self.links, self.parents, q, u, u_dot)

    def partial_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """Lagrangian of each body, tagged with its name and energy."""
        with building(Builder()):
            partials = self._partials(self.states(q, qd, self._links[0]))
            if self.base_parameters:
                with cg.tag("potential"):
                    moment = spatial.scaled(self.ground.strength, spatial.constant(self._links[1]))
                    partials[0] = partials[0] - spatial.dot(self.ground.vertical, moment)
        return partials

    def regrouped_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """Lagrangians of base numbers: their sum lacks only terms that no derivative shows."""
        with building(Builder()):
            return self._partials(self.states(q, qd, self._fewest))

    def _partials(self, states: Sequence[LinkState]) -> list[Node]:
        partials = []
        for motion, at in zip(self._motions(states), states, strict=False):
            with cg.tag(at.name):
                partials.append(energy(motion, at))
        return partials

    def bias_forces(self, q: Sequence[Node], qd: Sequence[Node], qdd: Sequence[Node] | None) -> list[BiasForce]:
        """The wrenches of all bodies at these accelerations, with the velocities that they work on."""
        with building(Builder()):
            states = self.states(q, qd, self._fewest, qdd)
            return wrenches(states, self._motions(states))

    def mass_matrix(self, q: Sequence[Node], qd: Sequence[Node], lagrangian: Node, build: Builder) -> list[list[Node]]:
        """The lower triangle of M by composite inertias; or from the Lagrangian, where that takes fewer nodes."""
        links = self._regrouped(equation_links(self._own, self._types, self.parents, outwards=True))[0]
        with building(build):
            links = without_axial_moments(links if self._numeric else self._fewest, self._types, self.parents)
            states = self.states(q, qd, links)
            planes = [motion.plane for motion in self._motions(states)]
            carried = [PlacedLink(at, plane, planes[at.parent]) for at, plane in zip(states, planes, strict=False)]
            columns = mass_matrix_columns(carried, len(qd))
        hinged = self._numeric and all([joint.kind == "revolute" for joint in self._types])
        if hinged and self.parents == list(range(-1, len(self.bodies) - 1)):  # one on another: these are the fewest
            return columns
        derived = hessian_nodes(lagrangian, qd, build)  # with nodes that other equations have as well
        return columns if size_of(columns) < WORTH * size_of(derived) else derived

    def momentum_rates(self, q: Sequence[Node], qd: Sequence[Node], p: Sequence[Node]) -> list[Node] | None:
        """dp/dt without applied forces at velocities qd that belong to p, by composite momentum.

        None, as of the derivatives, where directions of a joint depend on its coordinates: they follow from L.
        """
        if not self._turning:
            return None
        with building(Builder()):
            states = self.states(q, qd, self._fewest)
            return momentum_rates(states, self._motions(states), p)

    def torque_derivatives(self, state: MotionState, build: Builder) -> TorqueDerivatives | None:
        """Torques of all bodies, with their springs, and their derivatives; None also where weight is balanced."""
        if self.lifts or not self._turning:
            return None
        from ..sweeps.torque_derivatives import torque_derivatives

        with building(build):
            up = base_acceleration(self.ground).linear
            q, u, u_dot = state
            return torque_derivatives(self.states(q, u, self._links[0], u_dot), up, build)

    def _motions(self, states: Sequence[LinkState]) -> list[Motion]:
        """The motions of the links, and that of the world last, so that -1 is its place."""
        return [*motions(states, self.ground), self.ground]


def _size(link: Link) -> float:
    """The largest of its moments of inertia and armature."""
    return max(float(np.abs(np.array(link.full_inertia, dtype=np.float64)).max()), float(link.armature))


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
        parts = self._checked
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
        used = used_names(self.bodies, self.gravity, self.forces) if self.parameters else {}
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

    @property
    def parts(self) -> tuple[Body, ...]:
        """All bodies as the equations have them, parents first: a locked joint a weld, those of several parts apart."""
        return tuple([place.part for place in self._tree[0].values()])

    @property
    def moving(self) -> tuple[Body, ...]:
        """The bodies that move, parents first, with all that is welded to them merged into their inertia.

        Where there are parameters, what is welded is kept beside: `bind` them to see sums.
        """
        return self._tree[1]

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

    @cached_property
    def carriers(self) -> dict[str, Carrier]:
        """Placement of every body in the frame of the moving body that carries it."""
        return {WORLD: GROUND} | {body.name: place.carrier for body, place in self._tree[0].items()}

    @cached_property
    def _checked(self) -> list[Body]:
        return [part for body in self.bodies for part in checked_parts(body)]

    @cached_property
    def _tree(self) -> tuple[dict[Body, Place], tuple[Body, ...]]:
        require_parents(self.bodies)
        at, before = locked_parts(self.bodies, self.standing), vars(self).pop("_before", {})
        places, moving = found = placed_bodies(self._checked, at, before)
        parts = [place.part for place in places.values()]
        if self.parameters and (numbers := [bound_body(part, self.parameters) for part in parts]) != parts:
            moving = placed_bodies([part for body in numbers for part in checked_parts(body)], {}, {})[1]
        require_inertia(moving)
        return found

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
        build = Builder()
        for body in [each for each in self.parts if each.gravity_compensation != 0.0]:
            if (carrier := self.carriers[body.name]).name != WORLD:
                with building(build):
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
            forces=self.generalized_forces if self.forces else None,
            damping=per_velocity(self.moving, [symbol(body.joint.damping) for body in self.moving]),
            quasi_velocities=quasi_velocities(self.moving),
            constraints=lambda q, t: position_rows(
                self.loops, self.moving, self.carriers, self.standing, self._equations.states(q, ())
            ),
            velocity_constraints=lambda q, qd, t: velocity_rows(self.loops, lambda body: self._chain(body, q, qd)),
            body_terms=BodyTerms(self._equations, lengths(self._bound.moving), regular, self._require_values, self),
        )
        system.constraints = of_loops(system.constraints, self.loops, self.moving)
        return system

    def _require_values(self, values: Mapping[str, ArrayLike], bodies: Sequence[Body] | None = None) -> None:
        with outer_names(self.bodies):
            require_values(self.parts if bodies is None else bodies, self.gravity, self.forces, values)

    def generalized_forces(self, q: list[Node], qd: list[Node], t: Node, p: Mapping[str, Node]) -> list[Node]:
        """Forces along the velocities qd of all `forces`, at time t and parameters p."""
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
