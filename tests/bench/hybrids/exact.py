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
POOR = 1e-3  # slopes of crossings, gaps to surfaces that are not crossed and to the end are not smaller
MOST, TOGETHER = 300, 4  # crossings, and surfaces on which a state is that are decided together


class PoorDrawError(Exception):
    """A motion that grazes a surface, or is on the verge between two answers: a small error changes it much."""


class Exact(NamedTuple):
    """x' = rate(x, t, p, s), affine in (x, t) and in the signs s of surfaces(x, t, p).

    On a surface signs are those of a solution in Filippov's sense, between -1 and 1 where it slides.
    reset(x, t, p) -> x is where x0 falls through 0; None for none.
    """

    rate: Callable[..., Sequence[Any]]
    surfaces: Callable[..., Sequence[Any]]
    reset: Callable[..., Sequence[Any]] | None = None


def solution(
    exact: Exact, x: Sequence[float], numbers: Mapping[str, float], t_end: float, slopes: bool
) -> tuple[Array, Array, Array | None]:
    """The end, sizes on the way and, if asked for, slopes of the end by the start and by ln of each number, a column each."""
    start, p = [Decimal(each) for each in x], {name: Decimal(each) for name, each in numbers.items()}
    motion = Motion(exact, start, p, Decimal(t_end))
    if not slopes:
        return motion.x.astype(float), motion.sizes, None
    moved = [([each + NUDGE * (i == j) for i, each in enumerate(start)], p) for j in range(len(start))]
    moved += [(start, {**p, name: p[name] * (1 + NUDGE)}) for name in p]
    ends = [Motion(exact, *each, Decimal(t_end)).x for each in moved]
    return motion.x.astype(float), motion.sizes, np.array([(end - motion.x) / NUDGE for end in ends], float).T


