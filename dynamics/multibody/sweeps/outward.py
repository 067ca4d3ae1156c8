"""The outward sweep: how each body moves, from how the one that carries it does; its energy, and the wrench it takes.

Pairs of velocities and the forces that work on them are the Newton-Euler equations; their inward sweep is the reverse
sweep of AD over the outward one. Any Lagrangian gives the same by differentiation. Of rigid bodies they take half as
many operations this way: gravity is an acceleration of the ground, velocities of points are not needed, and what a
body's rotation makes of them is one tensor, alpha x b + omega x (omega x b) for every point b of the body.
(J. Y. S. Luh, M. W. Walker, R. P. C. Paul, "On-line computational scheme for mechanical manipulators", J. Dyn. Sys.
Meas. Control 102(2), 1980; the tensor: C. A. Balafoutis, R. V. Patel, "Dynamic Analysis of Robot Manipulators", 1991.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array
from cgraph.extend import Builder, as_node, building

from ...systems.body_terms import BiasForce
from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple, cross, plus, scaled
from ..algebra.spatial_vectors import Twist
from ..algebra.turns import NO_TURN, AxisTurn, Turn, about_z, in_a_row
from .links import LinkState

KINETIC, POTENTIAL = "kinetic", "potential"
Tensor = tuple[Triple, Triple, Triple]  # rows


class Motion(NamedTuple):
    """Twist of a body's frame, in axes whose z is the joint's axis: the body's own.

    vertical, depth, strength: a mass m at r from the origin has the potential energy m strength (depth + vertical . r).
    turn: from the joint's axes to those of the motion.
    plane: of a body that turns about z alone, whose axes are those of the plane it moves in: the body is turned from
    them. What does not turn with the body is then constant, and velocities are rates of positions.
    """

    omega: Triple  # angular velocity
    velocity: Triple  # of the origin
    vertical: Triple  # upward, as long as gravity is strong; or downward, of length 1
    depth: Node  # of the origin along it
    strength: float | Node = 1.0  # 1 in the first case, -g [m/s^2] in the second
    turn: Turn = NO_TURN
    plane: AxisTurn | None = None

    def into(self, vector: Triple) -> Triple:
        """A vector in the axes of the motion, in the body's."""
        return self.plane.into(vector) if self.plane else vector

    def out(self, vector: Triple) -> Triple:
        """A vector in the body's axes, in those of the motion."""
        return self.plane.out(vector) if self.plane else vector

    def in_body_axes(self) -> Motion:
        """The motion in axes that turn with the body."""
        with cg.tag(KINETIC):
            velocity = self.into(self.velocity)
        with cg.tag(POTENTIAL):
            vertical = self.into(self.vertical)
        return self._replace(velocity=velocity, vertical=vertical, plane=None)

    def keeps(self, at: LinkState) -> bool:
        """Whether a link carried by this body stays in its plane."""
        return self.plane is not None and at.joint.has_axis and at.link.parallel


def ground(gravity: Array, *, in_plane: bool = False) -> Motion:
    """The world at rest.

    in_plane: all bodies turn about parallel axes. Then g is kept apart from the vertical, so that heights are lengths:
    fewer nodes. In space the vertical has three components, which had better be scaled once.
    """
    along = [i for i, each in enumerate(gravity) if isinstance(each, Node) or each != 0.0]
    if not along:
        return Motion(STILL, STILL, STILL, ZERO)
    if in_plane and gravity.dtype != object:
        downward = spatial.unit(gravity)
        return Motion(STILL, STILL, spatial.constant(downward + 0.0), ZERO, -float(downward @ gravity))
    with building(Builder()):
        if in_plane and len(along) == 1:
            return Motion(STILL, STILL, spatial.constant(-np.eye(3)[along[0]] + 0.0), ZERO, as_node(gravity[along[0]]))
        return Motion(STILL, STILL, spatial.constant(0.0 - gravity), ZERO)


def motions(states: Sequence[LinkState], ground: Motion) -> list[Motion]:
    """The motions of all links, parents first, on a ground that may move."""
    result: list[Motion] = []
    for at in states:
        with cg.tag(at.name):
            result.append(propagate_motion(result[at.parent] if at.parent >= 0 else ground, at))
    return result


