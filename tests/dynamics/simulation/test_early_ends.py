"""Early ends: a run that stops before t_end is a warning that names the time, the coordinate and the cause."""

import re
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from pytest import mark

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from tests.slow import slow

USUAL = "dop853 radau rk4 verlet".split()
FORMS = ("velocity", "momentum")
EARLY = r"(the run stopped|\d+ of \d+ trajectories stopped early: trajectory \d+) at t = [\d.e-]+ s.* \S"


def falling(metre: float) -> dyn.System:
    """A body that falls into a centre of force within a second, in units of so many metres."""
    return dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + metre**-3 * 2.0 / q[0], ["gap"])


def early(run: Callable[[], Any]) -> tuple[Any, list[str]]:
    """What a run gives, and the warnings by which it says that it stopped."""
    with warnings.catch_warnings(record=True, action="always") as caught:
        result = run()
    assert all(each.category is dyn.SimulationWarning for each in caught)
    assert all(each.filename == __file__ for each in caught)
    return result, [text for each in caught if re.match(EARLY, text := str(each.message))]


def which(many: dyn.Ensemble, k: int) -> str:
    """A trajectory, and where it stopped."""
    assert many.stats.message[k].startswith("stopped at t = ")
    return f"trajectory {k}{many.stats.message[k].removeprefix('stopped')}"


@mark.parametrize("metre", [1.0, *slow(1e-6, 1e6)])
@mark.parametrize("form", FORMS)
@mark.parametrize("method", [*USUAL, *slow(*[name for name in METHODS if name not in USUAL])])
def test_a_run_into_a_centre_of_force_is_heard(method: str, form: str, metre: float) -> None:
    """Equal steps jump over the centre, or leave the numbers; what does not get to the end says so, once."""
    given: dict[str, Any] = {"method": method, "form": form, "max_steps": 3000}
    given |= {} if METHODS[method].adaptive else {"dt": 0.02}
    model, times = falling(metre), [0.5, 2.0]
    run, said = early(lambda: dyn.simulate(model, [1.0 / metre], [0.0], 2.0, **given))
    assert not (METHODS[method].adaptive and run.success)
    assert said == ([] if run.success else [f"the run {run.message}"])
    many, said = early(lambda: dyn.simulate_many(model, [[1.0 / metre]], [0.0], 2.0, t_eval=times, **given))
    assert said == ([] if many.stats.success[0] else ["1 of 1 trajectories stopped early: " + which(many, 0)])


@mark.parametrize("method", ["dop853", "rk4"])
@mark.parametrize("seed", [1, *slow(*range(2, 8))])
def test_runs_of_random_systems_are_whole_or_heard(seed: int, method: str) -> None:
    """x' = a polynomial of second degree, which leaves the numbers soon or stays: of many, too."""
    rng = np.random.default_rng(seed)
    linear, square = rng.normal(size=(2, 2)), rng.normal(size=(2, 2))
    rate = lambda x, t: [  # noqa: E731
        sum([linear[i, j] * x[j] + square[i, j] * x[j] ** 2 for j in range(2)]) for i in range(2)
    ]
    model, starts = dyn.OdeSystem(rate, ["x", "y"]), rng.normal(size=(3, 2))
    given: dict[str, Any] = {"method": method, "rtol": 1e-2, "max_steps": 5000}
    given |= {"dt": 0.01} if method == "rk4" else {}
    runs = [early(partial(dyn.simulate, model, x, None, 10.0, **given)) for x in starts]
    assert [said for _, said in runs] == [[] if run.success else [f"the run {run.message}"] for run, _ in runs]
    many, said = early(lambda: dyn.simulate_many(model, starts, None, 10.0, t_eval=[10.0], **given))
    stopped = np.flatnonzero(~many.stats.success)
    assert said == [f"{len(stopped)} of 3 trajectories stopped early: " + which(many, k) for k in stopped[:1]]
    assert many.stats.success.tolist() == [run.success for run, _ in runs]


@mark.parametrize("method", ["dop853", "dopri5"])
def test_methods_for_stiff_systems_are_named_that_take_fewer_steps(method: str) -> None:
    relaxing = dyn.OdeSystem(lambda x, t: [-1e5 * (x[0] - cg.cos(t))], "x")
    with pytest.warns(dyn.SimulationWarning, match="the system is stiff: .*method='radau'"):
        run = dyn.simulate(relaxing, [1.0], None, 0.1, method)
    assert (run.success, len(run.stats.warnings)) == (True, 1)
    for found in re.findall(r"method='(\w+)'", run.stats.warnings[0]):
        other = dyn.simulate(relaxing, [1.0], None, 0.1, found)
        assert (other.success, other.stats.steps < run.stats.steps) == (True, True)


STEEP: dict[str, tuple[dyn.OdeSystem, str]] = {
    "rodas": (dyn.OdeSystem(lambda x, t: [cg.sqrt(t) - x[0]], ["x"]), "by the time"),
    "radau": (dyn.OdeSystem(lambda x, t: [1.0 + cg.sqrt(x[0])], ["x"]), "by state 'x'"),
}


@mark.parametrize("watched", [False, True])
@mark.parametrize("method", STEEP)
def test_a_derivative_that_a_method_lacks_is_named_with_a_method_that_takes_none(method: str, watched: bool) -> None:
    model, by = STEEP[method]
    events = dyn.Event("never", lambda x, t: x[0] + 1.0) if watched else ()
    run, said = early(lambda: dyn.simulate(model, [0.0], None, 1.0, method, events=events))
    assert said == [f"the run {run.message}"]
    assert f"stopped at t = 0 s: the derivative of the rate of state 'x' {by} is not finite" in run.message
    found = re.search(r"method='(\w+)' takes none$", run.message)
    assert found is not None
    assert dyn.simulate(model, [0.0], None, 1.0, found[1], events=events).success