class Motion:
    """The motion from x at t = 0, of y = (x, t, 1), in which all is linear."""

    def __init__(self, exact: Exact, x: Sequence[Decimal], p: Mapping[str, Decimal], t_end: Decimal) -> None:
        self.n, self.t_end, self.sizes = len(x), t_end, np.zeros(len(x))
        self.y = np.array([*x, Decimal(0), Decimal(1)])
        self.surfaces = self._matrix(lambda x, t: exact.surfaces(x, t, p))
        none, one = np.full(len(self.surfaces), Decimal(0)), Decimal(1)
        rates = [
            self._matrix(lambda x, t, s=s: [*exact.rate(x, t, p, s), one, 0 * one])
            for s in (none, *none + np.eye(len(none), dtype=int))
        ]
        self.signs = [1] * len(none)
        self.free, self.parts = rates[0], [rate - rates[0] for rate in rates[1:]]
        reset = exact.reset
        self.reset = reset and self._matrix(lambda x, t: [*reset(x, t, p), t, one])
        for _ in range(MOST):
            self._decide()
            if not self._go_on():
                self.x = self.y[: self.n]
                return
        raise PoorDrawError

    def _matrix(self, f: Callable[..., Sequence[Any]]) -> Array:
        points = [*np.eye(self.n + 1, dtype=int) * Decimal(1), np.full(self.n + 1, Decimal(0))]
        values = [np.array(f(point[:-1], point[-1]), dtype=object) for point in points]
        return np.stack([*[value - values[-1] for value in values[:-1]], values[-1]], axis=-1) * Decimal(1)

    def _flow(self, signs: Sequence[int]) -> tuple[Array, dict[int, Array]]:
        """The rate's matrix with these signs; and where they are 0, what signs hold the state there, as rows."""
        matrix = sum([sign * part for sign, part in zip(signs, self.parts, strict=True) if sign], self.free)
        held = [j for j, sign in enumerate(signs) if sign == 0]
        if not held:
            return matrix, {}
        if max([np.abs(self.parts[j][:, :-1]).max() for j in held]) > SMALL:
            raise ZeroDivisionError  # the rate has a kink there, and no jump
        effects = np.stack([self.parts[j][:, -1] for j in held], axis=1)
        shares = solve(self.surfaces[held] @ effects, -(self.surfaces[held] @ matrix))
        return matrix + effects @ shares, dict(zip(held, shares, strict=True))

    def _decide(self) -> None:
        """Set the signs of all surfaces; of those on which the state is, those of a motion to which they fit."""
        values, scale = self.surfaces @ self.y, 1 + np.abs(self.surfaces) @ np.abs(self.y)
        near = [j for j, value in enumerate(values) if abs(value) <= SMALL * scale[j]]
        signs = [0 if j in near else 1 if value > 0 else -1 for j, value in enumerate(values)]
        open_ = near if len(near) <= TOGETHER else [j for j in near if self.signs[j]]
        for chosen in itertools.product((0, 1, -1), repeat=len(open_)):
            self.signs = [dict(zip(open_, chosen, strict=True)).get(j, sign) for j, sign in enumerate(signs)]
            if self._fits(near):
                return
        raise PoorDrawError

    def _fits(self, near: Sequence[int]) -> bool:
        try:
            matrix, shares = self._flow(self.signs)
        except ZeroDivisionError:
            return False
        rate = matrix @ self.y
        for share in shares.values():
            value = share @ self.y
            if POOR > abs(abs(value) - 1) > SMALL:
                raise PoorDrawError
            if abs(value) > 1 or (abs(value) > 1 - SMALL and value * (share @ rate) >= 0):
                return False
        for j in near:
            if self.signs[j]:
                slopes, scale = (
                    (self.surfaces[j] @ rate, self.surfaces[j] @ matrix @ rate),
                    SMALL * (1 + max(np.abs(rate))),
                )
                if next((self.signs[j] * each for each in slopes if abs(each) > scale), Decimal(-1)) < 0:
                    return False
        return True

    def _go_on(self) -> bool:
        """Go to where a sign changes or the state is reset, or to the end; whether it is a change."""
        matrix, shares = self._flow(self.signs)
        unit = np.eye(self.n + 2, dtype=int) * Decimal(1)
        rows = [sign * self.surfaces[j] for j, sign in enumerate(self.signs) if sign]  # positive until then
        rows += [unit[-1] + way * share for share in shares.values() for way in (1, -1)]
        rows += [unit[0]] * (self.reset is not None)
        left, flat = self.t_end - self.y[self.n], matrix.astype(float)
        fastest = np.abs(flat[: self.n, : self.n]).sum(axis=1).max()
        count = math.ceil(max(64.0, float(left) * fastest / 0.05))
        step, states = left / count, [self.y.astype(float)]
        one = sum([np.linalg.matrix_power(flat * float(step), k) / math.factorial(k) for k in range(16)])
        for _ in range(count):
            states.append(one @ states[-1])
        values = np.array(states) @ np.array(rows, float).reshape(len(rows), -1).T
        below = np.argwhere(values[1:] < 0.0)
        stop = int(below[0, 0]) + 1 if len(below) else count
        self.sizes = np.maximum(self.sizes, np.abs(states[:stop])[:, : self.n].max(axis=0))
        seen, largest = values[: stop + 1], np.abs(values[: stop + 1]).max(axis=0)
        dips = (seen[1:-1] < seen[:-2]) & (seen[1:-1] <= seen[2:]) & (seen[1:-1] < POOR * largest)
        if dips[2:].any():
            raise PoorDrawError
        if not len(below):
            self.y = series(matrix, self.y, left)
            return False
        start = max(stop - 2, 0)  # where it is surely positive
        before = series(matrix, self.y, step * start)
        roots = {
            self._root(matrix, before, rows[j], step * (stop - start)): j for j in np.flatnonzero(values[stop] < 0.0)
        }
        self.y = series(matrix, before, min(roots))
        found = roots[min(roots)]
        steep = abs(float(rows[found] @ matrix @ self.y)) * float(self.t_end) > POOR * largest[found]
        if not steep or self.t_end - self.y[self.n] < Decimal(POOR) * self.t_end:
            raise PoorDrawError
        if self.reset is not None and found == len(rows) - 1:
            self.y = self.reset @ self.y
        return True

    def _root(self, matrix: Array, y: Array, row: Array, step: Decimal) -> Decimal:
        """When a row falls through 0 within a step, by Newton's method between bounds."""
        if abs(row @ y) <= SMALL * (1 + np.abs(row) @ np.abs(y)):
            raise PoorDrawError  # it has left and is back
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
