"""The rows of constraints as numbers: what they are at a state, states that meet them, and their size in any unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import cgraph as cg
from cgraph import Graph, Node, _shared, extend
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, cotangents

from ...systems.arguments import new_variables
from ...systems.constraints import ConstraintError, Constraints
from ...systems.kinematics import ONE, numbered_graph, substitute

SPREADS = (0.3, 1.0, 0.1, 3.0, 0.01, 0.001, 10.0, 0.0001) * 3  # of random starts about the neutral coordinates
ITERATIONS = 100  # of least squares for such a state
TRUNCATED, ROUNDED = 4e-3, 1e-11  # of the largest singular value: at first, steps are not led to where the rank is less
LAST_STEP = 1e-14  # of displacements
DAMPING, LARGEST = 1e-1, 1e6  # of the first step, and where no step makes a gap smaller, beside singular values about 1
AWAY = 0.2  # displacement of states that others are looked at about
SMALL_GAP = 1e-3  # beside displacements: one that is said, as it may be that of the digits of a file
OPEN = 4.5  # certain digits of a row that is not 0, and may follow from others, with their rounding
UNCERTAIN = 0.1  # of an entry: no digit of it is certain where its rounding is larger
ROUNDS = 4  # of scaling
OPENED, FLAT = 1e6, 100.0  # times the rounding of a row; times what slopes say of a displacement
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
        displaced = dict(zip(kinematics.u, new_variables("d", self.n, constraints.parameters), strict=True))
        self.steps = [str(node.name) for node in displaced.values()]
        moved = [
            q + dot for q, dot in zip(kinematics.q, kinematics.rate([displaced[u] for u in kinematics.u]), strict=True)
        ]
        self.inputs = [*kinematics.q, constraints.t, *cg.variables(list(constraints.parameters))]
        self.phi = _graph(self.inputs, constraints.positions)
        self.entries = _graph(self.inputs, [bar for row in slopes for bar in row])
        normalized = kinematics.normalized(moved)
        self.moved = _graph([*kinematics.q, *displaced.values()], normalized)
        there = substitute(constraints.positions, dict(zip(kinematics.q, normalized, strict=True)))
        self.landed = _graph([*self.inputs, *displaced.values()], there)

    def states(self) -> Iterator[dict[str, float]]:
        """States that meet the constraints: values of q0.., t and parameters.  See `closings`."""
        open_ones: list[Closing] = []
        for closing in self.closings():
            if closing.worst is None:
                yield closing.point
            else:
                open_ones.append(closing)
        nearest = min(open_ones, key=lambda each: each.size, default=None)
        if nearest is not None and len(open_ones) == len(SPREADS) + 1 + len(self.constraints.given):
            gap = abs(self.gaps(nearest.point)[nearest.worst])
            said = f"; it is {gap:.1e} at the nearest" if nearest.size < SMALL_GAP else ""
            name = self.constraints.names[nearest.worst or 0]
            raise ConstraintError(f"the constraints cannot be met: no state was seen where {name!r} is 0{said}")

    def closings(self, *, held: Sequence[int] | None = None, nearly: bool = False) -> Iterator[Closing]:
        """Results of least squares from the neutral state, from random ones and some about those that are closed.

        Where none is, from states that callers gave: what is found does not depend on these.
        held, nearly: of `closed`.
        """
        rng = np.random.default_rng(0)
        own, neutral = self.constraints.parameters, np.array(self.constraints.kinematics.neutral)
        yield (best := self.closed(neutral, 0.0, own, held=held, nearly=nearly))
        for k, spread in enumerate(SPREADS):
            q, t = neutral + spread * rng.uniform(-1.0, 1.0, self.nq), float(rng.uniform(0.3, 1.2))
            if (k + k // 8) % 2:  # each spread once in two rounds
                q = self.moved_by(best.point, self.reach * rng.uniform(-1.0, 1.0, self.n))
            closing = self.closed(q, t, own, held=held, nearly=nearly)
            yield closing
            best = closing if closing.worst is None or closing.size < best.size else best
        if best.worst is not None:
            yield from [self.closed(*start, held=held, nearly=nearly) for start in self.constraints.given]

    def closed(
        self,
        q: Array,
        t: float,
        parameters: Mapping[str, float] | None = None,
        *,
        held: Sequence[int] | None = None,
        nearly: bool = False,
    ) -> Closing:
        """A state that meets phi = 0, by least squares from q: damped steps of Gauss and Newton.

        At first without small singular values, which lead to where the rank is less.
        parameters: in place of the constraints' own.  held: rows to close, by default all.  nearly: without the steps
        by all singular values, so that rows that nearly follow from others may stay open.
        """
        shown = {"t": t} | dict(self.constraints.parameters if parameters is None else parameters)
        point = before = self.point(q, shown)
        count, step = len(self.constraints.positions), np.zeros(self.n)
        rows = np.array([k for k in (range(count) if held is None else held) if k < count], dtype=np.intp)
        with np.errstate(all="ignore"):
            of_rows, columns = self.scale or factors(self.certain_matrix(point))
            of_rows = of_rows[rows]
            for least in (TRUNCATED,) if nearly else (TRUNCATED, ROUNDED):
                damping = DAMPING
                for _ in range(ITERATIONS):
                    left, scaled = (
                        of_rows * self.gaps(point)[rows],
                        of_rows[:, None] * self.matrix(point)[rows] * columns,
                    )
                    if not (np.isfinite(left).all() and np.isfinite(scaled).all()):
                        return Closing(point, np.inf, int(rows[np.argmin(np.isfinite(left))]))
                    u, s, v = np.linalg.svd(scaled, full_matrices=False)
                    u, s, v = (x[..., s > least * s.max(initial=0.0)] for x in (u, s, v.T))
                    while damping < LARGEST:
                        way = -v @ (s / (s * s + damping * damping) * (u.T @ left))
                        trial = self.point(self.moved_by(point, columns * way), shown)
                        if np.linalg.norm(of_rows * self.gaps(trial)[rows]) < np.linalg.norm(left):
                            before, point, step = point, trial, columns * way
                            damping *= 0.1
                            break
                        damping *= 10.0
                    if damping >= LARGEST or np.abs(way).max() < LAST_STEP:
                        break
            gaps = np.abs(of_rows * self.gaps(point)[rows])
        worst = int(rows[gaps.argmax()]) if np.isin(self._open_rows(before, step), rows).any() else None
        return Closing(point, float(gaps.max(initial=0.0)), worst)

    def matrix(self, point: Mapping[str, float]) -> Array:
        """J, (m, n)."""
        return _numbers(self.entries, point).reshape(len(self.constraints), self.n)

    def certain_matrix(self, point: Mapping[str, float]) -> Array:
        """J with 0 for entries that are rounding alone."""
        matrix, rounding = _with_rounding(self.entries, point).reshape(2, len(self.constraints), self.n)
        with np.errstate(invalid="ignore"):
            return np.where(rounding <= UNCERTAIN * np.abs(matrix), matrix, 0.0)

    @cached_property
    def scale(self) -> tuple[Array, Array] | None:
        """Factors of rows, one for each loop, and of columns, the same at all states; None where units are not known.

        Angles stand as they are. Lengths are divided by the longest lever that a joint has in their loop, at the
        neutral coordinates and where joints are turned. So no column that is rounding counts as much as another.
        """
        turning, looped = np.array(self.constraints.turning, dtype=bool), self.constraints.loop_rows
        if not len(turning):
            return None
        rng, neutral = np.random.default_rng(1), np.array(self.constraints.kinematics.neutral)
        start = self.point(neutral, {"t": 0.0, **self.constraints.parameters})
        turned = [self.displaced(start, 1.0 * turning, rng) for _ in range(NEAR_STATES)]
        typical = np.max([np.abs(self.certain_matrix(each)) for each in (start, *turned)], axis=0)
        rows, columns = np.ones(len(typical)), np.zeros(self.n)
        for members in self.groups:
            lengths = [k for k in members if (row := looped.get(self.constraints.names[k])) and not row.angle]
            lever = typical[lengths][:, turning].max(initial=0.0) or 1.0
            rows[lengths] = 1.0 / lever
            slides = ~turning & typical[members].any(axis=0)
            columns[slides] = np.maximum(columns[slides], lever if lengths else 1.0)
        columns[turning | (columns == 0.0)] = 1.0
        coupled = [k for k, name in enumerate(self.constraints.names) if name not in looped]
        rows[coupled] = 1.0 / np.maximum((typical * columns)[coupled].max(axis=1, initial=0.0), np.finfo(float).tiny)
        return rows, columns

    @cached_property
    def groups(self) -> list[list[int]]:
        """Rows of each loop, and others each alone."""
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(self.constraints.names):
            row = self.constraints.loop_rows.get(name)
            groups.setdefault(f"row {name}" if row is None else f"loop {row.loop}", []).append(k)
        return list(groups.values())

    @cached_property
    def reach(self) -> Array:
        """The displacement along each velocity, in its unit, that turns the rows: J changes by as much as it is."""
        if self.scale is not None:
            return self.scale[1]
        rng, neutral = np.random.default_rng(0), np.array(self.constraints.kinematics.neutral)
        for spread in SPREADS[:NEAR_STATES]:
            q, t = neutral + spread * rng.uniform(-1.0, 1.0, self.nq), float(rng.uniform(0.3, 1.2))
            closing = self.closed(q, t)
            if closing.worst is None:
                break
        point, here = closing.point, self.matrix(closing.point)
        typical = np.abs(here)
        for _ in range(2):  # an entry that is 0 there, but for rounding, has no size before
            columns = factors(typical)[1]
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

    def about(self, found: Sequence[dict[str, float]], held: Sequence[int]) -> list[dict[str, float]]:
        """States about others where the rows that are held are closed; these themselves where there are none."""
        rng, points = np.random.default_rng(0), list[dict[str, float]]()
        for point in found:  # displaced along what these rows leave free
            _, s, v = np.linalg.svd(self.scaled(point)[list(held)], full_matrices=False)
            way, v = rng.uniform(-AWAY, AWAY, self.n), v[s > TRUNCATED * s.max(initial=0.0)]
            q = self.moved_by(point, self.scales(point)[1] * (way - v.T @ (v @ way)))
            closing = self.closed(q, point["t"], point, held=held)
            points.append(closing.point if closing.worst is None else point)
        return points

    def scales(self, point: dict[str, float]) -> tuple[Array, Array]:
        """Factors of rows and columns by what J is about a state; a displacement of 1 turns rows."""
        if self.scale is not None:
            return self.scale
        typical = self.typical(point, self.reach)
        rows, columns = factors(typical)
        acting = typical.any(axis=0)
        longer = np.exp(np.mean(np.log(self.reach[acting] / columns[acting]))) if acting.any() else 1.0
        return rows / longer, columns * longer

    def scaled(self, point: dict[str, float], matrix: Array | None = None) -> Array:
        """J free of units."""
        rows, columns = self.scales(point)
        return rows[:, None] * (self.matrix(point) if matrix is None else matrix) * columns

    def openings(self, points: Sequence[dict[str, float]]) -> Array:
        """Gaps of rows at states, of the size of their loops, (states, m); 0 of rows of velocities."""
        found = np.zeros((len(points), len(self.constraints)))
        for row, point in zip(found, points, strict=True):
            gaps = self.gaps(point)
            row[: len(gaps)] = np.abs(self.scales(point)[0][: len(gaps)] * gaps)
        return found

    def gaps(self, point: Mapping[str, float]) -> Array:
        """phi."""
        return _numbers(self.phi, point)

    def flat(self, point: dict[str, float], matrix: Array) -> NDArray[np.bool_]:
        """Rows of phi that a displacement opens by far more than their slopes say, (m,), as of a square that is met.

        Of the shortest displacement that opens the row by far more than its rounding.  matrix: J at the state.
        """
        flat = np.zeros(len(self.constraints), dtype=bool)
        closed = np.abs(_with_rounding(self.phi, point)).sum(axis=0)
        left, way = np.arange(len(closed)), self.scales(point)[1] * np.random.default_rng(0).uniform(-1.0, 1.0, self.n)
        for size in SIZES:
            there = np.abs(self.gaps(self.point(self.moved_by(point, size * way), point)))
            opened = left[there[left] > OPENED * closed[left]]
            flat[opened] = there[opened] > FLAT * np.linalg.norm(size * way * matrix[opened], axis=1)
            left = np.setdiff1d(left, opened)
        return flat

    def _open_rows(self, before: Mapping[str, float], step: Array) -> Indices:
        """The rows of phi that are not 0 to their rounding, that of the step included, after a step."""
        if self.landed is None:
            return np.zeros(0, dtype=np.intp)
        point = {**before, **dict(zip(self.steps, step.tolist(), strict=True))}
        values, digits = self.landed.evaluate(point), extend.certain_digits(self.landed, point)
        wrong = [x != 0.0 and not (digits[name] < OPEN and np.isfinite(x)) for name, x in values.items()]
        return np.flatnonzero(wrong)

    def point(self, q: Array, shown: Mapping[str, float]) -> dict[str, float]:
        """Values of q0.., of t and parameters, from these and others."""
        return dict(shown) | {f"q{i}": float(x) for i, x in enumerate(q)}

    def moved_by(self, point: Mapping[str, float], step: Array) -> Array:
        """q after a step along the velocities, (nq,)."""
        return _numbers(self.moved, {**point, **dict(zip(self.steps, step.tolist(), strict=True))})


row_numbers = kept_by_first(RowNumbers)


def _graph(inputs: Sequence[Node], nodes: Sequence[Node]) -> Graph | None:
    return numbered_graph(inputs, nodes) if nodes else None


def _numbers(graph: Graph | None, point: Mapping[str, float]) -> Array:
    """The outputs at a point, {input: number}, by generated Python: hundreds of points follow one another."""
    return np.array([] if graph is None else in_python(graph).values([point[name] for name in graph.input_names]))


def _with_rounding(graph: Graph | None, point: Mapping[str, float]) -> Array:
    """The outputs at a point, and bounds of their rounding, (2, k)."""
    if graph is None:
        return np.zeros((2, 0))
    roundoff, outputs = np.finfo(float).eps / 2.0, graph.outputs.values()
    both = _shared.error_bounds(graph.nodes, point, roundoff, of_inputs=roundoff)
    return np.array([[float(each[node]) for node in outputs] for each in both])


@kept_by_first
def in_python(graph: Graph) -> cg.Compiled:
    """The graph as a function of one state, by generated Python."""
    return cg.compile(graph, "python")


class Closing(NamedTuple):
    """Result of Newton's method."""

    point: dict[str, float]
    size: float  # of what is left, in the unit of displacements
    worst: int | None  # the row that is furthest from 0; None where all are 0


def factors(matrix: Array) -> tuple[Array, Array]:
    """Factors of rows and columns, of any units, which make the largest entries of columns 1 and rows no longer."""
    rows, columns = alike(np.abs(matrix))
    for _ in range(ROUNDS):
        sizes = np.abs(rows[:, None] * matrix * columns).max(axis=0, initial=0.0)
        columns /= np.where(sizes > 0.0, sizes, 1.0)
        lengths = np.linalg.norm(rows[:, None] * matrix * columns, axis=1)
        rows /= np.where(lengths > 0.0, lengths, 1.0)
    return rows, columns


def alike(matrix: Array) -> tuple[Array, Array]:
    """Factors of rows and columns that change with their units alone: logarithms are closest to 0 (Curtis and Reid)."""
    m, n = matrix.shape
    row, column = np.nonzero(matrix)
    system = np.zeros((len(row), m + n))
    system[np.arange(len(row)), row] = system[np.arange(len(row)), m + column] = 1.0
    found = np.exp(-np.linalg.lstsq(system, np.log(matrix[row, column]), rcond=None)[0]) if len(row) else np.ones(m + n)
    return found[:m], found[m:]
