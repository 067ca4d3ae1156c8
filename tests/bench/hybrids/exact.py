"""Motions that are linear between switching surfaces, to 40 digits: series in decimal numbers, slopes by a nudge."""

from __future__ import annotations

import decimal
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np

from cgraph._shared import Array

decimal.getcontext().prec = 50
NUDGE, SMALL = Decimal("1e-20"), Decimal("1e-32")  # how far inputs are moved; what is zero on a surface
POOR = (
    1e-3  # a slope of a crossing, a gap to a surface that is not crossed, or to the end, that is too small to judge by
)
MOST = 300  # crossings
Numbers = Mapping[str, Decimal]


class PoorDrawError(Exception):
    """A motion that grazes a surface, or is on the verge between two answers: a small error changes it much."""


class Exact(NamedTuple):
    """x' = rate(x, t, p, s), affine in (x, t) and in the signs s of surfaces(x, t, p); at 0 a state is reset.

    On a surface the signs are those of a solution in Filippov's sense: between -1 and 1, where it slides.
    resets: (quantity(x, t, p), which falls through 0, reset(x, t, p) -> x), both affine.
    """

    rate: Callable[..., Sequence[Any]]
    surfaces: Callable[..., Sequence[Any]] = lambda x, t, p: []
    resets: Sequence[tuple[Callable[..., Any], Callable[..., Sequence[Any]]]] = ()


class Ended(NamedTuple):
    """State at the end, the largest of each on the way, and the times of crossings."""

    x: Array
    sizes: Array
    times: list[float]


def slopes(exact: Exact, x: Sequence[float], numbers: Mapping[str, float], t_end: float) -> tuple[Ended, Array]:
    """The motion, and the slopes of its end by the start and by ln of each number, (states, inputs)."""
    start, p = [Decimal(each) for each in x], {name: Decimal(each) for name, each in numbers.items()}
    end = motion(exact, start, p, t_end)
    starts = [[each + NUDGE * (i == j) for i, each in enumerate(start)] for j in range(len(start))]
    moved = [(nudged, p) for nudged in starts]
    moved += [(start, {**p, name: p[name] * (1 + NUDGE)}) for name in p]
    return end, np.array([(motion(exact, *each, t_end).x - end.x) / NUDGE for each in moved], float).T


def motion(exact: Exact, x: Sequence[Decimal], p: Numbers, t_end: float) -> Ended:
    """The motion from x at t = 0; y = (x, t, 1) is the state, so that all is linear in it."""
    return _Motion(exact, x, p, Decimal(t_end)).ended()


