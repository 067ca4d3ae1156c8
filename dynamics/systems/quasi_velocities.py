"""Quasi-velocities: velocities u that are no rates of coordinates, qdot = G(q) u, as of a ball joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cgraph import Node

Function = Callable[..., Sequence[Node | float]]


@dataclass(frozen=True, eq=False)
class QuasiVelocities:
    """Motion of coordinates q, (nq,), by velocities u, (n,): qdot = G(q) u, with nq >= n.

    With the Lagrangian written in them, L(q, u, t), the equations of motion are those of Hamel, and of Euler and
    Poincare where q is a rotation:

        p = dL/du,   dp/dt + ad(u; p) - G^T dL/dq = tau + forces - damping * u

    ad comes of the brackets of the columns of G, ad_k = p . c(u, e_k) with G c(u, v) = D(G u)[G v] - D(G v)[G u].
    (G. Hamel, "Die Lagrange-Eulerschen Gleichungen der Mechanik", Z. Math. Phys. 50, 1904.)

    Parameters
    ----------
    names : sequence of str
        The velocities, or one string with spaces between them. Graphs have inputs qd0, qd1, ... in this order.
    rate : callable
        (q, u) to qdot = G(q) u: nq nodes or numbers, linear in u.
    structure : callable, optional
        (u, p) to ad(u; p): n nodes or numbers, linear in u and in p. Left out, it is 0: u are then rates of
        coordinates, if not of these.
    neutral : sequence of float, optional
        The coordinates where nothing else is said, (nq,); by default 0. About them `rate` has to be finite.
    normalized : callable, optional
        q to the same configuration with its constraint met, as q / |q| of a quaternion: nq nodes. L has to be the same
        of both, and is best written so that |q| has no part in it.
    groups : sequence of int, optional
        For each coordinate a number, the same for those that are one quantity, such as the entries of a quaternion:
        an entry counts as large as the largest of its group where tolerances are chosen. By default all differ.

    Examples
    --------
    A rigid body that turns about a fixed point: a quaternion, and its angular velocity in the body's axes.

    >>> import dynamics as dyn
    >>> def rate(e, w):
    ...     return [
    ...         0.5 * (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]),
    ...         0.5 * (e[0] * w[0] + e[2] * w[2] - e[3] * w[1]),
    ...         0.5 * (e[0] * w[1] + e[3] * w[0] - e[1] * w[2]),
    ...         0.5 * (e[0] * w[2] + e[1] * w[1] - e[2] * w[0]),
    ...     ]
    >>> def structure(w, p):
    ...     return [w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]]
    >>> turning = dyn.QuasiVelocities("wx wy wz", rate, structure, neutral=[1.0, 0.0, 0.0, 0.0])
    >>> def energy(e, w, t):
    ...     return 0.5 * (1.0 * w[0] ** 2 + 2.0 * w[1] ** 2 + 3.0 * w[2] ** 2)
    >>> rotor = dyn.System(energy, "ew ex ey ez", quasi_velocities=turning)
    >>> at = {"q0": 1.0, "q1": 0.0, "q2": 0.0, "q3": 0.0, "qd0": 1.0, "qd1": 1.0, "qd2": 1.0}
    >>> dyn.bias(rotor).evaluate(at)  # w x I w, Euler's equations
    {'bias0': 1.0, 'bias1': -2.0, 'bias2': 1.0}
    """

    names: Sequence[str]
    rate: Function
    structure: Function | None = None
    neutral: Sequence[float] | None = None
    normalized: Function | None = None
    groups: Sequence[int] | None = None
