"""Limits left: where a motion lies beyond the limits of its joints, at its rows or, by dense output, between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from cgraph._shared import Array

from .trajectory import Trajectory

Pair = tuple[float, float]
ROUNDING = 2.0**-40  # of a value or its limit: by less a polynomial through values of a step is not beyond
STEPS = 1024  # looked at together


def limits_left(run: Trajectory, limits: Mapping[str, Mapping[str, Pair]], units: Mapping[str, str]) -> list[str]:
    """A sentence on every limit of position or velocity that a motion has left: when first, and how far it went.

    A run with dense output is looked at throughout: a step is the polynomial of its dense output's degree through as
    many of its states. Of a run without, the rows are looked at.

    limits: {"position" or "velocity": {coordinate: (lower, upper)}}.  units: {coordinate: unit of its position}.
    """
    parts = {"position": (run.coordinates, 0, ""), "velocity": (run.velocities, len(run.coordinates), "/s")}
    watched = [
        _Watched(f"{what} of {name}", ends, units[name] + per, first + names.index(name))
        for what, (names, first, per) in parts.items()
        for name, ends in limits.get(what, {}).items()
    ]
    for t_old, t, states in _pieces(run):
        for each in watched:
            each.see(t_old, t, states[:, :, each.column])
    return [each.sentence for each in watched if each.most > 0.0]


def _pieces(run: Trajectory) -> Iterator[tuple[Array, Array, Array]]:
    """The motion in pieces: their begins and ends, (T,) each, and (q, qd), (T, k, m), at the `_nodes` of each."""
    if run.dense is None or not run.dense.steps:
        yield run.t, run.t, np.concatenate([run.q, run.qd], axis=1)[:, None]
        return
    for block in run.dense.steps:
        for first in range(0, len(block.t), STEPS):
            part = block.part(slice(first, first + STEPS))
            assert part.dense is not None
            yield part.t_old, part.t, run.dense.along(part, _nodes(part.dense.shape[1] + 1))


def _nodes(count: int) -> Array:
    """Shares of a step from 0 to 1, denser toward its ends; of one state there is one."""
    return 0.5 - 0.5 * np.cos(np.pi * np.arange(count) / max(1, count - 1))


@dataclass
class _Watched:
    """A column of the states, its limit, and how far beyond it the column has been so far.

    first: when it was beyond first [s].  most: how far, 0 for never; then it had the value `value`, at `at` [s].
    """

    what: str
    ends: Pair
    unit: str
    column: int
    first: float = math.nan
    most: float = 0.0
    value: float = math.nan
    at: float = math.nan

    @property
    def sentence(self) -> str:
        left = f"{self.what} leaves {self.ends[0]:.6g} to {self.ends[1]:.6g} {self.unit} at {self.first:.4g} s"
        return f"{left}, and is {self.value:.6g} {self.unit} at {self.at:.4g} s"

    def see(self, t_old: Array, t: Array, values: Array) -> None:
        """Look at pieces from t_old to t, (T,), with these values, (T, k), at their nodes.

        The control points of a polynomial say by how much it is beyond at most: only such pieces are looked at.
        """
        shares, degree = _nodes(values.shape[1]), values.shape[1] - 1
        k = np.arange(degree + 1)
        choose = np.array([math.comb(degree, each) for each in k])
        points = values @ np.linalg.inv(choose * shares[:, None] ** k * (1.0 - shares[:, None]) ** (degree - k)).T
        hull = np.nan_to_num(np.maximum(self.ends[0] - points.min(axis=1), points.max(axis=1) - self.ends[1]), nan=-1.0)
        rounding = ROUNDING * np.abs(values).max(axis=1) * (degree > 0)
        for row in np.flatnonzero(hull > rounding).tolist() if math.isnan(self.first) else ():
            beyond = self._beyond(values[row], float(rounding[row]))
            if beyond:
                self.first = float(t_old[row] + beyond[0][0] * (t[row] - t_old[row]))
                break
        for row in np.argsort(-hull).tolist():
            if not hull[row] > self.most + rounding[row]:
                break
            for share, value in self._beyond(values[row], float(rounding[row])):
                if (over := self._over(value)) > self.most:
                    self.most, self.value, self.at = over, value, float(t_old[row] + share * (t[row] - t_old[row]))

    def _over(self, value: float) -> float:
        return max(self.ends[0] - value, value - self.ends[1])

    def _beyond(self, values: Array, rounding: float) -> list[tuple[float, float]]:
        """Shares of a piece at which it is beyond, and values: where it begins to be, then its turns and its end."""
        shares = _nodes(len(values))
        polynomial = Polynomial(np.linalg.solve(shares[:, None] ** np.arange(len(values)), values))
        exact = dict(zip(shares.tolist(), values.tolist(), strict=True))
        looks = {share: float(polynomial(share)) for share in _real(polynomial.deriv())} | exact
        beyond = sorted((share, value) for share, value in looks.items() if self._over(value) > rounding)
        if beyond and beyond[0][0] > 0.0:
            meets = [share for end in self.ends if math.isfinite(end) for share in _real(polynomial - end)]
            begin = max([share for share in meets if share < beyond[0][0]], default=beyond[0][0])
            beyond.insert(0, (begin, float(polynomial(begin))))
        return beyond


def _real(polynomial: Polynomial) -> list[float]:
    """Its real zeros between 0 and 1."""
    zeros = np.asarray(polynomial.roots(), dtype=np.complex128).tolist()
    return [zero.real for zero in zeros if abs(zero.imag) <= 1e-9 and 0.0 < zero.real < 1.0]
