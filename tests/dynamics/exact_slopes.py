"""Derivatives of trees of bodies in 60 digits: Newton-Euler equations and their tangents, body by body, with no graph.

Motions are (angular, linear) in a body's axes, as in Featherstone's Rigid Body Dynamics Algorithms. A displacement xi
of a joint moves its body along the columns of D, so that X, from motions of the parent to those of the body, becomes
X - (D xi) x X. Numbers are python-flint's, which carry a bound on their rounding errors.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import dynamics as dyn
from dynamics.multibody.bodies.joint_coordinates import places
from dynamics.multiprecision.flint_numbers import flint, working

Array = np.ndarray[Any, np.dtype[np.float64]]
DIGITS = 60
A_BODY = 2  # digits more that its bounds of errors take
LOST = 1e-30  # a bound on the error of an entry, or there were too few digits


class Exact(NamedTuple):
    """Slopes of torques at a motion, and of accelerations at torques, (n, 3n): by q, qd, and qdd or tau.

    sides: what M times the latter is.
    """

    torques: Any
    accelerations: Any
    sides: Any


def exact_slopes(tree: dyn.Mechanism, q: Array, qd: Array, qdd: Array, tau: Array) -> Exact:
    """Of quasi-velocities by displacements."""
    mat, n = flint().arb_mat, len(qd)
    with working(DIGITS + A_BODY * len(tree.bodies)):
        u = mat(n, 1, _listed(qd))
        motion = _Sweep(tree, q, u, mat(n, 1, _listed(qdd)))
        still = _Sweep(tree, q, u, mat(n, 1))
        mass = mat([[still.slopes[i, j] for j in range(2 * n, 3 * n)] for i in range(n)])
        solved = mass.solve(mat(n, 1, _listed(tau)) - still.torques)
        slopes = _Sweep(tree, q, u, solved).slopes
        sides = mat(n, 3 * n)
        for i in range(n):
            for j in range(2 * n):
                sides[i, j] = -slopes[i, j]
            sides[i, 2 * n + i] = 1
        return Exact(motion.slopes, mass.solve(sides), sides)


class Slopes(NamedTuple):
    """As `Exact`, in float64."""

    torques: Array
    accelerations: Array


class Errors(NamedTuple):
    """The largest errors of slopes by q, qd, and qdd or tau, over the largest entry of these.

    conditioned: those of accelerations over the largest entry of |M^-1| (|M| |X| + |sides|), of the solution X of M X =
    sides. It is what a relative change of all numbers in M and in the sides may do to X.
    """

    torques: tuple[float, ...]
    accelerations: tuple[float, ...]
    conditioned: tuple[float, ...]

    def __str__(self) -> str:
        return "; ".join([" ".join([f"{error:.1e}" for error in each]) for each in self])


def errors(found: Slopes, exact: Exact) -> Errors:
    """Of slopes."""
    torques, accelerations, sides = (np.abs(floats(each)) for each in exact)
    n = len(sides)
    mass, inverse = torques[:, 2 * n :], accelerations[:, 2 * n :]
    conditioned = inverse @ (mass @ accelerations + sides)
    off = [difference(exact[k], found[k]) for k in range(2)]
    return Errors(_over(off[0], torques), _over(off[1], accelerations), _over(off[1], conditioned))


def difference(exact: Any, *parts: Array) -> Array:
    """The errors of numbers that are the sum of parts."""
    with working(2 * DIGITS):
        result = exact
        for part in parts:
            result = result - flint().arb_mat(part.tolist())
        return floats(result)


def floats(matrix: Any) -> Array:
    """The midpoints. Raises AssertionError where an entry was not known to twice the digits of float64."""
    entries = matrix.entries()
    assert max(float(each.rad()) for each in entries) < LOST
    return np.array([float(each.mid()) for each in entries]).reshape(matrix.nrows(), -1)


def _over(off: Array, sizes: Array) -> tuple[float, ...]:
    blocks = zip(np.hsplit(np.abs(off), 3), np.hsplit(sizes, 3), strict=True)
    return tuple([float(errors.max() / max(size.max(), 1e-300)) for errors, size in blocks])


class _Sweep:
    """tau, (n, 1), of a motion and its slopes by q, u and its rate, (n, 3n)."""

    def __init__(self, tree: dyn.Mechanism, q: Array, u: Any, rate: Any) -> None:
        self.mat, self.n = flint().arb_mat, u.nrows()
        moving = tree.moving
        self.places = {body.name: place for body, place in zip(moving, places(moving), strict=True)}
        self.q, self.u, self.rate = q, u, rate
        self.torques, self.slopes = self.mat(self.n, 1), self.mat(self.n, 3 * self.n)
        gravity = self.mat(6, 1, [0, 0, 0, *_listed(-np.asarray(tree.gravity, dtype=np.float64))])
        nothing = self.mat(6, 3 * self.n)
        motions = {"world": (self.mat(6, 1), nothing, gravity, nothing)}
        joints = {}
        order: list[dyn.Body] = []
        while len(order) < len(tree.bodies):
            order += [each for each in tree.bodies if each.parent in motions and each.name not in motions][:1]
            body = order[-1]
            joints[body.name] = joint = self._joint(body)
            motions[body.name] = self._moved(joint, *motions[body.parent])
        forces = {body.name: self._force(body, *motions[body.name]) for body in tree.bodies}
        for body in reversed(order):
            self._collect(body, joints[body.name], forces)
        damping = tree.system.damping
        for i in range(self.n):
            self.torques[i, 0] += float(damping[i]) * u[i, 0]
            self.slopes[i, self.n + i] += float(damping[i])

    def _joint(self, body: dyn.Body) -> dict[str, Any]:
        """How the joint places its body and moves it: X, and S, c and D of v = X v_p + S u, a = .. + S rate + c."""
        mat, joint = self.mat, body.joint
        turn, at = self.mat(np.asarray(joint.orientation, dtype=np.float64).tolist()), _listed(joint.position)
        at, kind = mat(3, 1, at), joint.kind
        rows = self.places[body.name].u if kind != "fixed" else slice(0, 0)
        k = rows.stop - rows.start
        S, c, moved = mat(6, k), mat(6, 1), mat(6, 6)
        u, rate = (mat(k, 1, [each[i, 0] for i in range(rows.start, rows.stop)]) for each in (self.u, self.rate))
        x = [flint().arb(each) for each in self.q[self.places[body.name].q].tolist()] if k else []
        inner, shift = mat(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]), mat(3, 1)
        if kind in ("revolute", "prismatic"):
            unit = np.asarray(joint.axis) / np.linalg.norm(joint.axis)
            for i, each in enumerate(unit.tolist()):
                S[i + 3 * (kind == "prismatic"), 0] = each
            axis = mat(3, 1, unit.tolist())
            if kind == "revolute":
                inner = inner + _skew(axis) * x[0].sin() + _skew(axis) * _skew(axis) * (1 - x[0].cos())
            else:
                shift = axis * x[0]
        elif k:
            inner, first = _rotation(x[-4:]), k - 3
            for i in range(3):
                S[i, first + i] = 1
        if kind.startswith("free"):
            shift = mat(3, 1, x[:3])
            linear = inner.transpose() if kind == "free" else mat(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1])
            _put(S, 3, 0, linear)
            if kind == "free":  # its columns turn with the body: c = S_dot u, and what displacements change
                v, a = linear * _part(u, 0, 3), linear * _part(rate, 0, 3)
                omega = _part(u, 3, 6)
                _put(c, 3, 0, -(_skew(omega) * v))
                moved = (v, a, omega, linear)
        turn, at = turn * inner, at + turn * shift
        X = mat(6, 6)
        _put(X, 0, 0, turn.transpose())
        _put(X, 3, 3, turn.transpose())
        _put(X, 3, 0, -(turn.transpose() * _skew(at)))
        return {"X": X, "S": S, "c": c, "u": u, "rate": rate, "rows": rows, "q": x, "turning": moved, "kind": kind}

    def _moved(self, joint: dict[str, Any], v: Any, dv: Any, a: Any, da: Any) -> tuple[Any, Any, Any, Any]:
        """Twist, acceleration, and their tangents, of a body on one that has these."""
        X, S, n, start = joint["X"], joint["S"], self.n, joint["rows"].start
        carried, own = X * v, S * joint["u"]
        dv, carried_a, da = X * dv, X * a, X * da
        _add(dv, 0, start, _crm(carried) * S)
        _add(dv, 0, n + start, S)
        _add(da, 0, start, _crm(carried_a) * S)
        _add(da, 0, 2 * n + start, S)
        v = carried + own
        if joint["kind"] == "free":
            turned_v, turned_a, omega, linear = joint["turning"]
            lost = self.mat(6, 3)
            _put(lost, 3, 0, _skew(turned_v))  # d(S u)
            _add(dv, 0, start + 3, lost)
            _add(da, 0, start + 3, _crm(v) * lost)
            _add(da, 3, start + 3, _skew(turned_a) - _skew(omega) * _skew(turned_v))
            _add(da, 3, n + start, -(_skew(omega) * linear))
            _add(da, 3, n + start + 3, _skew(turned_v))
        a = carried_a + S * joint["rate"] + _crm(v) * own + joint["c"]
        da = da - _crm(own) * dv
        _add(da, 0, n + start, _crm(v) * S)
        return v, dv, a, da

    def _force(self, body: dyn.Body, v: Any, dv: Any, a: Any, da: Any) -> tuple[Any, Any]:
        """The wrench that the body's motion takes, and its tangent."""
        inertia = _spatial_inertia(body)
        momentum, crf = inertia * v, -_crm(v).transpose()
        return inertia * a + crf * momentum, inertia * da + crf * (inertia * dv) + _wrench_by_motion(momentum) * dv

    def _collect(self, body: dyn.Body, joint: dict[str, Any], forces: dict[str, tuple[Any, Any]]) -> None:
        """The joint's torques of the wrench of all that it carries, and that wrench to the parent."""
        (f, df), X, S, start = forces[body.name], joint["X"], joint["S"], joint["rows"].start
        tau, slopes = S.transpose() * f, S.transpose() * df
        if joint["kind"] == "free":
            _add(slopes, 0, start + 3, -(joint["turning"][3].transpose() * _skew(_part(f, 3, 6))))
        for i in range(S.ncols()):
            slopes[i, 2 * self.n + start + i] += float(body.joint.armature)
            tau[i, 0] += float(body.joint.armature) * joint["rate"][i, 0]
        self._spring(body, joint, tau, slopes)
        _add(self.torques, start, 0, tau)
        _add(self.slopes, start, 0, slopes)
        if body.parent == "world":
            return
        df = X.transpose() * df
        _add(df, 0, start, X.transpose() * (-_crm_by_wrench(f) * S))
        above = forces[body.parent]
        forces[body.parent] = above[0] + X.transpose() * f, above[1] + df

    def _spring(self, body: dyn.Body, joint: dict[str, Any], tau: Any, slopes: Any) -> None:
        stiffness, start = float(body.joint.stiffness), joint["rows"].start
        if not stiffness or joint["kind"] == "fixed":
            return
        if joint["kind"] != "ball":
            tau[0, 0] += stiffness * (joint["q"][0] - float(body.joint.spring_reference))
            slopes[0, start] += stiffness
            return
        w, *v = joint["q"]
        length = sum([each * each for each in v], flint().arb(0)).sqrt()
        assert w > 0, "a rotation vector of more than half a turn"
        angle = 2 * (length / w).atan()
        theta = _skew(self.mat(3, 1, v)) * (angle / length)
        bent = 1 / angle**2 - (1 + angle.cos()) / (2 * angle * angle.sin())
        identity = self.mat(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1])
        _add(tau, 0, 0, self.mat(3, 1, v) * (angle / length) * stiffness)
        _add(slopes, 0, start, (identity + theta / 2 + theta * theta * bent) * stiffness)


