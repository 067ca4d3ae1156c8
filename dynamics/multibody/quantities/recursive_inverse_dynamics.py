"""Inverse dynamics body by body: one compiled kernel for each kind of joint, for trees whose structure changes.

The kernels are the Newton-Euler equations of every other graph, of one body instead of all: forwards its angular
velocity and accelerations, backwards its wrench and those of the bodies that it carries, to the parent and to the
joint. What a body is made of is an input: to hang a tool on an arm, or to lock one of its joints, makes no new graph
and no new code.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Compiled, Node
from cgraph._shared import Array, memo, real_array
from cgraph.extend import Builder, building, cotangents

from ...systems.kinematics import gathered, numbered_graph
from ..algebra.spatial import STILL, ZERO, Triple
from ..algebra.spatial_vectors import Twist
from ..bodies.joint_coordinates import places
from ..joints import JointType
from ..sweeps.links import Link, LinkState
from ..sweeps.outward import Motion, acceleration_in_space, ground, propagate_acceleration, propagate_motion, wrench
from ..trees.mechanism import Mechanism, require_mechanism

MOTION, WRENCH = 9, 6  # numbers: angular velocity, angular and linear acceleration; force and moment


class RecursiveInverseDynamics:
    """tau of the motion of a mechanism, (q, qd, qdd) -> tau, ready at once.

    Compared with the compiled graph of `inverse_dynamics`, which knows the numbers of every body, an evaluation takes
    longer; nothing has to be built before the first.

    Parameters
    ----------
    mechanism : Mechanism
        Without external forces. Of parameters it takes the values.

    Raises
    ------
    ValueError
        For a mechanism with external forces or gravity compensation.

    Examples
    --------
    >>> import dynamics as dyn
    >>> torques = dyn.RecursiveInverseDynamics(dyn.planar_arm([1.0], [1.0], gravity=10.0))
    >>> torques([0.0], [0.0], [3.0]).round(12).tolist()
    [1.0]
    """

    def __init__(self, mechanism: Mechanism) -> None:
        mechanism = require_mechanism(mechanism, "RecursiveInverseDynamics")
        if mechanism.forces or any([link.lift for link in mechanism.links]):
            what = "external forces" if mechanism.forces else "gravity compensation"
            raise ValueError(f"inverse dynamics body by body does not take {what}; use inverse_dynamics")
        self.mechanism = mechanism = mechanism.bind()
        rest = ground(np.asarray(mechanism.gravity, dtype=np.float64))
        self.n = len(mechanism.velocities)
        self._parents = mechanism.parents
        self._links = [[float(number) for number in link.numbers] for link in mechanism.links]
        self._kernels = [_kernels(body.joint.type) for body in mechanism.moving]
        self._places = places(mechanism.moving)
        self._ground = [float(each) for each in (*STILL, *STILL, *rest.vertical)]  # as upward as gravity is strong

    def __call__(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """tau (n,) [N m or N] at q (nq,), qd and qdd (n,). Raises ValueError for another shape."""
        rows = [real_array(name, each) for name, each in (("q", q), ("qd", qd), ("qdd", qdd))]
        counts = (len(self.mechanism.coordinates), self.n, self.n)
        for name, row, count in zip(("q", "qd", "qdd"), rows, counts, strict=True):
            if row.shape != (count,):
                raise ValueError(f"{name} must have shape ({count},), one for each coordinate, got {row.shape}")
        x, u, a = (row.tolist() for row in rows)
        states = [[*x[place.q], *u[place.u], *a[place.u]] for place in self._places]
        motions: list[list[float]] = []
        for parent, link, (forwards, _), state in zip(self._parents, self._links, self._kernels, states, strict=True):
            carrier = motions[parent] if parent >= 0 else self._ground
            motions.append(list(forwards.values([*carrier, *state, *link])))
        bars = [[0.0] * WRENCH for _ in states]
        tau = np.empty(self.n)
        for i in reversed(range(len(states))):
            parent = self._parents[i]
            carrier = motions[parent] if parent >= 0 else self._ground
            values = self._kernels[i][1].values([*carrier, *states[i], *self._links[i], *bars[i]])
            tau[self._places[i].u] = values[WRENCH:]
            if parent >= 0:
                bars[parent] = [a + b for a, b in zip(bars[parent], values[:WRENCH], strict=True)]
        return tau


@memo(64)
def _kernels(joint: JointType) -> tuple[Compiled, Compiled]:
    """Kernels of a link on that type of joint, whatever its numbers are.

    Forwards (parent's motion, q, qd, qdd, link) -> motion; backwards, of these and the wrench of what the body carries,
    -> what the parent carries by it, and tau.
    """
    parent, velocity, bars = _variables("s", MOTION), _variables("v", 3), _variables("bar", WRENCH)
    q = _variables("q", len(joint.coordinates))
    qd, qdd = (_variables(name, len(joint.velocities)) for name in ("qd", "qdd"))
    link, numbers = _link_of_nodes()
    omega, angular, linear = (_triple(parent[k:]) for k in (0, 3, 6))
    build = Builder()
    with building(build):
        before = Motion(omega, _triple(velocity), STILL, ZERO)
        at = LinkState("", 0, link, joint, q, qd, qdd)
        motion = propagate_motion(before, at)
        carrier = acceleration_in_space(omega, Twist(angular, linear), ())
        acceleration = propagate_acceleration(carrier, before, motion, at)
        carried = zip([*motion.velocity, *motion.omega], bars, strict=True)
        forces = gathered([*carried, *wrench(acceleration, motion, at)])
    back = cotangents(forces, [*velocity, *omega, *qd], build)  # motions are linear in velocities: so without these
    with building(build):
        tau = [force + link.damping * u for force, u in zip(back[WRENCH:], qd, strict=True)]
    inputs = [*parent, *q, *qd, *qdd, *numbers]
    forwards = [*motion.omega, *acceleration.angular, *acceleration.linear]
    return _compiled(inputs, forwards), _compiled([*inputs, *bars], [*back[:WRENCH], *tau])


def _compiled(inputs: Sequence[Node], outputs: Sequence[Node]) -> Compiled:
    return cg.compile(cg.simplify(numbered_graph(inputs, outputs)))


def _variables(name: str, count: int) -> list[Node]:
    return cg.variables([f"{name}{k}" for k in range(count)])


def _triple(nodes: Sequence[Node]) -> Triple:
    return nodes[0], nodes[1], nodes[2]


def _link_of_nodes() -> tuple[Link, list[Node]]:
    """A link of variables, and these in the order of its `numbers`."""
    turn, place, moment, inertia = (_variables(*each) for each in (("R", 9), ("r", 3), ("h", 3), ("J", 6)))
    mass, damping, stiffness, reference, armature = cg.variables("mass damping stiffness spring_reference armature")
    rows = [turn[k : k + 3] for k in (0, 3, 6)]
    lower = [[inertia[0]], inertia[1:3], inertia[3:6]]
    numbers = [*turn, *place, mass, *moment, *inertia, damping, stiffness, reference, armature]
    x, y, z = place
    a, b, c = moment
    return Link(rows, (x, y, z), mass, (a, b, c), lower, damping, stiffness, reference, armature), numbers
