"""The rows of constraints as numbers: what they are at a state, states that meet them, and their size in any unit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import cgraph as cg
from cgraph import Graph, _shared, extend
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, cotangents

from ...systems.constraints import ConstraintError, Constraints
from ...systems.kinematics import ONE
from ..substitute import substitute

SPREADS = (0.3, 1.0, 0.1, 3.0, 0.01, 0.001, 10.0, 0.0001) * 3  # of random starts about the neutral coordinates
ITERATIONS, HALVINGS = 50, 12  # of Newton's method for such a state
TRUNCATED = 4e-3  # of the largest singular value: what it does not close in `nearly_closed`
LAST_STEP, LONGEST_STEP = 1e-9, 0.5  # steps there, of displacements
SMALL_GAP = 1e-6  # of the first gap: what Newton's method closes to rounding in a step or two
OPEN = 0.5  # certain digits of a row that is not 0
FOLLOWS = 4.0  # more digits of one that follows from others: the rounding of axes and lengths that it has in common
UNCERTAIN = 0.1  # of an entry: no digit of it is certain where its rounding is larger
ROUNDS = 4  # of scaling
NEAR_STATES = 3  # states about another one, at which rows are as large as they usually are
SIZES = 10.0 ** np.arange(-10.0, 11.0)  # of displacements
BENT, TURNED = 1e-3, 0.3  # of a row of J, by which it changes if it is not constant; of that, by which it has changed
Indices = NDArray[np.intp]


class RowNumbers:
    """The rows of constraints as numbers: phi and the matrix J of all rows, less what is rounding."""

    def __init__(self, constraints: Constraints) -> None:
        self.constraints, kinematics = constraints, constraints.kinematics
        self.n, self.nq = len(kinematics.u), len(kinematics.q)
        build = Builder()
        slopes = [cotangents({rate: ONE}, kinematics.u, build) for rate in constraints.rates]
        entries = {(k, i): bar for k, row in enumerate(slopes) for i, bar in enumerate(row) if bar.value != 0.0}
        self.steps = step_names(self.n, constraints.parameters)
        displaced = dict(zip(kinematics.u, cg.variables(self.steps), strict=True))
        moved = [
            q + dot for q, dot in zip(kinematics.q, kinematics.rate([displaced[u] for u in kinematics.u]), strict=True)
        ]
        self.inputs = [*kinematics.q, constraints.t, *cg.variables(list(constraints.parameters))]
        numbered = [(f"phi{k}", phi) for k, phi in enumerate(constraints.positions)]
        self.phi = Graph(self.inputs, dict(numbered)) if numbered else None
        self.entries = Graph(self.inputs, {f"J{k}_{i}": bar for (k, i), bar in entries.items()}) if entries else None
        self._places = tuple(np.array(list(entries), dtype=np.intp).reshape(-1, 2).T)
        normalized = kinematics.normalized(moved)
        self.moved = Graph([*kinematics.q, *displaced.values()], {f"{i}": node for i, node in enumerate(normalized)})
        self.landed: Graph | None = None
        if numbered:
            there = substitute(list(constraints.positions), dict(zip(kinematics.q, normalized, strict=True)))
            outputs = {name: phi for (name, _), phi in zip(numbered, there, strict=True)}
            self.landed = Graph([*self.inputs, *displaced.values()], outputs)

    def states(self) -> Iterator[dict[str, float]]:
        """Random states that meet the constraints: values of q0.., t and parameters.

        Newton's method is drawn to where the rank is less; half of the states are nearly closed first, and start
        about the state before, once there is one.
        """
        rng = np.random.default_rng(0)
        found: dict[str, float] = {}
        nearest: tuple[float, int] | None = None
        neutral = np.array(self.constraints.kinematics.neutral)
        for k, spread in enumerate(SPREADS):
            q, t = neutral + spread * rng.uniform(-1.0, 1.0, self.nq), float(rng.uniform(0.3, 1.2))
            if (k + k // 8) % 2:  # each spread once in two rounds
                start = self.point(q, {"t": t, **self.constraints.parameters})
                point = self.nearly_closed(self.displaced(found, self.reach, rng) if found else start)[1]
                near = np.array([point[f"q{i}"] for i in range(self.nq)])
                q = near if np.isfinite(near).all() else q
            closing = self.closed(q, t)
            if closing.worst is None:
                yield closing.point
                found = closing.point
            elif nearest is None or closing.size < nearest[0]:
                nearest = closing.size, closing.worst
        if not found:
            row = 0 if nearest is None else nearest[1]
            raise ConstraintError(
                f"the constraints cannot be met: no state was seen where {self.constraints.names[row]!r} is 0"
            )

    def nearly_closed(self, point: dict[str, float]) -> tuple[float, dict[str, float]]:
        """Newton's method without small singular values: what it leaves of a loop, and where; inf if it never ends."""
        with np.errstate(all="ignore"):
            rows, columns = self.scales(point)
            for _ in range(ITERATIONS):
                phi, matrix = self.gaps(point), self.matrix(point)
                left, scaled = rows[: len(phi)] * phi, (rows[:, None] * matrix * columns)[: len(phi)]
                if not (np.isfinite(left).all() and np.isfinite(scaled).all()):
                    break
                step = -np.linalg.lstsq(scaled, left, rcond=TRUNCATED)[0]
                size = float(np.linalg.norm(step))
                shorter = min(1.0, LONGEST_STEP / size) if size else 1.0
                point = self.point(self.moved_by(point, shorter * columns * step), point)
                if size < LAST_STEP:
                    return float(np.abs(rows[: len(phi)] * self.gaps(point)).max(initial=0.0)), point
        return np.inf, point

    def closed(self, q: Array, t: float, parameters: Mapping[str, float] | None = None) -> Closing:
        """A state that meets phi = 0, by Newton's method with halved steps from q.

        parameters: in place of the constraints' own.
        """
        shown = {"t": t} | dict(self.constraints.parameters if parameters is None else parameters)
        with np.errstate(all="ignore"):
            point = before = self.point(q, shown)
            step = np.zeros(self.n)  # from the point before
            size, looked = np.inf, 0.0  # at the rounding of phi, which takes longer than a step, once a gap is so small
            for k in range(ITERATIONS):
                phi = self.gaps(point)
                if (not k or size <= looked) and not len(self._open_rows(before, step)):
                    return Closing(point, 0.0, None)
                matrix = self.matrix(point)[: len(phi)]
                if not (np.isfinite(phi).all() and np.isfinite(matrix).all()):
                    return Closing(point, np.inf, int(np.argmin(np.isfinite(phi))))
                rows, columns = factors(self.constraints, matrix)
                whole = -columns * np.linalg.lstsq(rows[:, None] * matrix * columns, rows * phi, rcond=1e-10)[0]
                size = float(np.abs(rows * phi).max())
                looked = looked or SMALL_GAP * size
                for halved in range(HALVINGS):
                    shorter = whole * 0.5**halved
                    trial = self.point(self.moved_by(point, shorter), shown)
                    if np.abs(rows * self.gaps(trial)).max() < size:
                        before, point, step = point, trial, shorter
                        break
                else:
                    break
            phi, open_rows = self.gaps(point), self._open_rows(before, step, OPEN + FOLLOWS)
        if not len(open_rows):
            return Closing(point, 0.0, None)
        return Closing(point, size, int(open_rows[np.abs(phi[open_rows]).argmax()]))

    def matrix(self, point: Mapping[str, float]) -> Array:
        """J, (m, n)."""
        return self._filled(() if self.entries is None else _numbers(self.entries, point))

    def _filled(self, entries: Sequence[float]) -> Array:
        """The matrix of entries that are not the constant 0."""
        matrix = np.zeros((len(self.constraints), self.n))
        matrix[self._places] = entries
        return matrix

    def certain_matrix(self, point: Mapping[str, float]) -> Array:
        """J with 0 for entries that are rounding alone."""
        if self.entries is None:
            return self._filled(())
        roundoff, outputs = np.finfo(float).eps / 2.0, self.entries.outputs.values()
        both = _shared.error_bounds(self.entries.nodes, point, roundoff, of_inputs=roundoff)
        matrix, rounding = (self._filled([float(each[node]) for node in outputs]) for each in both)
        with np.errstate(invalid="ignore"):
            return np.where(rounding <= UNCERTAIN * np.abs(matrix), matrix, 0.0)

    @cached_property
    def reach(self) -> Array:
        """The displacement along each velocity, in its unit, that turns the rows: J changes by as much as it is."""
        rng, neutral = np.random.default_rng(0), np.array(self.constraints.kinematics.neutral)
        for spread in SPREADS[:NEAR_STATES]:
            closing = self.closed(neutral + spread * rng.uniform(-1.0, 1.0, self.nq), float(rng.uniform(0.3, 1.2)))
            if closing.worst is None:
                break
        point, here = closing.point, self.matrix(closing.point)
        typical = np.abs(here)
        for _ in range(2):  # an entry that is 0 there, but for rounding, has no size before
            columns = factors(self.constraints, typical)[1]
            with np.errstate(all="ignore"):
                step = columns * rng.uniform(-1.0, 1.0, self.n)
                there = [self.matrix(self.point(self.moved_by(point, size * step), point)) for size in SIZES]
                changes = np.nan_to_num((np.abs(np.array(there) - here) * columns).max(axis=2), nan=np.inf)
                most = np.minimum(changes.max(axis=0), (np.abs(here) * columns).max(axis=1))
            bent = most > BENT * (np.abs(here) * columns).max(axis=1)
            turned = SIZES[(changes >= TURNED * most).argmax(axis=0)]
            reach = columns * max(turned[bent], default=1.0)
            typical = self.typical(point, reach)
        return reach

    def typical(self, point: dict[str, float], reach: Array) -> Array:
        """Sizes of the entries of J about a state, (m, n), where the rows need not be met."""
        rng = np.random.default_rng(1)
        places = [point, *[self.displaced(point, reach, rng) for _ in range(NEAR_STATES)]]
        near = [np.abs(self.matrix(each)) for each in places]
        return np.asarray(np.max([x for x in near if np.isfinite(x).all()] or near[:1], axis=0))

    def displaced(self, point: dict[str, float], reach: Array, rng: np.random.Generator) -> dict[str, float]:
        """A state at random by as much from another one."""
        with np.errstate(all="ignore"):
            return self.point(self.moved_by(point, reach * rng.uniform(-1.0, 1.0, self.n)), point)

    def scales(self, point: dict[str, float]) -> tuple[Array, Array]:
        """Factors of rows and columns by what J is about a state; a displacement of 1 turns rows."""
        typical = self.typical(point, self.reach)
        rows, columns = factors(self.constraints, typical)
        acting = typical.any(axis=0)
        longer = np.exp(np.mean(np.log(self.reach[acting] / columns[acting]))) if acting.any() else 1.0
        return rows / longer, columns * longer

    def gaps(self, point: Mapping[str, float]) -> Array:
        """phi."""
        return np.zeros(0) if self.phi is None else np.array(_numbers(self.phi, point))

    def gap_rounding(self, point: Mapping[str, float]) -> Array:
        """What rounding of the state, or on the way, can make of each row, (m,); 0 of rows of velocities."""
        sizes = np.zeros(len(self.constraints))
        if self.phi is not None:
            roundoff = np.finfo(float).eps / 2.0
            bounds = _shared.error_bounds(self.phi.nodes, point, roundoff, of_inputs=roundoff)[1]
            sizes[: len(self.phi.outputs)] = [float(bounds[node]) for node in self.phi.outputs.values()]
        return sizes

    def _open_rows(self, before: Mapping[str, float], step: Array, most: float = OPEN) -> Indices:
        """The rows of phi that are not 0 to their rounding, that of the step included, after a step."""
        if self.landed is None:
            return np.zeros(0, dtype=np.intp)
        point = {**before, **dict(zip(self.steps, step.tolist(), strict=True))}
        values, digits = self.landed.evaluate(point), extend.certain_digits(self.landed, point)
        wrong = [x != 0.0 and not (digits[name] < most and np.isfinite(x)) for name, x in values.items()]
        return np.flatnonzero(wrong)

    def point(self, q: Array, shown: Mapping[str, float]) -> dict[str, float]:
        """Values of q0.., of t and parameters, from these and others."""
        return dict(shown) | {f"q{i}": float(x) for i, x in enumerate(q)}

    def moved_by(self, point: Mapping[str, float], step: Array) -> Array:
        """q after a step along the velocities, (nq,)."""
        return np.array(_numbers(self.moved, {**point, **dict(zip(self.steps, step.tolist(), strict=True))}))


