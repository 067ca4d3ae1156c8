"""Trees of bodies in 66 digits, in the world's axes, by the velocities of centers of mass: no graph, no derivative.

Their slopes are central differences. Arrays hold decimal numbers, and are rounded at last.
"""

from contextlib import AbstractContextManager
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np

from cgraph.extend import OPS
from dynamics import Mechanism
from dynamics.multibody.bodies.joint_coordinates import places
from dynamics.multiprecision.decimal_numbers import mpmath_context, value, working
from tests.dynamics.mechanisms import Array

DIGITS = 66
STEP = Decimal(2.0**-56)  # of central differences, which are right to its square


def digits() -> AbstractContextManager[Any]:
    return working(DIGITS)


sin, cos, atan = (value(OPS[name], mpmath_context(DIGITS)) for name in ("sin", "cos", "atan"))
exactly = np.vectorize(lambda x: Decimal(float(x)), otypes=[object])
floats = np.vectorize(float, otypes=[np.float64])


def _solved(matrix: Any, right: Any) -> Any:
    """By elimination, of a positive definite matrix."""
    n = len(matrix)
    rows = np.hstack([matrix, right.reshape(n, -1)])
    for k in range(n):
        rows[k] /= rows[k, k]
        others = np.arange(n) != k
        rows[others] -= np.outer(rows[others, k], rows[k])
    return rows[:, n:].reshape(right.shape)


def _unit(vector: Any) -> Any:
    return vector / (vector @ vector).sqrt()


def _skew(a: Any) -> Any:
    return np.cross(a, exactly(np.eye(3))).T


def _rotation(axis: Any, angle: Any) -> Any:
    return exactly(np.eye(3)) + sin(angle) * _skew(axis) + (1 - cos(angle)) * _skew(axis) @ _skew(axis)


def _of_quaternion(quaternion: Any) -> Any:
    w, *v = _unit(quaternion)
    return exactly(np.eye(3)) + 2 * (w * _skew(np.array(v)) + _skew(np.array(v)) @ _skew(np.array(v)))


def _joint(joint: Any, before: Any, q: Any) -> tuple[Any, Any, Any, Any]:
    """The body's axes as columns, its shift, and the angular and the linear part of each of its velocities."""
    still, kind = exactly(np.zeros((3, 3))), joint.kind
    if kind in ("revolute", "prismatic", "screw"):
        own = _unit(exactly(joint.axis))
        axis = before @ own
        turns, slides = Decimal(int(kind != "prismatic")), Decimal(1 if kind == "prismatic" else float(joint.pitch))
        return before @ _rotation(own, turns * q[0]), slides * q[0] * axis, [turns * axis], [slides * axis]
    axes = before @ _of_quaternion(q[-4:])
    if kind == "ball":
        return axes, still[0], axes.T, still
    return axes, before @ q[:3], [*still, *axes.T], [*(before if kind == "free" else axes).T, *still]


def _moved(tree: Mechanism, q: Any, u: Any, step: Any) -> Any:
    """The coordinates a step along velocities u later, to first order."""
    later = q.copy()
    for body, place in zip(tree.moving, places(tree.moving), strict=True):
        x, v = q[place.q], u[place.u]
        if len(x) == len(v):
            later[place.q] = x + step * v
            continue
        w, e = v[-3:], x[-4:]
        rate = [-(e[1:] @ w), *(e[0] * w + np.cross(e[1:], w))]
        along = v[:-3] if body.joint.kind != "free (body axes)" else _of_quaternion(e) @ v[:-3]
        later[place.q] = x + step * np.array([*along, *[each / 2 for each in rate]])
    return later


def _spring(joint: Any, x: Any) -> Any:
    """The torques, (k,), by which a spring pulls back."""
    if joint.kind != "ball":
        return Decimal(float(joint.stiffness)) * (x - Decimal(float(joint.spring_reference)))
    length = (x[1:] @ x[1:]).sqrt()
    assert x[0] > 0, "a rotation vector of more than half a turn"
    return Decimal(float(joint.stiffness)) * 2 * atan(length / x[0]) / length * x[1:]