class _Motion:
    def __init__(self, exact: Exact, x: Sequence[Decimal], p: Numbers, t_end: Decimal) -> None:
        self.n, self.t_end = len(x), t_end
        self.y = np.array([*x, Decimal(0), Decimal(1)])
        self.surfaces = self._matrix(lambda x, t: exact.surfaces(x, t, p))
        m = len(self.surfaces)
        none = np.full(m, Decimal(0))

        def rate(s: Array) -> Array:
            return self._matrix(lambda x, t: [*exact.rate(x, t, p, s), Decimal(1), Decimal(0)])

        self.free = rate(none)
        self.parts = [rate(none + np.eye(m, dtype=int)[j]) - self.free for j in range(m)]
        self.falls = [self._matrix(lambda x, t, g=g: [g(x, t, p)]) for g, _ in exact.resets]
        self.resets = [self._matrix(lambda x, t, r=r: [*r(x, t, p), t, Decimal(1)]) for _, r in exact.resets]
        self.signs = [(value > 0) - (value < 0) for value in self.surfaces @ self.y] if m else []
        self.sizes, self.times = np.zeros(self.n), list[float]()

    def _matrix(self, f: Callable[..., Sequence[Any]]) -> Array:
        zero, one = Decimal(0), Decimal(1)
        at_zero = np.array(f([zero] * self.n, zero), dtype=object).reshape(-1)
        columns = []
        for j in range(self.n + 1):
            y = [one if i == j else zero for i in range(self.n + 1)]
            columns.append(np.array(f(y[:-1], y[-1]), dtype=object).reshape(-1) - at_zero)
        return np.stack([*columns, at_zero], axis=1) * one

    def ended(self) -> Ended:
        self._decide(-1)
        for _ in range(MOST):
            matrix, shares = self._flow(self.signs)
            sliding = [j for j, sign in enumerate(self.signs) if sign == 0]
            # Rows of quantities that are positive until the mode ends, and which surface or reset each is of.
            rows = [(sign * self.surfaces[j], j, None) for j, sign in enumerate(self.signs) if sign]
            for j, share in zip(sliding, shares, strict=True):
                rows += [(self._one() + way * share, j, None) for way in (1, -1)]
            rows += [(row[0], -1, k) for k, row in enumerate(self.falls)]
            found = self._first(matrix, rows)
            if found is None:
                return Ended(self.y[: self.n], self.sizes, self.times)
            _, which, reset = rows[found]
            self.times.append(float(self.y[self.n]))
            if self.t_end - self.y[self.n] < Decimal(POOR) * self.t_end:
                raise PoorDrawError
            if reset is not None:
                self.y = self.resets[reset] @ self.y
                values = self.surfaces @ self.y if len(self.signs) else []
                self.signs = [(value > 0) - (value < 0) for value in values]
            self._decide(which)
        raise PoorDrawError

    def _one(self) -> Array:
        return np.array([Decimal(0)] * (self.n + 1) + [Decimal(1)])

    def _flow(self, signs: Sequence[int]) -> tuple[Array, Array]:
        """The rate's matrix with these signs; where they are 0, the shares that hold the state on the surface."""
        matrix = sum([sign * part for sign, part in zip(signs, self.parts, strict=True) if sign], self.free)
        held = [j for j, sign in enumerate(signs) if sign == 0]
        if not held:
            return matrix, np.zeros((0, self.n + 2))
        effects = np.stack([self.parts[j][:, -1] for j in held], axis=1)
        shares = solve(self.surfaces[held] @ effects, -(self.surfaces[held] @ matrix))
        return matrix + effects @ shares, shares

    def _decide(self, crossed: int) -> None:
        """Set the signs of the surfaces on which the state is."""
        near = [
            j
            for j, row in enumerate(self.surfaces)
            if j == crossed or abs(row @ self.y) <= SMALL * (np.abs(row) @ np.abs(self.y))
        ]
        if not near:
            return
        if len(near) <= 4:
            trials = [dict(zip(near, signs, strict=True)) for signs in itertools.product((0, 1, -1), repeat=len(near))]
            for trial in trials:
                signs = [trial.get(j, sign) for j, sign in enumerate(self.signs)]
                if self._wrong(signs, near) == {}:
                    self.signs = signs
                    return
            raise PoorDrawError
        signs = [0 if j in near else sign for j, sign in enumerate(self.signs)]
        for _ in range(MOST):  # pivots, for many surfaces
            wrong = self._wrong(signs, near)
            if wrong == {}:
                self.signs = signs
                return
            signs = [wrong.get(j, sign) for j, sign in enumerate(signs)]
        raise PoorDrawError

    def _wrong(self, signs: Sequence[int], near: Sequence[int]) -> dict[int, int]:
        """{surface: sign that it should rather have} of those whose sign does not fit the motion that it makes."""
        try:
            matrix, shares = self._flow(signs)
        except ZeroDivisionError:
            return {near[0]: 1}
        wrong, rate = {}, matrix @ self.y
        second = matrix @ rate
        held = [j for j, sign in enumerate(signs) if sign == 0]
        for j, share in zip(held, shares, strict=True):
            value = share @ self.y
            side = 1 if value > 0 else -1
            if abs(abs(value) - 1) < SMALL:
                if side * (share @ rate) >= 0:
                    wrong[j] = side
            elif abs(value) > 1:
                wrong[j] = side
            elif abs(value) > 1 - POOR:
                raise PoorDrawError
        for j in near:
            if signs[j]:
                row = self.surfaces[j]
                scale = SMALL * (np.abs(row) @ np.abs(self.y) + 1)
                away = next((signs[j] * each for each in (row @ rate, row @ second) if abs(each) > scale), Decimal(-1))
                if away < 0:
                    wrong[j] = 0
        return wrong

    def _first(self, matrix: Array, rows: Sequence[tuple[Array, int, Any]]) -> int | None:
        """Go to the first row that falls through zero, and give its number; to the end, if there is none."""
        left, flat = self.t_end - self.y[self.n], matrix.astype(float)
        fastest = max(np.abs(flat[: self.n, : self.n]).sum(axis=1).max(), 1e-9)
        count = math.ceil(max(64.0, float(left) * fastest / 0.05))
        step = left / count
        one, path = _exponential(flat * float(step)), [self.y.astype(float)]
        for _ in range(count):
            path.append(one @ path[-1])
        states = np.array(path)
        values = states @ np.array([row for row, *_ in rows], float).reshape(len(rows), -1).T
        below = np.argwhere(values[1:] < 0.0)
        stop = int(below[0, 0]) + 1 if len(below) else count
        self.sizes = np.maximum(self.sizes, np.abs(states[: stop + (not len(below)), : self.n]).max(axis=0))
        seen = values[: stop + 1]
        dips = (seen[1:-1] < seen[:-2]) & (seen[1:-1] <= seen[2:]) & (seen[1:-1] < POOR * np.abs(seen).max(axis=0))
        if dips[2:].any():
            raise PoorDrawError
        if not len(below):
            self.y = series(matrix, self.y, left)
            return None
        before = series(matrix, self.y, step * (stop - 1))
        roots = {}
        for j in np.flatnonzero(values[stop] < 0.0):
            row = rows[j][0]
            if stop == 1 and abs(row @ before) <= SMALL * (np.abs(row) @ np.abs(before)):
                raise PoorDrawError  # it left and is back within a step
            roots[int(j)] = self._root(matrix, before, row, step)
        found = min(roots, key=roots.__getitem__)
        self.y = series(matrix, before, roots[found])
        if abs(float(rows[found][0] @ matrix @ self.y)) * float(self.t_end) < POOR * np.abs(seen[:, found]).max():
            raise PoorDrawError
        return found

    def _root(self, matrix: Array, y: Array, row: Array, step: Decimal) -> Decimal:
        low, high, time = Decimal(0), step, step / 2
        for _ in range(200):
            at = series(matrix, y, time)
            value, slope = row @ at, row @ matrix @ at
            best = time - value / slope if slope else low
            if abs(best - time) <= Decimal("1e-24") * step:
                return best  # to twice as many digits
            low, high = (time, high) if value > 0 else (low, time)
            time = best if low < best < high else (low + high) / 2
        raise PoorDrawError