row_numbers = kept_by_first(RowNumbers)


def _numbers(graph: Graph, point: Mapping[str, float]) -> tuple[float, ...]:
    """The outputs at a point, {input: number}, by generated Python: hundreds of points follow one another."""
    return in_python(graph).values([point[name] for name in graph.input_names])


@kept_by_first
def in_python(graph: Graph) -> cg.Compiled:
    """The graph as a function of one state, by generated Python."""
    return cg.compile(graph, "python")


class Closing(NamedTuple):
    """Result of Newton's method."""

    point: dict[str, float]
    size: float  # of what is left, in the unit of displacements
    worst: int | None  # the row that is furthest from 0; None where all are 0


def step_names(count: int, taken: Iterable[str]) -> list[str]:
    """Names of steps, none of which is that of a parameter."""
    stem = "d"
    while any([name.startswith(stem) for name in taken]):
        stem += "'"
    return [f"{stem}{i}" for i in range(count)]


def balance(matrix: Array) -> tuple[Array, Array]:
    """Factors of rows and columns that make them alike, and free of units (Ruiz)."""
    rows, columns = (np.ones(count) for count in matrix.shape)
    for _ in range(4):
        for axis, factors in ((0, columns), (1, rows)):
            size = np.abs(rows[:, None] * matrix * columns).max(axis=axis, initial=0.0)
            factors /= np.sqrt(np.where(size > 0.0, size, 1.0))
    return rows, columns


