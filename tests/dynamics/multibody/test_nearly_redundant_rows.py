"""Linkages whose axes are tilted a little move as those whose axes are exact, or a warning names the rows."""

import re
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.states.consistent_state import nearest_state
from tests.dynamics.linkage_by_numpy import energies, openness
from tests.dynamics.linkages import bar, four_bar
from tests.dynamics.models import Array
from tests.dynamics.tilted_linkages import random_linkage, tilted
from tests.slow import slow

LOOSE = 1e4  # accelerations are off by so many tilts, at most
ROUNDING = 1e-9
SPAN, ROWS, SEEN = 0.5, 4001, 80  # s, in which a crank turns by about 1 rad; rows, and of how many the loops are seen
OFF = 1e-6  # of a motion at rtol 1e-9: its energy, and its coordinates beside the integral of its velocities
STOPPED = re.compile(r"the run stopped at .*; near by '.*' says? nothing that the other constraints do not say: .* = ")
OPEN = 30.0  # tilts, by which loops may be open


def moving_state(model: dyn.Mechanism, length: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """On the constraints, away from where they say less, with a velocity that they admit."""
    size = np.array([length if body.joint.kind == "prismatic" else 1.0 for body in model.moving])
    for _ in range(40):
        try:
            q, qd = nearest_state(model, size * rng.uniform(-1.5, 1.5, len(size)), size * rng.normal(size=len(size)))
        except dyn.ConstraintError:
            continue
        if dyn.freedom(model, q, tolerance=0.05).freedoms == 1 and np.abs(qd).max() > 0.0:
            return q, qd / np.abs(qd / size).max()
    raise AssertionError("no state")


def one_tilted(kind: str, angle: float) -> dyn.Mechanism:
    """The four-bar with the coupler's axis out of the plane by that angle [rad]."""
    exact = four_bar(kind)
    crank, coupler, rocker = exact.bodies
    axis = (0.6 * angle, 1.0, 0.8 * angle)
    return replace(exact, bodies=[crank, replace(coupler, joint=replace(coupler.joint, axis=axis)), rocker])


@pytest.mark.parametrize("angle", [1e-13, *slow(1e-16, 1e-10, 1e-7, 1e-4)])
@pytest.mark.parametrize("kind", ["point", *slow("hinge")])
def test_a_four_bar_with_a_tilted_axis_goes_round(kind: str, angle: float) -> None:
    q, qd = nearest_state(four_bar(kind), [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    expected = dyn.simulate(four_bar(kind), q, qd, 0.3).q[-1]
    with warnings.catch_warnings(record=True, action="always") as caught:
        model = one_tilted(kind, angle)
        run = dyn.simulate(model, q, qd, 0.3)
    assert np.abs(run.q[-1] - expected).max() < 1e-7 + LOOSE * angle
    assert np.abs(run.q[-1] - q).max() > 0.5
    said = [str(each.message) for each in caught if "nearly follow" in str(each.message)]
    assert len(said) == (angle > 1e-14)
    assert all("'coupler to rocker y' (" in each and "open by" in each and "left out" in each for each in said)


def test_what_is_left_out_and_what_is_kept_is_said_and_can_be_chosen() -> None:
    with pytest.warns(
        dyn.ConstraintWarning, match=r"'coupler to rocker y' \(.* m\) nearly follows .* is kept: what is small may hold"
    ):
        model = one_tilted("point", 1e-3).system
    assert len(dyn.forward_dynamics(model).outputs) == 6
    given = one_tilted("point", 1e-6)
    stiff = replace(given, loops=[replace(given.loops[0], tolerance=0.0)])
    with pytest.warns(dyn.ConstraintWarning, match="is kept: what is small may hold the motion"):
        assert stiff.system.constraints.whole is None
    with pytest.raises(dyn.ConstraintError, match=r"where 'coupler to rocker y' is 0; it is \S+e-0[89] at the nearest"):
        dyn.consistent_state(stiff, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    for wrong in (-1.0, 1.0, float("nan"), "x"):
        with pytest.raises(dyn.MechanismError, match="tolerance must be at least 0 and less than 1, got"):
            replace(given, loops=[replace(given.loops[0], tolerance=wrong)])  # type: ignore[arg-type]


@pytest.mark.parametrize("length", [1e-6, *slow(1.0, 1e6)])
def test_freedom_is_that_of_the_linkage_in_any_unit(length: float) -> None:
    model, hinged = four_bar("weld", length), four_bar("hinge", length)
    held = dyn.freedom(model, [1.0, -0.8, 1.5])
    assert (held.rank, held.freedoms) == (3, 0)  # a weld of coupler and rocker
    open_chain = dyn.freedom(replace(model, loops=()), [1.0, -0.8, 1.5])
    assert (open_chain.rank, open_chain.freedoms, open_chain.redundant) == (0, 3, ())
    found = dyn.freedom(hinged, [1.0, -0.8, 1.5])
    assert (found.rank, found.freedoms, found.tolerance) == (2, 1, 2e-4)
    assert found.redundant == tuple([f"coupler to rocker {row}" for row in ("y", "about x", "about y")])
    with pytest.warns(dyn.ConstraintWarning, match="nearly follow"):
        tilt = dyn.freedom(tilted(hinged, 1e-6, np.random.default_rng(0)), [1.0, -0.8, 1.5])
    assert (tilt.rank, tilt.freedoms) == (2, 1)
    assert 1e-8 < max(tilt.shares[name] for name in tilt.redundant) < 1e-5
    for wrong in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match="tolerance must be at least 0 and less than 1"):
            dyn.freedom(model, [0.0] * 3, tolerance=wrong)


def test_rows_of_which_next_to_nothing_is_new_anywhere_are_kept_and_named() -> None:
    def energy(q: Any, qd: Any, t: Any) -> Any:
        return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + qd[2] ** 2)

    def rows(share: float) -> dyn.System:
        def both(q: Any, t: Any) -> dict[str, Any]:
            return {"one": q[0] - q[1], "other": q[0] - (1.0 + share) * q[1]}

        return dyn.System(energy, "x y z", constraints=both)

    with pytest.warns(dyn.ConstraintWarning, match=r"new of 'other' \(.*e-08 of it is new\): kept"):
        assert "lambda1" in dyn.forward_dynamics(rows(1e-7)).outputs
    with warnings.catch_warnings(action="error"):
        dyn.forward_dynamics(rows(1e-3))


def test_a_flat_parallelogram_is_heard() -> None:
    bars = [bar("crank", "world", 0.5, (0, 0, 0)), bar("coupler", "crank", 1.0, (0.5, 0, 0))]
    bars.append(bar("rocker", "world", 0.5, (1.0, 0, 0)))
    model = dyn.Mechanism(bars, loops=[dyn.Loop("point", "coupler", "rocker", at=(1.0, 0, 0), to_at=(0.5, 0, 0))])
    flat = [0.0] * 3
    said = "of rank 1, elsewhere of 2: 'coupler to rocker x' says nothing"
    assert dyn.freedom(model, flat).freedoms == 2
    with pytest.warns(dyn.ConstraintWarning, match=f"values are not finite: at this state .* {said}"):
        dyn.arrays_at(model, dyn.forward_dynamics(model), flat)
    with pytest.warns(dyn.ConstraintWarning, match=f"values of row 1 are not finite: .* {said}"):
        dyn.arrays_at(model, dyn.forward_dynamics(model), [[0.5, -0.5, 0.5], flat])
    with pytest.raises(dyn.ConstraintError, match=said):
        dyn.consistent_state(model, flat, [1.0, 0.0, 0.0])
    with warnings.catch_warnings(record=True, action="always") as caught:
        dyn.simulate(model, flat, flat, 0.1)
    assert any("the start: at this state" in str(each.message) for each in caught)


@pytest.mark.parametrize("angle", [0.02, *slow(1e-6, 1e-4, 1e-3)])
@pytest.mark.parametrize("kind", ["point", *slow("hinge")])
def test_the_gap_that_is_said_is_that_of_a_revolution(kind: str, angle: float) -> None:
    """The closure of x and z by least squares leaves y open, by no more than is said, and hardly less at its worst."""
    optimize = pytest.importorskip("scipy.optimize")
    model = one_tilted(kind, angle)
    with pytest.warns(dyn.ConstraintWarning, match="nearly follow") as caught:
        constraints = model.system.constraints
    texts = " ".join([str(each.message) for each in caught])
    found = re.search(r"'coupler to rocker y' \([^)]* open by up to (\S+) m\)", texts)
    assert found
    whole, ends = constraints.whole or constraints, np.array([-0.8, 1.5])
    closing = cg.Graph(list(whole.kinematics.q), dict(zip("xyz", whole.positions, strict=False)))

    def gaps(crank: float, others: Array) -> dict[str, Any]:
        return closing.evaluate(dict(zip(closing.input_names, [crank, *others.tolist()], strict=True)))

    widest = 0.0
    for crank in np.linspace(1.0, 1.0 + 2.0 * np.pi, 37):
        ends = optimize.least_squares(lambda x, at=crank: [gaps(at, x)["x"], gaps(at, x)["z"]], ends, xtol=1e-15).x
        widest = max(widest, abs(float(gaps(crank, ends)["y"])))
    assert 0.7 < float(found[1]) / widest < 1.1


def motion(seed: int) -> str:
    """What a tilted linkage does in a while from a state of the exact one, in a word.

    The motion of one freedom is known from three things, all by NumPy: the loops are closed, the energy stays what it
    was, and the velocities are those of the coordinates. One that is held still has lost the velocity it was given.
    """
    exact, other, angle, length = random_linkage(seed)
    with warnings.catch_warnings(action="ignore", category=dyn.ConstraintWarning):
        q, qd = moving_state(exact, length, np.random.default_rng(seed))
    size = np.array([length if body.joint.kind == "prismatic" else 1.0 for body in exact.moving])
    with warnings.catch_warnings(record=True, action="always") as caught:
        try:
            run = dyn.simulate(other, q, qd, SPAN, rtol=1e-9, t_eval=np.linspace(0.0, SPAN, ROWS))
        except dyn.ConstraintError as error:
            return "refused" if re.search(r"'\w+ to \w+ [^']+'", str(error)) else "silent"  # a row of the loop
    texts = [str(each.message) for each in caught]
    named = any("nearly follow" in text or "next to nothing is new" in text for text in texts)
    if not run.stats.success:
        said = [str(each.message) for each in caught if issubclass(each.category, dyn.SimulationWarning)]
        return "stopped" if any(STOPPED.search(text) for text in said) else "silent"
    kept = np.abs((run.qd[0] - qd) / size).max() < min(0.3, OFF + LOOSE * angle)
    closed = max(openness(other, x, length) for x in run.q[::SEEN]) < ROUNDING + OPEN * angle
    kinetic, potential = np.array([energies(other, x, v) for x, v in zip(run.q[::SEEN], run.qd[::SEEN], strict=True)]).T
    total = kinetic + potential
    steady = np.abs(total - total[0]).max() < OFF * kinetic.max()
    step, rates = run.t[1], run.qd / size
    moved = np.cumsum((rates[:-2:2] + 4.0 * rates[1:-1:2] + rates[2::2]) * step / 3.0, axis=0)
    whole = np.abs((run.q[2::2] - run.q[0]) / size - moved).max() < OFF * np.abs(rates).max()
    right = kept and closed and steady and whole
    if right:
        return "moved, named" if named else "moved"
    return "named" if named else "silent"


@pytest.mark.parametrize("seeds", [(1, 3), *slow(range(300))])
def test_tilted_linkages_move_by_closed_loops_and_energy_or_rows_are_named(seeds: Sequence[int]) -> None:
    outcomes = Counter([motion(seed) for seed in seeds])
    assert outcomes["silent"] == 0, outcomes
    assert outcomes["moved"] + outcomes["moved, named"] > 0.5 * len(seeds), outcomes
