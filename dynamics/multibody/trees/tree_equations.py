"""The Lagrangian and the bias of a tree of bodies, as nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array
from cgraph.extend import Builder, building, hessian_nodes

from ...systems.body_terms import BiasForce, MotionState, TorqueDerivatives
from ..algebra import spatial
from ..bodies.body import Body, quantities
from ..joints import JointType
from ..sweeps.base_parameters import base_parameter_links, without_axial_moments
from ..sweeps.equation_links import equation_links
from ..sweeps.links import Link, LinkState, Numbers, axes_of, link, link_states
from ..sweeps.mass_matrix import PlacedLink, mass_matrix_columns, size_of
from ..sweeps.outward import Motion, base_acceleration, energy, ground, motions, wrenches
from ..sweeps.subtree_momentum import momentum_rates
from .structure import Structure

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
        carriers = [self.bodies[i] if i >= 0 else None for i in self.parents]
        links = [link(body, carrier) for body, carrier in zip(self.bodies, carriers, strict=True)]
        for i, body in enumerate(self.bodies):
            if lift := self.lifts.get(body.name):
                links[i] = replace(links[i], lift=lift.turned(axes_of(body).T))
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
