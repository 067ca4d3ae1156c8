"""Dense output: consecutive steps of a run, the states between their ends, and a solution made of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph._shared import Array, real_array

from .row_values import compiled, converted, tangent, values_of

UNIT = 2.0**-53  # relative error of one rounding

Indices = np.ndarray[Any, np.dtype[np.intp]]


class StepBlock(NamedTuple):
    """Consecutive steps. With dense output: x(t_old + s h) = x_old + sum_k dense_k s^k for 0 <= s <= 1."""

    t: Array  # (T,) ends of the steps
    x: Array  # (T, m)
    t_old: Array  # (T,)
    h: Array  # (T,), negative in a run back in time
    x_old: Array  # (T, m)
    dense: Array | None  # (T, degree, m)
    normalization: Graph | None = None  # of the states between the ends, over states, or states and t; see Problem

    @property
    def nbytes(self) -> int:
        """Bytes of the numbers."""
        return sum(each.nbytes for each in self if isinstance(each, np.ndarray))

    def states_at(self, rows: Indices, s: Array) -> Array:
        """States (k, m) at the shares s (k,) of the steps `rows` (k,)."""
        states, graph = self.polynomials_at(rows, s), self.normalization
        if graph is None:
            return states
        with np.errstate(all="ignore"):
            met = values_of(graph, self._inputs(graph, rows, s, states), len(s)).T
        return np.where((s == 1.0)[:, None], states, met)

    def polynomials_at(self, rows: Indices, s: Array) -> Array:
        """States (k, m), not normalized between the ends."""
        assert self.dense is not None
        total, share = np.zeros((len(rows), self.x.shape[1])), s[:, None]
        for coefficients in self.dense[rows].swapaxes(0, 1)[::-1]:
            total += coefficients
            total *= share
        return np.where(share == 1.0, self.x[rows], self.x_old[rows] + total)

    def _inputs(self, graph: Graph, rows: Indices, s: Array, states: Array) -> list[Array]:
        """The inputs of a normalization: states, and t where it takes it."""
        return [*states.T, self.times_at(rows, s)][: len(graph.inputs)]

    def at(self, times: Array) -> Array:
        """States (k, m) at times (k,) of these steps."""
        direction = math.copysign(1.0, self.h[-1])
        rows = np.searchsorted(direction * self.t, direction * times)
        states, inside = self.x[rows], np.flatnonzero(self.t[rows] != times)
        if len(inside):
            rows = rows[inside]
            states[inside] = self.states_at(rows, (times[inside] - self.t_old[rows]) / self.h[rows])
        return states

    def times_at(self, rows: Indices, s: Array) -> Array:
        """Times (k,)."""
        return np.where(s == 1.0, self.t[rows], self.t_old[rows] + s * self.h[rows])

    def slopes_at(self, rows: Indices, s: Array) -> Array:
        """Derivatives of the states by the share, (k, m)."""
        assert self.dense is not None
        total, graph = np.zeros((len(rows), self.x.shape[1])), self.normalization
        for k, coefficients in reversed(list(enumerate(self.dense[rows].swapaxes(0, 1), 1))):
            total *= s[:, None]
            total += k * coefficients
        if graph is None:
            return total
        inputs = [*self._inputs(graph, rows, s, self.polynomials_at(rows, s)), *total.T]
        with np.errstate(all="ignore"):
            return values_of(tangent(graph, graph.input_names[: self.x.shape[1]]), inputs, len(s)).T

    def rounding(self, rows: Indices, t: Array, x: Array) -> tuple[Array, Array]:
        """Rounding errors, (k, m), of states x (k, m) in these steps, and of the times t (k,)."""
        x_error = np.abs(self.x_old[rows]) + np.abs(self.x[rows]) + np.abs(x)
        return UNIT * x_error, UNIT * (np.abs(self.t_old[rows]) + np.abs(t))

    def part(self, which: slice) -> StepBlock:
        """Subset of the steps."""
        return StepBlock._make([each[which] if isinstance(each, np.ndarray) else each for each in self])

    def ending(self, t: float, x: Array) -> StepBlock:
        """The steps, the last of which ends at an instant inside it."""
        cut = self._replace(t=self.t.copy(), x=self.x.copy())
        cut.t[-1:], cut.x[-1:] = t, x
        return cut

    def shortened(self, s: float, t: float, x: Array) -> StepBlock:
        """The same at the share s of the last step, which is then a step of its own."""
        assert self.dense is not None
        cut = self.ending(t, x)._replace(h=self.h.copy(), dense=self.dense.copy())
        cut.h[-1:] *= s
        cut.dense[-1:] *= s ** np.arange(1.0, self.dense.shape[1] + 1.0)[:, None]  # type: ignore[index]
        return cut


def inside_nodes(order: int) -> Array:
    """The shares of a step between its ends, (k,), whose states `with_hermite` needs for an error of h^(order + 1)."""
    parts = max(1, order // 2)
    return 0.5 - 0.5 * np.cos(np.pi * np.arange(1, parts) / parts)


def with_hermite(block: StepBlock, rate: Graph, parameters: Sequence[float], inside: Array) -> StepBlock:
    """The steps with the polynomial through states and rates at both ends, and inside, (k, T, m), at `inside_nodes`."""
    shares = np.concatenate([[0.0], inside_nodes(2 * len(inside) + 2), [1.0]])
    states = np.stack([block.x_old, *inside, block.x])
    times = block.t_old + shares[:, None] * block.h
    times[-1] = block.t
    p = np.tile(np.reshape(parameters, (-1, 1)), times.size)
    points = np.concatenate([states.reshape(-1, states.shape[2]).T, times.reshape(1, -1), p])
    slopes = block.h[:, None] * compiled(rate).batch(points).T.reshape(states.shape)
    powers = np.arange(1, 2 * len(shares))
    matrix = np.concatenate([shares[1:, None] ** powers, powers * shares[:, None] ** (powers - 1)])
    slopes = np.where(np.isfinite(slopes), slopes, block.x - block.x_old)  # beyond a surface a law may have no value
    known = np.concatenate([states[1:] - states[0], slopes])
    dense = np.linalg.solve(matrix, known.reshape(len(powers), -1)).reshape(len(powers), *block.x.shape)
    return block._replace(dense=dense.swapaxes(0, 1))


@dataclass(frozen=True, eq=False)
class Solution:
    """The state at any time of a run from x at t0; the first nq numbers are q, velocities gives qd of (q, p)."""

    t0: float
    x: Array
    steps: Sequence[StepBlock]
    nq: int
    velocities: Graph | None = None

    def __call__(self, t: ArrayLike) -> tuple[Array, Array]:
        """q and qd at a time, or at times (k,). Raises ValueError for a time that the run did not come to."""
        times = real_array("t", t)
        if times.ndim > 1:
            raise ValueError(f"t must be a number or times, (k,), got shape {times.shape}")
        wanted = times.reshape(-1)
        end = float(self.steps[-1].t[-1]) if self.steps else self.t0
        inside = (min(self.t0, end) <= wanted) & (wanted <= max(self.t0, end))
        if not inside.all():
            first = float(wanted[~inside][0])
            raise ValueError(f"t must be between {self.t0:g} and {end:g} s, where the run was, got {first!r} s")
        states = converted(self.velocities, wanted, self._states(wanted)).reshape(*times.shape, len(self.x))
        return states[..., : self.nq], states[..., self.nq :]

    def _states(self, times: Array) -> Array:
        states = np.tile(self.x, (len(times), 1))
        direction = 1.0 if self.steps and self.steps[-1].t[-1] > self.t0 else -1.0
        ends = np.array([block.t[-1] for block in self.steps])
        block_of = np.searchsorted(direction * ends, direction * times)
        later = times != self.t0
        for number in np.unique(block_of[later]):
            here = later & (block_of == number)
            states[here] = self.steps[number].at(times[here])
        return states
