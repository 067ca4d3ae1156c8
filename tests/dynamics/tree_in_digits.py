"""Trees of bodies in 66 digits, in the world's axes, by the velocities of centers of mass: no graph, no derivative."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from dynamics import Mechanism
from dynamics.multibody.bodies.joint_coordinates import places
from tests.dynamics.mechanisms import Array

Vector = list[Any]
DIGITS = 230  # bits


def _numbers(values: object) -> Vector:
    return [arb(float(value)) for value in np.asarray(values, dtype=np.float64).ravel()]


def _matrix(values: object) -> list[Vector]:
    return [_numbers(row) for row in np.asarray(values, dtype=np.float64)]


def _dot(a: Vector, b: Vector) -> Any:
    return sum([x * y for x, y in zip(a, b, strict=True)], arb(0))


def _times(matrix: Sequence[Vector], vector: Vector) -> Vector:
    return [_dot(row, vector) for row in matrix]


def _transposed(matrix: Sequence[Vector]) -> list[Vector]:
    return [list(column) for column in zip(*matrix, strict=True)]


def _product(a: Sequence[Vector], b: Sequence[Vector]) -> list[Vector]:
    return [[_dot(row, column) for column in _transposed(b)] for row in a]


def _sum(*vectors: Vector) -> Vector:
    return [sum(entries, arb(0)) for entries in zip(*vectors, strict=True)]


def _scaled(factor: Any, vector: Vector) -> Vector:
    return [factor * x for x in vector]


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _unit(vector: Vector) -> Vector:
    return [x / _dot(vector, vector).sqrt() for x in vector]


def _rotation(axis: Vector, angle: Any) -> list[Vector]:
    c, s, (x, y, z) = angle.cos(), angle.sin(), axis
    cross = [[arb(0), -z, y], [z, arb(0), -x], [-y, x, arb(0)]]
    square = _product(cross, cross)
    return [[arb(int(i == j)) + s * cross[i][j] + (1 - c) * square[i][j] for j in range(3)] for i in range(3)]


def _of_quaternion(quaternion: Vector) -> list[Vector]:
    w, x, y, z = _unit(quaternion)
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def _joint(joint: Any, before: list[Vector], q: Vector) -> tuple[list[Vector], Vector, list[Vector], list[Vector]]:
    """The body's axes as columns, its shift, and of its velocities the angular and the linear part."""
    still, kind = [arb(0)] * 3, joint.kind
    if kind in ("revolute", "prismatic", "screw"):
        own = _unit(_numbers(joint.axis))
        axis = _times(before, own)
        turns, slides = arb(int(kind != "prismatic")), arb(1 if kind == "prismatic" else float(joint.pitch))
        axes = _product(before, _rotation(own, turns * q[0]))
        return axes, _scaled(slides * q[0], axis), [_scaled(turns, axis)], [_scaled(slides, axis)]
    axes = _product(before, _of_quaternion(q[-4:]))
    if kind == "ball":
        return axes, still, _transposed(axes), [still] * 3
    along = _transposed(before) if kind == "free" else _transposed(axes)
    return axes, _times(before, q[:3]), [still] * 3 + _transposed(axes), along + [still] * 3


def tree_in_digits(tree: Mechanism, q: Array, qd: Array, qdd: Array, tau: Array) -> dict[str, Array]:
    """M (n, n), bias, torques and accelerations (n,), with springs of axial joints and dampers, rounded at last."""
    before, ctx.prec = ctx.prec, DIGITS
    try:
        return _tree(tree, _numbers(q), _numbers(qd), _numbers(qdd), _numbers(tau))
    finally:
        ctx.prec = before


def _tree(tree: Mechanism, q: Vector, qd: Vector, qdd: Vector, tau: Vector) -> dict[str, Array]:
    n, still = len(qd), [arb(0)] * 3
    states: dict[str, Any] = {
        "world": (_matrix(np.eye(3)), still, still, still, _scaled(arb(-1), _numbers(tree.gravity)), [])
    }
    mass, bias, braking = [[arb(0)] * n for _ in range(n)], [arb(0)] * n, [arb(0)] * n
    for body, place in zip(tree.moving, places(tree.moving), strict=True):
        turn, w, v, alpha, a, columns = states[body.parent]
        x, u, first, joint = q[place.q], qd[place.u], place.u.start, body.joint
        axes, shift, angular, linear = _joint(joint, _product(turn, _matrix(joint.orientation)), x)
        r = _sum(_times(turn, _numbers(joint.position)), shift)
        spin, slide = (_sum(still, *map(_scaled, u, columns_)) for columns_ in (angular, linear))
        alpha, a = _sum(alpha, _cross(w, spin)), _sum(a, _cross(alpha, r), _cross(w, _sum(_cross(w, r), slide)))
        v = _sum(v, _cross(w, r), slide)
        w_after = _sum(w, spin)
        a = _sum(a, _cross(w_after if joint.kind == "free (body axes)" else w, slide))
        columns = [(i, s, _sum(t, _cross(s, r))) for i, s, t in columns]
        columns += [(first + k, s, t) for k, (s, t) in enumerate(zip(angular, linear, strict=True))]
        states[body.name] = axes, w_after, v, alpha, a, columns
        c, m = _times(axes, _numbers(body.center)), arb(float(body.mass))
        inertia = _product(_product(axes, _matrix(body.inertia)), _transposed(axes))
        force = _scaled(m, _sum(a, _cross(alpha, c), _cross(w_after, _cross(w_after, c))))
        torque = _sum(_times(inertia, alpha), _cross(w_after, _times(inertia, w_after)))
        moved = [(i, s, _sum(t, _cross(s, c))) for i, s, t in columns]
        for i, s, t in moved:
            bias[i] += _dot(t, force) + _dot(s, torque)
            for j, other, along in moved:
                mass[i][j] += m * _dot(t, along) + _dot(_times(inertia, s), other)
        for k in range(first, place.u.stop):
            mass[k][k] += arb(float(joint.armature))
            braking[k] = arb(float(joint.damping)) * qd[k]
        if joint.type.sprung and joint.kind != "ball":
            bias[first] += arb(float(joint.stiffness)) * (x[0] - arb(float(joint.spring_reference)))
    rhs = [[t - b - d] for t, b, d in zip(tau, bias, braking, strict=True)]
    solved = arb_mat(mass).solve(arb_mat(rhs))
    torques = _sum(_times(mass, qdd), bias, braking)
    rows = {"mass": mass, "bias": bias, "torques": torques, "accelerations": [solved[i, 0] for i in range(n)]}
    return {name: np.vectorize(lambda x: float(x.mid()), otypes=[float])(row) for name, row in rows.items()}
