"""What moves a tree of bodies as forces at their velocities: the Newton-Euler equations, at qdd = 0 those of the bias.

Any Lagrangian gives them by differentiation. Of rigid bodies they take half as many operations this way: gravity is
an acceleration of the ground, velocities of points are not needed, and what a body's rotation makes of them is one
tensor, alpha x b + omega x (omega x b) for every point b of the body. (J. Y. S. Luh, M. W. Walker, R. P. C. Paul,
"On-line computational scheme for mechanical manipulators", J. Dyn. Sys. Meas. Control 102(2), 1980; the tensor:
C. A. Balafoutis, R. V. Patel, "Dynamic Analysis of Robot Manipulators", 1991.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node

from ...systems.body_terms import BiasForce
from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple
from ..joints import AxialJoint, MovingJoint, SpatialJoint
from .body_motion import Motion, carrier_motion, joint_translation, spring_forces
from .inertial_numbers import Link

KINETIC, POTENTIAL = "kinetic", "potential"
Tensor = tuple[Triple, Triple, Triple]  # rows


class Acceleration(NamedTuple):
    """How a body's motion changes, in axes that stand still where those of its motion are just now.

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
    vertical = spatial.scaled(ground.strength, ground.vertical)
    falls = any([each.value != 0.0 for each in vertical])
    return acceleration_in_space(STILL, STILL, vertical, (KINETIC, POTENTIAL) if falls else (KINETIC,))


def acceleration_in_space(omega: Triple, angular: Triple, linear: Triple, tags: tuple[str, ...]) -> Acceleration:
    """That of a body with angular velocity omega that does not move in a plane, in its axes."""
    tensor = _tensor(omega, angular)
    return Acceleration(angular, linear, tensor, tensor, tags)


def propagate_acceleration(
    parent: Acceleration,
    before: Motion,
    after: Motion,
    link: Link,
    joint: MovingJoint,
    q: Sequence[Node],
    u: Sequence[Node],
    u_dot: Sequence[Node],
) -> Acceleration:
    """A link's acceleration from its parent's: `after` is `propagate_motion(before, link, joint, q, u)`."""
    linear = parent.linear
    in_plane = carrier_motion(before, link, joint).plane
    with cg.tag(*parent.tags):
        if before.plane and not in_plane:
            linear = spatial.rotate_about_z(before.plane.cos, before.plane.sin, linear)
        tensor = parent.swept if in_plane else parent.tensor
        linear = spatial.plus(linear, _times(tensor, joint_translation(link, joint, q)))
        linear = spatial.rotate_transpose(link.turn, linear)
    with cg.tag(KINETIC):
        angular = spatial.rotate_transpose(link.turn, parent.angular)
    if isinstance(joint, AxialJoint):
        linear, angular = _about_axis(parent.tags, after, joint, q[0], u[0], linear, angular)
        with cg.tag(KINETIC):
            linear = spatial.plus(linear, (ZERO, ZERO, joint.shift(u_dot[0])))
            angular = spatial.plus(angular, (ZERO, ZERO, joint.angle(u_dot[0])))
    else:
        omega = spatial.rotate_transpose(link.turn, before.omega)
        linear, angular = _in_space(parent.tags, joint, q, u, omega, linear, angular)
        with cg.tag(KINETIC):  # linear in u, so that these are their rates at constant q
            linear = spatial.plus(linear, joint.linear_velocity(q, u_dot))
            angular = spatial.plus(angular, joint.angular_velocity(q, u_dot))
    with cg.tag(KINETIC):
        tensor = swept = _tensor(after.omega, angular)
        if after.plane:
            square, alpha, (_, c, s) = after.omega[2] * after.omega[2], angular[2], after.plane
            along, across = c * square + s * alpha, s * square - c * alpha
            swept = (-along, across, ZERO), (-across, -along, ZERO), STILL
    return Acceleration(angular, linear, tensor, swept, parent.tags)


def _in_space(
    tags: Sequence[str],
    joint: SpatialJoint,
    q: Sequence[Node],
    u: Sequence[Node],
    omega: Triple,
    linear: Triple,
    angular: Triple,
) -> tuple[Triple, Triple]:
    """R^T a + 2 omega_parent x v_joint + a_joint, R^T alpha + omega_parent x omega_joint + alpha_joint, in body axes.

    omega, linear, angular: of the parent, in the joint's axes.
    """
    turn = joint.rotation(q)
    with cg.tag(*tags):
        velocity, omega = joint.linear_velocity(q, u), spatial.rotate_transpose(turn, omega)
        linear = spatial.plus(spatial.rotate_transpose(turn, linear), joint.linear_acceleration(q, u))
        linear = spatial.plus(linear, spatial.scaled(2.0, spatial.cross(omega, velocity)))
    with cg.tag(KINETIC):
        angular = spatial.plus(spatial.rotate_transpose(turn, angular), joint.angular_acceleration(q, u))
        return linear, spatial.plus(angular, spatial.cross(omega, joint.angular_velocity(q, u)))


def _about_axis(
    tags: Sequence[str], after: Motion, joint: AxialJoint, q: Node, qd: Node, linear: Triple, angular: Triple
) -> tuple[Triple, Triple]:
    """The same of a joint with one axis, by the components of the body's angular velocity across it."""
    (x, y, _), spin, slide = after.omega, joint.angle(qd), joint.shift(qd)
    if spin.value != 0.0 and not after.plane:
        c, s = cg.cos(joint.angle(q)), cg.sin(joint.angle(q))
        with cg.tag(*tags):
            linear = spatial.rotate_about_z(c, s, linear)
        with cg.tag(KINETIC):
            angular = spatial.rotate_about_z(c, s, angular)
            angular = angular[0] + y * spin, angular[1] - x * spin, angular[2]
    if slide.value != 0.0:
        with cg.tag(*tags):  # Coriolis: twice omega x velocity along z
            linear = linear[0] + 2.0 * slide * y, linear[1] - 2.0 * slide * x, linear[2]
    return linear, angular


def wrench(
    acceleration: Acceleration,
    motion: Motion,
    link: Link,
    joint: MovingJoint,
    q: Sequence[Node],
    u: Sequence[Node],
    u_dot: Sequence[Node],
) -> list[BiasForce]:
    """The wrench, each component paired with the velocity it works on; the spring's and the armature's force likewise.

    f = m a + T h, n = J alpha + omega x J omega + h x a, for the tensor T and the first moment h.
    """
    w, alpha, a, tensor = motion.omega, acceleration.angular, acceleration.linear, acceleration.tensor
    inertia = [[link.inertia[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)]
    with cg.tag(KINETIC):
        force, torque = _times(acceleration.swept, link.moment), []
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            turn = inertia[i][i] * alpha[i] + (inertia[k][k] - inertia[j][j]) * (w[j] * w[k])
            turn = turn + inertia[j][k] * (w[j] * w[j] - w[k] * w[k])
            torque.append(turn + inertia[i][k] * tensor[j][i] - inertia[i][j] * tensor[k][i])
    with cg.tag(*acceleration.tags):
        force = spatial.plus(spatial.scaled(link.mass, a), force)
        if motion.plane:
            a = spatial.rotate_about_z(motion.plane.cos, motion.plane.sin, a)
        torque = [a + b for a, b in zip(torque, spatial.cross(link.moment, a), strict=True)]
    with cg.tag(POTENTIAL):
        springs = spring_forces(link, joint, q, u)
    with cg.tag(KINETIC):
        armatures = [(velocity, link.armature * rate) for velocity, rate in zip(u, u_dot, strict=True)]
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
