"""The Lagrangian and the bias of a tree of bodies, as nodes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import Array, Builder, building

from ..systems.system import BiasForce
from ..systems.torque_derivatives import MotionState, TorqueDerivatives
from . import newton_euler, spatial
from .base_parameters import base_parameter_links
from .body import WORLD, Body, quantities
from .body_motion import Motion, ground
from .composite_momentum import COMPOSITE, CompositeMomentum, about_parent, body_momentum, momentum_rates, stated
from .inertial_numbers import Link
from .inverse_dynamics_columns import torque_derivatives
from .joint_coordinates import parts, places
from .joints import AxialJoint, moving_type
from .link_cache import Moved
from .mechanism_fields import Structure
from .spatial import ZERO


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
        """What motion and energy of each body are made of."""
        return self._links[0]

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
    def _links(self) -> tuple[list[Link], Array]:
        """The links, and the first moment of what of their inertia is the world's."""
        carriers = [self.bodies[i] if i >= 0 else None for i in self.parents]
        links = [self.shared.link(body, carrier) for body, carrier in zip(self.bodies, carriers, strict=True)]
        if self.base_parameters:
            return base_parameter_links(links, [body.joint.type for body in self.bodies], self.parents)
        return links, np.zeros(3)

    @cached_property
    def _fewest(self) -> list[Link]:
        """The links in as few inertial numbers as there can be, unless these would have to be computed in the graph."""
        if any([isinstance(number, Node) for link in self.links for number in link.numbers]):
            return self.links
        base = base_parameter_links(self.links, [body.joint.type for body in self.bodies], self.parents)[0]
        return min(
            self.links, base, key=lambda links: sum([number != 0.0 for link in links for number in link.numbers])
        )

    def partial_lagrangians(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Node]:
        """One for each body, tagged with its name and energy."""
        with building(Builder()):
            partials = [each.partial for each in self._moved(q, qd)]
            if self.base_parameters:
                with cg.tag("potential"):
                    moment = spatial.scaled(self.ground.strength, spatial.constant(self._links[1]))
                    partials[0] = partials[0] - spatial.dot(self.ground.vertical, moment)
        return partials

    def bias_forces(self, q: Sequence[Node], qd: Sequence[Node], qdd: Sequence[Node] | None) -> list[BiasForce]:
        """The wrenches of all bodies at these accelerations, with the velocities that they work on.

        Of base numbers; for forward dynamics (None) of what the bodies are, which of a chain of 100 keeps a digit more.
        """
        links = self.links if qdd is None else self._fewest
        forces: list[BiasForce] = []
        with building(Builder()):
            accelerations = {WORLD: newton_euler.base_acceleration(self.ground)}
            rates = [(qdd or [ZERO] * len(qd))[place.u] for place in places(self.bodies)]
            rows = zip(self.bodies, links, self._moved(q, qd), parts(self.bodies, q, qd), rates, strict=True)
            for body, link, moved, state, u_dot in rows:
                joint = moving_type(body.joint.type)
                with cg.tag(body.name):
                    acceleration = accelerations[body.name] = newton_euler.propagate_acceleration(
                        accelerations[body.parent], moved.parent, moved.motion, link, joint, *state, u_dot
                    )
                    forces += newton_euler.wrench(acceleration, moved.motion, link, joint, *state, u_dot)
        return forces

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
                    composites[i] = stated(composites[i], link, joint, x, u, p[at[i].u])
                    motions = (moved.parent, moved.motion)
                    rates[:0] = momentum_rates(composites[i], *motions, link, joint, x, u, p[at[i].u])
                    if (k := self.parents[i]) >= 0:
                        carried = about_parent(composites[i], *motions, link, joint, x)
                        composites[k] = composites[k].plus(carried)
        return rates

    def torque_derivatives(self, state: MotionState, build: Builder) -> TorqueDerivatives | None:
        """Of all bodies, with their springs."""
        if not self._turning:
            return None
        with building(build):
            up = newton_euler.base_acceleration(self.ground).linear
            return torque_derivatives(self.bodies, self.links, self.parents, up, state, build)

    def _moved(self, q: Sequence[Node], qd: Sequence[Node]) -> list[Moved]:
        motions = {WORLD: self.ground}
        result = []
        for body, link, (x, u) in zip(self.bodies, self.links, parts(self.bodies, q, qd), strict=True):
            moved = self.shared.moved(motions[body.parent], body, link, x, u)
            motions[body.name] = moved.motion
            result.append(moved)
        return result
