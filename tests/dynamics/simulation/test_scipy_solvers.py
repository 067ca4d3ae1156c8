"""SciPy's solvers through simulate: what makes them fail, loop or crawl ends in one sentence of ours."""

import time
import warnings
from typing import Any

import numpy as np
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from tests.early_end import stops

SOLVERS = ["RK45", "DOP853", "Radau", "BDF", "LSODA"]
CIRCLE = dyn.OdeSystem(lambda x, t: [x[1], -x[0]], ["x", "v"])
ROOT = dyn.OdeSystem(lambda x, t: [cg.sqrt(x[0]), -x[1]], ["x", "v"])
LATE = dyn.OdeSystem(lambda x, t: [x[1], -cg.sqrt(0.5 - t)], ["x", "v"])
BLOWUP = dyn.OdeSystem(lambda x, t: [x[0] * x[0], 0.0 * x[1]], ["x", "v"])
ENOUGH = 30.0  # s: of runs that take a second, on a machine with other work

CASES: dict[str, tuple[dyn.OdeSystem, list[float], float, dict[str, Any]]] = {
    "atol = 0 where a state is 0": (CIRCLE, [0.0, 1.0], 2.0, {"atol": 0.0}),
    "atol = 1e-300": (CIRCLE, [0.0, 1.0], 2.0, {"rtol": 1e-6, "atol": 1e-300}),
    "rtol = 1e-18": (CIRCLE, [1.0, 0.5], 0.05, {"rtol": 1e-18, "atol": 1e-18}),
    "the shortest t_end": (CIRCLE, [1.0, 0.0], 5e-324, {}),
    "no number at the start": (ROOT, [-1.0, 0.0], 1.0, {}),
    "no number later": (LATE, [1.0, 0.0], 1.0, {"rtol": 1e-6}),
    "no Jacobian at the start": (ROOT, [0.0, 1.0], 1.0, {"rtol": 1e-6}),
    "infinite at t = 1": (BLOWUP, [1.0, 1.0], 2.0, {"rtol": 1e-4, "atol": 1e-4}),
}


@mark.parametrize("case", CASES)
def test_a_run_ends_with_an_answer_or_a_sentence_and_says_nothing_else(case: str, capfd: Any) -> None:
    """Neither a loop, nor an exception of linear algebra, nor a warning of SciPy's, which would be an error here."""
    model, start, t_end, options = CASES[case]
    for name in SOLVERS:
        begin = time.perf_counter()
        with warnings.catch_warnings(record=True, action="always") as said:
            run = dyn.simulate(model, start, None, t_end, f"scipy:{name}", **options)
        assert time.perf_counter() - begin < ENOUGH, name
        assert np.isfinite(run.q).all(), name
        assert run.stats.steps < 10_000, name
        assert (np.diff(run.t) > 0.0).all(), name
        assert {warning.category for warning in said} <= {dyn.SimulationWarning}, name
        stats = run.stats
        if case in ("no number at the start", "no number later", "infinite at t = 1", "atol = 0 where a state is 0"):
            assert (stats.success, stats.message[:13]) == (False, "stopped at t "), name
        elif case == "rtol = 1e-18":
            assert (stats.success, "is below rounding: SciPy's" in stats.warnings[0]) == (True, True), name
        elif not stats.success:
            assert stats.message.startswith(("stopped at t = 0 s: ", "stopped at t = ")), name
    assert capfd.readouterr() == ("", "")


@stops
def test_the_sentence_names_the_component() -> None:
    def message(model: dyn.OdeSystem, start: list[float], solver: str, **options: Any) -> str:
        return dyn.simulate(model, start, None, 1.0, f"scipy:{solver}", **options).stats.message

    for name in SOLVERS:
        assert (
            message(ROOT, [-1.0, 0.0], name) == "stopped at t = 0 s: the rate of state 'x' is not finite at the start"
        )
        assert message(CIRCLE, [0.0, 1.0], name, atol=0.0) == (
            "stopped at t = 0 s: state 'x' is 0, and so is atol: nothing measures its error"
        )
    assert message(ROOT, [0.0, 1.0], "Radau") == (
        "stopped at t = 0 s: the Jacobian of the rate of state 'x' is not finite"
    )


def test_an_atol_that_nobody_gave_is_said_where_it_is_much_of_a_component() -> None:
    """An arm in other units moves the same, or is said not to: of femtograms and micrometers 1e-10 is large."""
    start, states = ([1.0, -0.5], [0.0, 0.0]), []
    for mass, length, coarse in ((1.0, 1.0, False), (1e-15, 1e-6, True)):
        arm = dyn.planar_arm([mass, mass], [length, length], gravity=9.81 * length)
        how: dict[str, Any] = {"form": "momentum", "t_eval": [0.0, 1.0]}
        with warnings.catch_warnings(record=True, action="always") as said:
            run = dyn.simulate(arm, *start, 1.0, "scipy:LSODA", **how)
        assert run.stats.warnings == tuple([str(each.message) for each in said])
        assert len(said) == coarse
        if coarse:
            assert "atol = 1e-10, the default of SciPy's solvers, is " in run.stats.warnings[0]
            assert "largest that momentum of " in run.stats.warnings[0]
            run = dyn.simulate(
                arm, *start, 1.0, "scipy:LSODA", atol=[1e-10] * 2 + [1e-10 * mass * length**2] * 2, **how
            )
        states.append(run.q[-1])
    assert states[1] == approx(states[0], abs=1e-7)