def _listed(values: Any) -> list[float]:
    return [float(each) for each in values]


def _rotation(e: list[Any]) -> Any:
    """1 + 2 / |e|^2 (w [v]x + [v]x [v]x)."""
    mat = flint().arb_mat
    v = _skew(mat(3, 1, e[1:]))
    return mat(3, 3, [1, 0, 0, 0, 1, 0, 0, 0, 1]) + (v * e[0] + v * v) * (2 / sum(x * x for x in e))


def _spatial_inertia(body: dyn.Body) -> Any:
    """About the body's origin: [[J - m [c][c], m [c]], [-m [c], m 1]]."""
    given = np.asarray(body.inertia, dtype=np.float64)
    J = flint().arb_mat((np.diag(given) if given.ndim == 1 else given).tolist())
    c, mass, result = _skew(flint().arb_mat(3, 1, _listed(body.center))), float(body.mass), flint().arb_mat(6, 6)
    _put(result, 0, 0, J - c * c * mass)
    _put(result, 0, 3, c * mass)
    _put(result, 3, 0, -(c * mass))
    for i in range(3):
        result[3 + i, 3 + i] = mass
    return result


def _skew(a: Any) -> Any:
    return flint().arb_mat(3, 3, [0, -a[2, 0], a[1, 0], a[2, 0], 0, -a[0, 0], -a[1, 0], a[0, 0], 0])