def _terms(tree: Mechanism, q: Any, qd: Any) -> tuple[Any, Any, Any]:
    """M (n, n), bias and braking (n,)."""
    n, still, none = len(qd), exactly(np.zeros(3)), exactly(np.zeros((0, 3)))
    nowhere = np.zeros(0, int), none, none  # which velocities move a body, their angular and their linear parts
    states: dict[str, Any] = {"world": (exactly(np.eye(3)), still, still, -exactly(tree.gravity), *nowhere)}
    mass, bias, braking = (exactly(np.zeros(shape)) for shape in ((n, n), n, n))
    for body, place in zip(tree.moving, places(tree.moving), strict=True):
        turn, w, alpha, a, which, S, T = states[body.parent]
        u, first, joint = qd[place.u], place.u.start, body.joint
        axes, shift, angular, linear = _joint(joint, turn @ exactly(joint.orientation), q[place.q])
        r = turn @ exactly(joint.position) + shift
        spin, slide = (sum([x * s for x, s in zip(u, part, strict=True)], still) for part in (angular, linear))
        after = w + spin
        a = a + np.cross(alpha, r) + np.cross(w, np.cross(w, r) + slide)
        a = a + np.cross(after if joint.kind == "free (body axes)" else w, slide)
        alpha = alpha + np.cross(w, spin)
        which = np.append(which, np.arange(first, place.u.stop))
        T = np.concatenate([T + np.cross(S, r), linear]) if len(S) else np.array(linear)
        S = np.concatenate([S, angular]) if len(S) else np.array(angular)
        states[body.name] = axes, after, alpha, a, which, S, T
        c, m = axes @ exactly(body.center), Decimal(float(body.mass))
        inertia = axes @ exactly(body.inertia) @ axes.T
        force = m * (a + np.cross(alpha, c) + np.cross(after, np.cross(after, c)))
        torque = inertia @ alpha + np.cross(after, inertia @ after)
        at_center = T + np.cross(S, c)
        bias[which] += at_center @ force + S @ torque
        mass[np.ix_(which, which)] += m * (at_center @ at_center.T) + S @ inertia @ S.T
        rows = range(first, place.u.stop)
        mass[rows, rows] += Decimal(float(joint.armature))
        braking[place.u] = Decimal(float(joint.damping)) * u
        if joint.type.sprung and joint.stiffness:
            bias[place.u] += _spring(joint, q[place.q])
    return mass, bias, braking


def tree_in_digits(tree: Mechanism, q: Array, qd: Array, qdd: Array, tau: Array) -> dict[str, Array]:
    """M (n, n), bias, torques and accelerations (n,), with springs, dampers and armatures."""
    with digits():
        mass, bias, braking = _terms(tree, exactly(q), exactly(qd))
        torques = mass @ exactly(qdd) + bias + braking
        accelerations = _solved(mass, exactly(tau) - bias - braking)
        rows = {"mass": mass, "bias": bias, "torques": torques, "accelerations": accelerations}
        return {name: floats(row) for name, row in rows.items()}


class Slopes(NamedTuple):
    """Of torques at a motion, and of accelerations at torques, (n, 3n): by displacements, qd, and qdd or tau.

    sides: what M times the latter is.
    """

    torques: Any
    accelerations: Any
    sides: Any = None


def slopes_in_digits(tree: Mechanism, q: Array, qd: Array, qdd: Array, tau: Array) -> Slopes:
    """The slopes, not rounded."""
    with digits():
        at, u, n = exactly(q), exactly(qd), len(qd)
        mass, bias, braking = _terms(tree, at, u)
        solved, units = _solved(mass, exactly(tau) - bias - braking), exactly(np.eye(n))
        columns: tuple[list[Any], list[Any]] = ([], [])
        pairs = [[(_moved(tree, at, unit, s * STEP), u) for s in (1, -1)] for unit in units]
        pairs += [[(at, u + s * STEP * unit) for s in (1, -1)] for unit in units]
        for pair in pairs:
            ahead, behind = (_terms(tree, *state) for state in pair)
            by_mass, *forces = [(a - b) / (2 * STEP) for a, b in zip(ahead, behind, strict=True)]
            for column, motion in zip(columns, (exactly(qdd), solved), strict=True):
                column.append(by_mass @ motion + forces[0] + forces[1])
        sides = np.hstack([-np.array(columns[1]).T, units])
        return Slopes(np.hstack([np.array(columns[0]).T, mass]), _solved(mass, sides), sides)
