"""The rank of rows that a user writes himself, which have no common scale, in any units."""

import warnings
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.constraints.constraint_rank import independent_rows
from tests.dynamics.models import Array
from tests.slow import slow


def parallelogram(
    rng: np.random.Generator, cranks: int, units: float, longer: float = 0.0
) -> tuple[dyn.System, Array, Array]:
    """A table of 1 m on cranks; the motion it has, in angles, and the unit of each coordinate, in rad.

    longer: by how much of its length the last crank is longer.
    """
    length, places = rng.uniform(0.3, 0.6), [0.0, *([rng.uniform(0.4, 0.6)] if cranks == 3 else []), 1.0]
    hung = float(rng.integers(2))  # whether the table's angle is counted from the first crank
    of_q = 10.0 ** rng.uniform(-units, units, cranks + 1)
    of_rows = 10.0 ** rng.uniform(-units, units, (cranks, 2))

    def energy(q: Any, qd: Any, t: Any) -> Any:
        angles, speeds = ([x * unit for x, unit in zip(given, of_q, strict=True)] for given in (q, qd))
        table, turning = angles[-1] + hung * angles[0], speeds[-1] + hung * speeds[0]
        x = -length * cg.sin(angles[0]) * speeds[0] - 0.5 * cg.sin(table) * turning
        y = length * cg.cos(angles[0]) * speeds[0] + 0.5 * cg.cos(table) * turning
        kinetic = 0.5 * (x * x + y * y) + turning * turning / 24.0
        potential = 9.81 * (length * cg.sin(angles[0]) + 0.5 * cg.sin(table))
        for angle, speed in zip(angles[:-1], speeds[:-1], strict=True):
            kinetic = kinetic + length**2 / 6.0 * speed * speed
            potential = potential + 9.81 * 0.5 * length * cg.sin(angle)
        return kinetic - potential

    def closing(q: Any, t: Any) -> dict[str, Any]:
        angles = [x * unit for x, unit in zip(q, of_q, strict=True)]
        table, rows = angles[-1] + hung * angles[0], {}
        for k in range(1, cranks):
            for axis, unit, function, along in zip("xy", of_rows[k], (cg.cos, cg.sin), (places[k], 0.0), strict=True):
                other = length * (1.0 + longer * (k == cranks - 1))
                gap = length * function(angles[0]) + places[k] * function(table) - other * function(angles[k]) - along
                rows[f"{axis} of {k}"] = unit * gap
        return rows

    system = dyn.System(energy, [f"a{k}" for k in range(cranks + 1)], constraints=closing)
    return system, np.array([1.0] * cranks + [-hung]), of_q


@pytest.mark.parametrize("units", [0.0, *slow(3.0, 6.0)])
@pytest.mark.parametrize("cranks", [2, 3])
def test_parallelograms_of_rows_in_any_units_have_one_freedom(cranks: int, units: float) -> None:
    for seed in range(3 if units == 0.0 else 30):
        system, _, _ = parallelogram(np.random.default_rng(seed), cranks, units)
        with warnings.catch_warnings(record=True, action="always") as caught:
            kept = independent_rows(system.constraints)
        said = [str(each.message) for each in caught]
        assert len(kept) == cranks, (seed, said)
        assert [("left out" in each) for each in said] == [True] * (cranks - 2)


@pytest.mark.parametrize("longer", [1e-13, 1e-6, *slow(1e-16, 1e-10, 1e-4, 1e-2)])
def test_a_crank_that_is_a_little_longer_does_not_hold_a_parallelogram_in_silence(longer: float) -> None:
    system, along, _ = parallelogram(np.random.default_rng(0), 3, 0.0, longer)
    with warnings.catch_warnings(record=True, action="always") as caught:
        try:
            _, qd = dyn.consistent_state(system, 0.7 * along, along)
        except dyn.ConstraintError as error:
            said = str(error)
            assert longer > 1e-12
            assert "says nothing that the others do not say" in said or "no state was seen" in said
            return
    texts = [str(each.message) for each in caught]
    assert np.abs(qd - along).max() < 1e-9 + 10.0 * longer or any("moved onto them" in text for text in texts)
    assert longer > 1e-12 or any("follows from the others and is left out" in text for text in texts)


def random_rows(seed: int) -> dyn.System:
    """Independent rows, linear, of sines, of squares and mixed, which meet at a point, in very different units."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 7))
    m = int(rng.integers(1, n))
    of_q, of_rows, at = 10.0 ** rng.uniform(-6.0, 6.0, n), 10.0 ** rng.uniform(-6.0, 6.0, m), rng.normal(size=n)
    kinds, slopes = rng.integers(4, size=m), rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.6)
    slopes[np.arange(m), rng.permutation(n)[:m]] = rng.uniform(1.0, 2.0, m)

    def of(kind: int, x: Any) -> Any:
        return x if kind == 0 else cg.sin(x) if kind == 1 else x * x if kind == 2 else x + 0.3 * cg.sin(x)

    def rows(q: Any, t: Any) -> dict[str, Any]:
        given = {}
        for k in range(m):
            weights = np.abs(slopes[k]) if kinds[k] == 2 else slopes[k]
            terms = [
                w * (of(kinds[k], q[i] * of_q[i]) - of(kinds[k], cg.constant(at[i])))
                for i, w in enumerate(weights)
                if w
            ]
            given[f"row {k}"] = of_rows[k] * sum(terms[1:], terms[0])
        return given

    def energy(q: Any, qd: Any, t: Any) -> Any:
        terms = [0.5 * unit**2 * speed * speed for unit, speed in zip(of_q, qd, strict=True)]
        return sum(terms[1:], terms[0])

    return dyn.System(energy, [f"x{i}" for i in range(n)], constraints=rows)


@pytest.mark.parametrize("seeds", [range(12), *slow(range(12, 200))])
def test_rows_that_are_independent_are_kept_in_any_units(seeds: range) -> None:
    met = 0
    for seed in seeds:
        constraints = random_rows(seed).constraints
        with warnings.catch_warnings(action="error", category=dyn.ConstraintWarning):
            try:
                kept = independent_rows(constraints)
            except dyn.ConstraintError:  # no state was seen: rows of squares in such units
                continue
        assert len(kept) == len(constraints), seed
        met += 1
    assert met > 0.6 * len(seeds)
