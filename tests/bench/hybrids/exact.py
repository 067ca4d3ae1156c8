"""Motions that are linear between switching surfaces, to rounding: series in short steps, slopes by differences."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from cgraph._shared import Array

NUDGE, SMALL = 1e-5, 1e-11  # how far inputs are moved; what is zero on a surface
POOR = 1e-3  # slopes of crossings, gaps to surfaces that are not crossed and to the end are not smaller
MOST, TOGETHER = 300, 4  # crossings, and surfaces on which a state is that are decided together
TERMS = 16  # of the series of a step


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
    exact: Exact, x: Array, numbers: Mapping[str, float], t_end: float, slopes: bool
) -> tuple[Array, Array, Array | None]:
    """The end, sizes on the way and, if asked for, slopes of the end by the start and by ln of each number, a column each."""
    values = np.array([*numbers.values()])

    def moved(by: Array) -> Motion:
        p = dict(zip(numbers, (values * (1.0 + by[len(x) :])).tolist(), strict=True))
        return Motion(exact, x + by[: len(x)], p, t_end)

    units, motion = NUDGE * np.eye(len(x) + len(values)), moved(np.zeros(len(x) + len(values)))
    columns = [(moved(unit).x - moved(-unit).x) / (2.0 * NUDGE) for unit in units if slopes]
    return motion.x, motion.sizes, np.array(columns).T if slopes else None


class Motion:
    """The motion from x at t = 0, of y = (x, t, 1), in which all is linear."""

    def __init__(self, exact: Exact, x: Array, p: Mapping[str, float], t_end: float) -> None:
        self.n, self.t_end, self.sizes = len(x), t_end, np.zeros(len(x))
        self.y = np.array([*x, 0.0, 1.0])
        self.surfaces = self._matrix(lambda x, t: exact.surfaces(x, t, p))
        self.signs, reset = [0] * len(self.surfaces), exact.reset
        choices = np.vstack([self.signs, np.eye(len(self.signs))])
        rates = [self._matrix(lambda x, t, s=s: [*exact.rate(x, t, p, s), 1.0, 0.0]) for s in choices]
        self.free, self.parts = rates[0], [rate - rates[0] for rate in rates[1:]]
        self.reset = reset and self._matrix(lambda x, t: [*reset(x, t, p), t, 1.0])
        for _ in range(MOST):
            self._decide()
            if not self._go_on():
                self.x = self.y[: self.n]
                return
        raise PoorDrawError

    def _matrix(self, f: Callable[..., Sequence[Any]]) -> Array:
        *values, constant = [np.array(f(at[:-1], at[-1]), float) for at in np.eye(self.n + 2)[:, :-1]]
        return np.stack([*[value - constant for value in values], constant], axis=-1)

    def _flow(self, signs: Sequence[int]) -> tuple[Array, dict[int, Array]]:
        """The rate's matrix with these signs; and where they are 0, what signs hold the state there, as rows."""
        matrix = sum([sign * part for sign, part in zip(signs, self.parts, strict=True)], self.free)
        held = [j for j, sign in enumerate(signs) if sign == 0]
        if not held:
            return matrix, {}
        if max([np.abs(self.parts[j][:, :-1]).max() for j in held]) > SMALL:
            raise np.linalg.LinAlgError  # the rate has a kink there, and no jump
        effects = np.stack([self.parts[j][:, -1] for j in held], axis=1)
        shares = np.linalg.solve(self.surfaces[held] @ effects, -(self.surfaces[held] @ matrix))
        return matrix + effects @ shares, dict(zip(held, shares, strict=True))

    def _decide(self) -> None:
        """Set the signs of all surfaces; of those on which the state is, those of a motion to which they fit."""
        values, scale = self.surfaces @ self.y, 1.0 + np.abs(self.surfaces) @ np.abs(self.y)
        near = np.flatnonzero(np.abs(values) <= SMALL * scale).tolist()
        signs = [0 if j in near else 1 if value > 0.0 else -1 for j, value in enumerate(values)]
        open_ = near if len(near) <= TOGETHER else [j for j in near if self.signs[j]]
        for chosen in itertools.product((0, 1, -1), repeat=len(open_)):
            self.signs = [dict(zip(open_, chosen, strict=True)).get(j, sign) for j, sign in enumerate(signs)]
            if self._fits(near):
                return
        raise PoorDrawError

    def _fits(self, near: Sequence[int]) -> bool:
        try:
            matrix, shares = self._flow(self.signs)
        except np.linalg.LinAlgError:
            return False
        rate = matrix @ self.y
        for share in shares.values():
            value = share @ self.y
            if POOR > abs(abs(value) - 1.0) > SMALL:
                raise PoorDrawError
            if abs(value) > 1.0 + SMALL or (abs(value) > 1.0 - SMALL and value * (share @ rate) >= 0.0):
                return False
        for j in near:
            slopes, scale = self.surfaces[j] @ np.array([rate, matrix @ rate]).T, SMALL * (1.0 + max(np.abs(rate)))
            if self.signs[j] and next((self.signs[j] * each for each in slopes if abs(each) > scale), -1.0) < 0.0:
                return False
        return True

    def _go_on(self) -> bool:
        """Go to where a sign changes or the state is reset, or to the end; whether it is a change."""
        matrix, shares = self._flow(self.signs)
        unit = np.eye(self.n + 2)
        rows = [sign * self.surfaces[j] for j, sign in enumerate(self.signs) if sign]  # positive until then
        rows += [unit[-1] + way * share for share in shares.values() for way in (1.0, -1.0)]
        rows += [unit[0]] * (self.reset is not None)
        left = self.t_end - self.y[self.n]
        count = math.ceil(max(64.0, left * np.abs(matrix[: self.n, : self.n]).sum(axis=1).max() / 0.05))
        step, states = left / count, [self.y]
        one = sum([np.linalg.matrix_power(matrix * step, k) / math.factorial(k) for k in range(TERMS)])
        for _ in range(count):
            states.append(one @ states[-1])
        values = np.array(states) @ np.array(rows).reshape(len(rows), -1).T
        below = np.argwhere(values[1:] < 0.0)
        stop = int(below[0, 0]) + 1 if len(below) else count
        self.sizes = np.maximum(self.sizes, np.abs(states[:stop])[:, : self.n].max(axis=0))
        seen, largest = values[: stop + 1], np.abs(values[: stop + 1]).max(axis=0)
        dips = (seen[1:-1] < seen[:-2]) & (seen[1:-1] <= seen[2:]) & (seen[1:-1] < POOR * largest)
        if dips[2:].any():
            raise PoorDrawError
        if not len(below):
            self.y = states[-1]
            return False
        start = max(stop - 2, 0)  # where it is surely positive, or it has left and is back
        before, passed = states[start], np.flatnonzero(values[stop] < 0.0)
        if (np.abs(values[start]) <= SMALL * (1.0 + np.abs(rows) @ np.abs(before)))[passed].any():
            raise PoorDrawError
        terms = [before]
        for k in range(1, TERMS):
            terms.append(matrix @ terms[-1] * (2.0 * step / k))
        series, options = np.array(terms[::-1]), {"xtol": 1e-300, "rtol": 1e-15}  # in shares of two steps
        share = (stop - start) / 2.0
        time, found = min([(brentq(partial(np.polyval, series @ rows[j]), 0.0, share, **options), j) for j in passed])
        self.y = np.array([np.polyval(each, time) for each in series.T])
        steep = abs(rows[found] @ matrix @ self.y) * self.t_end > POOR * largest[found]
        if not steep or self.t_end - self.y[self.n] < POOR * self.t_end:
            raise PoorDrawError
        if self.reset is not None and found == len(rows) - 1:
            self.y = self.reset @ self.y
        return True