def factors(constraints: Constraints, matrix: Array) -> tuple[Array, Array]:
    """Factors of rows, one for each loop, and of columns, which make J free of units and its largest entries 1.

    Rows of angles stand beside those of lengths by the longest lever that a joint of the loop has.
    """
    rows, columns = np.ones(len(matrix)), np.ones(matrix.shape[1])
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(constraints.names[: len(matrix)]):
        looped = constraints.loop_rows.get(name)
        groups.setdefault(name if looped is None else f"loop {looped.loop}", []).append(k)
        if looped and not looped.angle:
            rows[k] = -1.0  # a length
    for members in groups.values():
        straight = [k for k in members if rows[k] < 0.0]
        lever = np.abs(matrix[straight][:, constraints.turning]).max(initial=0.0)
        rows[straight] = 1.0 / (lever or 1.0)
    largest = [np.abs(rows[members, None] * matrix[members]).max(axis=0) for members in groups.values()]
    scales, columns = alike(np.array(largest).reshape(-1, matrix.shape[1]))
    for members, scale in zip(groups.values(), scales, strict=True):
        rows[members] *= scale
    for _ in range(ROUNDS):
        sizes = np.abs(rows[:, None] * matrix * columns).max(axis=0, initial=0.0)
        columns /= np.where(sizes > 0.0, sizes, 1.0)
        lengths = np.linalg.norm(rows[:, None] * matrix * columns, axis=1)
        for members in groups.values():
            rows[members] /= lengths[members].max() or 1.0
    return rows, columns


def alike(matrix: Array) -> tuple[Array, Array]:
    """Factors of rows and columns that change with their units alone: logarithms are closest to 0 (Curtis and Reid)."""
    m, n = matrix.shape
    row, column = np.nonzero(matrix)
    system = np.zeros((len(row), m + n))
    system[np.arange(len(row)), row] = system[np.arange(len(row)), m + column] = 1.0
    found = np.exp(-np.linalg.lstsq(system, np.log(matrix[row, column]), rcond=None)[0]) if len(row) else np.ones(m + n)
    return found[:m], found[m:]


def equilibrated(matrix: Array) -> Array:
    """The matrix with rows and columns scaled to be alike, whatever their units."""
    rows, columns = balance(matrix)
    return rows[:, None] * matrix * columns