def propagate_motion(parent: Motion, at: LinkState) -> Motion:
    """The motion of a link from that of its parent.

    omega = R^T omega_parent + omega_joint, v = R^T (v_parent + omega_parent x offset) + v_joint.
    """
    parent = parent if parent.keeps(at) else parent.in_body_axes()
    offset, turn = at.place, at.turn
    with cg.tag(KINETIC):
        relative = at.joint.velocity(at.moved, at.u)
        omega, velocity = at.into(parent.omega), at.into(_velocity_at(parent, offset))
    with cg.tag(POTENTIAL):
        vertical = at.into(parent.vertical)
        depth = parent.depth + spatial.dot(parent.vertical, parent.out(offset))
    begins = all([each.value == 0.0 for each in omega])
    before = NO_TURN if turn.angle is not None and (parent.plane or begins) else turn
    with cg.tag(KINETIC):
        omega, velocity = plus(before.into(omega), relative.angular), plus(before.into(velocity), relative.linear)
    with cg.tag(POTENTIAL):
        vertical = before.into(vertical)
    still = all([each.value == 0.0 for each in (*velocity, *vertical[:2])])
    plane = _plane(parent.plane, turn, at.link.turn[2][2], begins=begins, still=still)
    return Motion(omega, velocity, vertical, depth, parent.strength, before, plane)


def _plane(parent: AxisTurn | None, turn: Turn, way: float | Node, *, begins: bool, still: bool) -> AxisTurn | None:
    """The turn of a body from the plane that it moves in, which a hinge on what does not turn begins; else None.

    way: of the joint's axis on the parent's, 1 or -1 in a plane.
    still: all but the angle is alike about the axis, so that the plane may as well turn with the first body.
    """
    if turn.angle is None:
        return None
    if turn.still:
        return parent and AxisTurn(2, parent.cos, way * parent.sin, way * parent.angle)
    if parent:
        return in_a_row(parent, turn, way)
    if begins:
        return about_z(ZERO if still else turn.angle)
    return None


def _velocity_at(motion: Motion, offset: Triple) -> Triple:
    """v + omega x offset; of (a, 0, d) axis by axis, so that elimination moves inertia along one after the other."""
    if motion.plane or all([each.value != 0.0 for each in offset]):
        return plus(motion.velocity, motion.out(cross(motion.omega, offset)))
    velocity = motion.velocity
    for k, along in enumerate(offset):
        x, y, z = (along if k == i else ZERO for i in range(3))
        velocity = plus(velocity, cross(motion.omega, (x, y, z)))
    return velocity


def energy(motion: Motion, at: LinkState) -> Node:
    """L_i = K_i - P_i."""
    kinetic, potential = energies(motion, at)
    return kinetic - potential


def energies(motion: Motion, at: LinkState) -> tuple[Node, Node]:
    """K_i and P_i with the first moment m c and the inertia J about the joint, without the center's velocity.

    K = m v.v / 2 + m c . (v x w) + w . J w / 2,  P = m g h + g u . m c + spring.
    """
    own, link, inertia = motion.in_body_axes(), at.link, at.link.inertia
    omega, v = own.omega, motion.velocity
    with cg.tag(KINETIC):
        translation = 0.5 * link.mass * spatial.dot(v, v)
        coupling = spatial.dot(cross(own.velocity, omega), link.moment)
        rotation = 0.5 * sum([inertia[i][i] * (omega[i] * omega[i]) for i in range(3)], ZERO)
        # Forward dynamics eliminates from the last term on: in these orders with the fewest and shallowest nodes.
        if motion.plane:
            terms = [rotation, translation, coupling]
        else:
            terms = [coupling, rotation] if translation.value == 0.0 else [translation, rotation, coupling]
        terms += [inertia[i][j] * (omega[i] * omega[j]) for i in range(3) for j in range(i)]
        terms.append(0.5 * link.armature * sum([velocity * velocity for velocity in at.u], ZERO))
        kinetic = sum(terms, ZERO)
    with cg.tag(POTENTIAL):
        mass, moment = link.weight
        weight = scaled(motion.strength, moment)
        potential = mass * motion.strength * motion.depth + spatial.dot(own.vertical, weight)
        for stretch in at.stretches():
            potential = potential + 0.5 * link.stiffness * (stretch * stretch)
    return kinetic, potential


class Acceleration(NamedTuple):
    """Acceleration of a body, in axes that stand still where those of its motion are just now.

    A point of the body, b from its origin, has the acceleration linear + tensor b. For a body that moves in a plane
    `swept` takes b in the axes of the body and gives it in those of the plane; else it is the tensor.
    """

    angular: Triple
    linear: Triple  # of the origin, against free fall
    tensor: Tensor
    swept: Tensor
    tags: tuple[str, ...]  # the energies that the linear acceleration comes of


def base_acceleration(ground: Motion) -> Acceleration:
    """Base acceleration: gravity enters as an upward acceleration, as in RNEA."""
    vertical = scaled(ground.strength, ground.vertical)
    falls = any([each.value != 0.0 for each in vertical])
    return acceleration_in_space(STILL, Twist(STILL, vertical), (KINETIC, POTENTIAL) if falls else (KINETIC,))


def acceleration_in_space(omega: Triple, rate: Twist, tags: tuple[str, ...]) -> Acceleration:
    """Acceleration of a body with angular velocity omega that does not move in a plane, in its axes."""
    tensor = _tensor(omega, rate.angular)
    return Acceleration(rate.angular, rate.linear, tensor, tensor, tags)