def _exponential(matrix: Array) -> Array:
    """exp of a matrix of small rates, in which the time and 1 may have large effects."""
    term = total = np.eye(len(matrix))
    for k in range(1, 16):
        term = term @ matrix / k
        total = total + term
    return total


def series(matrix: Array, y: Array, time: Decimal) -> Array:
    """exp(matrix time) y."""
    parts = math.ceil(float(np.abs(matrix[:-1, :-1]).sum(axis=1).max()) * abs(float(time)) / 2.0) or 1
    rows = [[(j, value) for j, value in enumerate(row) if value] for row in matrix * (time / parts)]
    for _ in range(parts):
        term = total = list(y)
        for k in range(1, 200):
            term = [sum([value * term[j] for j, value in row], Decimal(0)) / k for row in rows]
            total = [a + b for a, b in zip(total, term, strict=True)]
            if all(abs(a) <= abs(b) * Decimal("1e-52") for a, b in zip(term, total, strict=True)):
                break
        y = np.array(total)
    return y


def solve(a: Array, b: Array) -> Array:
    """The solution of a x = b, of decimal numbers, by elimination with pivots."""
    a, b = a.copy(), b.copy()
    for k in range(len(a)):
        pivot = k + int(np.argmax(np.abs(a[k:, k])))
        a[[k, pivot]], b[[k, pivot]] = a[[pivot, k]], b[[pivot, k]]
        if not a[k, k]:
            raise ZeroDivisionError
        for i in [i for i in range(len(a)) if i != k and a[i, k]]:
            factor = a[i, k] / a[k, k]
            a[i], b[i] = a[i] - factor * a[k], b[i] - factor * b[k]
    return b / a.diagonal()[:, None]