def _crm(v: Any) -> Any:
    """v x of motions."""
    result = flint().arb_mat(6, 6)
    turning = _skew(_part(v, 0, 3))
    _put(result, 0, 0, turning)
    _put(result, 3, 3, turning)
    _put(result, 3, 0, _skew(_part(v, 3, 6)))
    return result


def _wrench_by_motion(h: Any) -> Any:
    """The matrix of v x* h as a function of v."""
    result = flint().arb_mat(6, 6)
    moment, force = -_skew(_part(h, 0, 3)), -_skew(_part(h, 3, 6))
    _put(result, 0, 0, moment)
    _put(result, 0, 3, force)
    _put(result, 3, 0, force)
    return result


def _crm_by_wrench(f: Any) -> Any:
    """Minus the same: X^T f becomes X^T (f + (D xi) x* f)."""
    return -_wrench_by_motion(f)


def _part(a: Any, begin: int, end: int) -> Any:
    return flint().arb_mat(end - begin, 1, [a[i, 0] for i in range(begin, end)])


def _put(a: Any, row: int, column: int, block: Any) -> None:
    for i in range(block.nrows()):
        for j in range(block.ncols()):
            a[row + i, column + j] = block[i, j]


def _add(a: Any, row: int, column: int, block: Any) -> None:
    for i in range(block.nrows()):
        for j in range(block.ncols()):
            a[row + i, column + j] += block[i, j]