def propagate_acceleration(parent: Acceleration, before: Motion, after: Motion, at: LinkState) -> Acceleration:
    """A link's acceleration from its parent's: `after` is `propagate_motion(before, at)`.

    a = R^T (a_parent + T offset) + 2 omega x v_joint + a_joint,  alpha = R^T alpha_parent + omega x omega_joint +
    alpha_joint, with the parent's omega in the axes of the motion.
    """
    stays, turn, joint, q = before.keeps(at), after.turn, at.joint, at.moved
    relative = joint.velocity(q, at.u)
    with cg.tag(*parent.tags):
        linear = parent.linear if stays else before.into(parent.linear)
        linear = turn.into(at.into(plus(linear, _times(parent.swept if stays else parent.tensor, at.place))))
        rate, omega = joint.acceleration(q, at.u), turn.into(at.into(before.omega))
        # + a_joint + 2 omega x v_joint
        linear = plus(plus(linear, rate.linear), cross(omega, scaled(2.0, relative.linear)))
    with cg.tag(KINETIC):  # velocities are linear in u, so that those of u_dot are their rates at constant q
        angular = plus(turn.into(at.into(parent.angular)), rate.angular)
        change = joint.velocity(q, at.u_dot)
        # + omega x omega_joint + alpha_joint
        angular = plus(plus(angular, cross(omega, relative.angular)), change.angular)
        linear = plus(linear, change.linear)
        tensor = swept = _tensor(after.omega, angular)
        if after.plane:  # T R_z of a turn about z alone
            square, alpha, c, s = after.omega[2] * after.omega[2], angular[2], after.plane.cos, after.plane.sin
            along, across = c * square + s * alpha, s * square - c * alpha
            swept = (-along, across, ZERO), (-across, -along, ZERO), STILL
    return Acceleration(angular, linear, tensor, swept, parent.tags)


def wrenches(states: Sequence[LinkState], motions: Sequence[Motion]) -> list[BiasForce]:
    """The wrenches of all links, parents first.  motions: theirs, and that of the world last."""
    forces, accelerations = list[BiasForce](), list[Acceleration]()
    base = base_acceleration(motions[-1])
    for at, motion in zip(states, motions, strict=False):
        with cg.tag(at.name):
            parent = accelerations[at.parent] if at.parent >= 0 else base
            accelerations.append(propagate_acceleration(parent, motions[at.parent], motion, at))
            forces += wrench(accelerations[-1], motion, at)
    return forces


def wrench(acceleration: Acceleration, motion: Motion, at: LinkState) -> list[BiasForce]:
    """The wrench, each component paired with the velocity it works on; the spring's and the armature's force likewise.

    f = m a + T h, n = J alpha + omega x J omega + h x a, for the tensor T and the first moment h.
    """
    w, alpha, a, tensor = motion.omega, acceleration.angular, acceleration.linear, acceleration.tensor
    link, inertia = at.link, at.link.full_inertia
    with cg.tag(KINETIC):
        force, torque = _times(acceleration.swept, link.moment), []
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            # component i of J alpha + omega x J omega
            turn = inertia[i][i] * alpha[i] + (inertia[k][k] - inertia[j][j]) * (w[j] * w[k])
            turn = turn + inertia[j][k] * (w[j] * w[j] - w[k] * w[k])
            torque.append(turn + inertia[i][k] * tensor[j][i] - inertia[i][j] * tensor[k][i])
    with cg.tag(*acceleration.tags):
        force = plus(scaled(link.mass, a), force)
        torque = [a + b for a, b in zip(torque, cross(link.moment, motion.into(a)), strict=True)]
    with cg.tag(POTENTIAL):
        springs = at.springs()
        if link.lift is not None:
            up = scaled(motion.strength, motion.vertical)
            force = plus(force, scaled(-link.lift.mass, up))
            lifted = cross(spatial.constant(link.lift.moment), motion.into(up))
            torque = [a - b for a, b in zip(torque, lifted, strict=True)]
    with cg.tag(KINETIC):
        armatures = [(velocity, link.armature * rate) for velocity, rate in zip(at.u, at.u_dot, strict=True)]
    return [*zip((*motion.velocity, *motion.omega), (*force, *torque), strict=True), *springs, *armatures]


def _tensor(w: Triple, alpha: Triple) -> Tensor:
    """T with T b = alpha x b + w x (w x b)."""
    xx, yy, zz = (each * each for each in w)
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    x, y, z = alpha
    return (-(yy + zz), xy - z, xz + y), (xy + z, -(xx + zz), yz - x), (xz - y, yz + x, -(xx + yy))


def _times(tensor: Tensor, point: Triple) -> Triple:
    x, y, z = (spatial.dot(row, point) for row in tensor)
    return x, y, z
