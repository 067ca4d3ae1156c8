"""The Lagrangian and the bias of a tree of bodies, as nodes."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import Array, Builder, building, hessian_nodes

from ..systems.body_terms import BiasForce, MotionState, TorqueDerivatives
from .algebra import spatial
from .algebra.spatial import ZERO
from .body import WORLD, Body, quantities
from .joint_coordinates import parts, places
from .joints import AxialJoint, JointType, moving_type
from .mechanism_fields import Structure
from .sweeps import newton_euler
from .sweeps.base_parameters import base_parameter_links
from .sweeps.body_motion import Motion, ground
from .sweeps.composite_inertia import without_axial_moments
from .sweeps.composite_momentum import COMPOSITE, CompositeMomentum, about_parent, body_momentum, momentum_rates, stated
from .sweeps.equation_links import equation_links
from .sweeps.inertial_numbers import Link
from .sweeps.link_cache import Moved
from .sweeps.mass_matrix_columns import Carried, mass_matrix_columns, size_of

WORTH = 0.9  # of the nodes of a mass matrix from the Lagrangian, at most, for one by composite inertias
UNEVEN = 200.0  # times a body's moments of inertia, at most, for base numbers that are not looked at further


class TreeEquations:
    """Nodes of the motion of bodies, parents first, under a structure's gravity."""

    def __init__(self, structure: Structure, bodies: Sequence[Body]) -> None:
        self.bodies, self.shared = bodies, structure.shared
        self.base_parameters = structure.base_parameters
        self.gravity = quantities("gravity", structure.gravity)

    @cached_property
    def parents(self) -> list[int]:
        """For each body the index of the one that carries it, -1 for the world."""
        index = {body.name: i for i, body in enumerate(self.bodies)}
        return [index.get(body.parent, -1) for body in self.bodies]

    @cached_property
    def links(self) -> list[Link]:
        """What motion and energy of each body are made of, in the body's own frame."""
        return self._regrouped(self._own)[0] if self.base_parameters else self._own

    @cached_property
    def _types(self) -> list[JointType]:
        return [body.joint.type for body in self.bodies]

    @cached_property
    def ground(self) -> Motion:
        """The world at rest."""
        inner = [link for link, parent in zip(self.links, self.parents, strict=True) if parent >= 0]
        axial = all([isinstance(body.joint.type, AxialJoint) for body in self.bodies])
        in_plane = axial and all([link.parallel for link in inner])
        return self.shared.ground(ground(self.gravity, in_plane=in_plane))

    @cached_property
    def _turning(self) -> bool:
        """Whether the directions of all joints turn with their bodies, which closed forms take for granted."""
        joints = {moving_type(body.joint.type) for body in self.bodies}
        return all([isinstance(joint, AxialJoint) or joint.turns_with_body for joint in joints])

    @cached_property
    def _own(self) -> list[Link]:
        carriers = [self.bodies[i] if i >= 0 else None for i in self.parents]
        return [self.shared.link(body, carrier) for body, carrier in zip(self.bodies, carriers, strict=True)]

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
        """The same without base numbers, where these are larger than the bodies' by decades; else None."""
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
        return not any([isinstance(number, Node) for link in self._own for number in link.numbers])

    @cached_property
    def _hinged_chain(self) -> bool:
        """Whether hinges without parameters follow one on another: their M takes the fewest nodes by composites."""
        hinged = all([joint.kind == "revolute" for joint in self._types])
        return hinged and self._numeric and self.parents == list(range(-1, len(self.bodies) - 1))

    def partial_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """One for each body, tagged with its name and energy."""
        with building(Builder()):
            partials = [each.partial for each in self._moved(q, qd)]
            if self.base_parameters:
                with cg.tag("potential"):
                    moment = spatial.scaled(self.ground.strength, spatial.constant(self._links[1]))
                    partials[0] = partials[0] - spatial.dot(self.ground.vertical, moment)
        return partials

    def regrouped_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """Those of base numbers: of the sum only what no derivative shows is missing."""
        with building(Builder()):
            return [each.partial for each in self._moved(q, qd, self._fewest)]

    def bias_forces(self, q: Sequence[Node], qd: Sequence[Node], qdd: Sequence[Node] | None) -> list[BiasForce]:
        """The wrenches of all bodies at these accelerations, with the velocities that they work on."""
        forces: list[BiasForce] = []
        with building(Builder()):
            accelerations = {WORLD: newton_euler.base_acceleration(self.ground)}
            rates = [(qdd or [ZERO] * len(qd))[place.u] for place in places(self.bodies)]
            rows = zip(self.bodies, self._fewest, self._moved(q, qd), parts(self.bodies, q, qd), rates, strict=True)
            for body, link, moved, (x, u), u_dot in rows:
                joint = moving_type(body.joint.type)
                with cg.tag(body.name):
                    acceleration = accelerations[body.name] = newton_euler.propagate_acceleration(
                        accelerations[body.parent], moved.parent, moved.motion, link, joint, link.at(x), u, u_dot
                    )
                    forces += newton_euler.wrench(acceleration, moved.motion, link, joint, x, u, u_dot)
        return forces

    def mass_matrix(self, q: Sequence[Node], qd: Sequence[Node], lagrangian: Node, build: Builder) -> list[list[Node]]:
        """The lower triangle of M by composite inertias; or from the Lagrangian, where that takes fewer nodes."""
        joints = [moving_type(joint) for joint in self._types]
        links = self._regrouped(equation_links(self._own, self._types, self.parents, outwards=True))[0]
        with building(build):
            links = without_axial_moments(links if self._numeric else self._fewest, joints, self.parents)
            motions = [moved.motion.plane for moved in self._moved(q, qd, links)]
            rows = zip(self.bodies, self.parents, links, joints, motions, places(self.bodies), strict=True)
            carried = [
                Carried(body.name, k, link, joint, link.at(q[at.q]), at.u.start, plane, motions[k] if k >= 0 else None)
                for body, k, link, joint, plane, at in rows
            ]
            columns = mass_matrix_columns(carried, len(qd))
        if self._hinged_chain:
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
            rows = list(zip(self.bodies, self._fewest, self._moved(q, qd), parts(self.bodies, q, qd), strict=True))
            composites: list[CompositeMomentum] = []
            for body, link, moved, _ in rows:
                with cg.tag(body.name, COMPOSITE):
                    composites.append(body_momentum(moved.motion, link))
            rates, at = list[Node](), places(self.bodies)
            for i in reversed(range(len(rows))):
                body, link, moved, (x, u) = rows[i]
                joint = moving_type(body.joint.type)
                with cg.tag(body.name, COMPOSITE):
                    composites[i] = stated(composites[i], link, joint, link.at(x), u, p[at[i].u])
                    motions = (moved.parent, moved.motion)
                    rates[:0] = momentum_rates(composites[i], *motions, link, joint, x, u, p[at[i].u])
                    if (k := self.parents[i]) >= 0:
                        carried = about_parent(composites[i], *motions, link, joint, link.at(x))
                        composites[k] = composites[k].plus(carried)
        return rates

    def torque_derivatives(self, state: MotionState, build: Builder) -> TorqueDerivatives | None:
        """Of all bodies, with their springs."""
        if not self._turning:
            return None
        from .sweeps.inverse_dynamics_columns import torque_derivatives

        with building(build):
            up = newton_euler.base_acceleration(self.ground).linear
            return torque_derivatives(self.bodies, self._links[0], self.parents, up, state, build)

    def _moved(self, q: Sequence[Node], qd: Sequence[Node], links: Sequence[Link] | None = None) -> list[Moved]:
        motions = {WORLD: self.ground}
        result = []
        for body, link, (x, u) in zip(self.bodies, links or self._links[0], parts(self.bodies, q, qd), strict=True):
            moved = self.shared.moved(motions[body.parent], body, link, x, u)
            motions[body.name] = moved.motion
            result.append(moved)
        return result


def _size(link: Link) -> float:
    """The largest of its moments of inertia and armature."""
    return max(float(np.abs(np.array(link.full_inertia, dtype=np.float64)).max()), float(link.armature))
