"""The bias of a tree of bodies as forces at their velocities: the Newton-Euler equations at qdd = 0.

Any Lagrangian gives its bias by differentiation. Of rigid bodies it takes half as many operations this way: gravity is
an acceleration of the ground, velocities of points are not needed, and what a body's rotation makes of them is one
tensor, alpha x b + omega x (omega x b) for every point b of the body. (J. Y. S. Luh, M. W. Walker, R. P. C. Paul,
"On-line computational scheme for mechanical manipulators", J. Dyn. Sys. Meas. Control 102(2), 1980; the tensor:
C. A. Balafoutis, R. V. Patel, "Dynamic Analysis of Robot Manipulators", 1991.)
"""

from __future__ import annotations

from typing import NamedTuple

import cgraph as cg
from cgraph import Node

from ..systems.system import BiasForce
from . import spatial
from .link import Link, Motion, carrier, placed
from .spatial import STILL, Triple

KINETIC, POTENTIAL = "kinetic", "potential"


class Acceleration(NamedTuple):
    """How a body's motion changes at qdd = 0, in axes that stand still where those of its motion are just now."""

    angular: Triple
    linear: Triple  # of the origin, against free fall
    tensor: tuple[Triple, Triple, Triple]  # rows; a point b from the origin has tensor b more
    tags: tuple[str, ...]  # the energies that the linear acceleration comes of


def at_rest(ground: Motion) -> Acceleration:
    """The ground's, which gravity is."""
    falls = any([each.value != 0.0 for each in ground.up])
    return Acceleration(STILL, ground.up, (STILL, STILL, STILL), (KINETIC, POTENTIAL) if falls else (KINETIC,))


def accelerated(
    parent: Acceleration, before: Motion, after: Motion, link: Link, kind: str, q: Node, qd: Node
) -> Acceleration:
    """A link's, from its parent's: `after` is `carried(before, link, kind, q, qd)`."""
    linear, (x, y, _) = parent.linear, after.omega
    on = carrier(before, link)
    with cg.tag(*parent.tags):
        if before.turned and not on.turned:
            linear = spatial.turned_about_z(before.turned.cos, before.turned.sin, linear)
        linear = spatial.plus(linear, _at(parent.tensor, placed(on, link, kind, q)))
        linear = spatial.turned(link.turn, linear)
    with cg.tag(KINETIC):
        angular = spatial.turned(link.turn, parent.angular)
    if kind == "prismatic":
        with cg.tag(*parent.tags):  # Coriolis: twice omega x velocity along z
            linear = linear[0] + 2.0 * qd * y, linear[1] - 2.0 * qd * x, linear[2]
    elif not after.turned:
        c, s = cg.cos(q), cg.sin(q)
        with cg.tag(*parent.tags):
            linear = spatial.turned_about_z(c, s, linear)
        with cg.tag(KINETIC):
            angular = spatial.turned_about_z(c, s, angular)
            angular = angular[0] + y * qd, angular[1] - x * qd, angular[2]
    with cg.tag(KINETIC):
        tensor = _tensor(after.omega, angular)
    return Acceleration(angular, linear, tensor, parent.tags)


def forces(acceleration: Acceleration, motion: Motion, link: Link, q: Node, qd: Node) -> list[BiasForce]:
    """What moves a link so at qdd = 0: a force at its velocity, a torque at its angular velocity, its spring's at qd.

    f = m a + T h, n = J alpha + omega x J omega + h x a, for the tensor T and the first moment h.
    """
    w, alpha, a, tensor = motion.omega, acceleration.angular, acceleration.linear, acceleration.tensor
    inertia = [[link.inertia[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)]
    moment = link.moment
    if motion.turned:
        with cg.tag(KINETIC):
            moment = spatial.turned_about_z(motion.turned.cos, -motion.turned.sin, moment)
    with cg.tag(KINETIC):
        force, torque = _at(tensor, moment), []
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            turn = inertia[i][i] * alpha[i] + (inertia[k][k] - inertia[j][j]) * (w[j] * w[k])
            turn = turn + inertia[j][k] * (w[j] * w[j] - w[k] * w[k])
            torque.append(turn + inertia[i][k] * tensor[j][i] - inertia[i][j] * tensor[k][i])
    with cg.tag(*acceleration.tags):
        force = spatial.plus((link.mass * a[0], link.mass * a[1], link.mass * a[2]), force)
        torque = [a + b for a, b in zip(torque, spatial.cross(moment, a), strict=True)]
    with cg.tag(POTENTIAL):
        spring = link.stiffness * (q - link.spring_reference)
    return list(zip((*motion.velocity, *motion.omega, qd), (*force, *torque, spring), strict=True))


def _tensor(w: Triple, alpha: Triple) -> tuple[Triple, Triple, Triple]:
    """T with T b = alpha x b + w x (w x b)."""
    xx, yy, zz = (each * each for each in w)
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    x, y, z = alpha
    return (-(yy + zz), xy - z, xz + y), (xy + z, -(xx + zz), yz - x), (xz - y, yz + x, -(xx + yy))


def _at(tensor: tuple[Triple, Triple, Triple], point: Triple) -> Triple:
    x, y, z = (spatial.dot(row, point) for row in tensor)
    return x, y, z
