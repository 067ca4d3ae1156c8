"""From t0 to t_end: a run goes to its end whatever is recorded, from any start, and back in time."""

from functools import cache
from typing import Any

import numpy as np
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from tests.dynamics.models import oscillator
from tests.dynamics.step_options import EQUAL, EVERY_METHOD, LIKE_OTHERS, step
from tests.slow import slow

ROUNDING = 1e-13  # of some tens of steps of order 1
BACK = 1e-5  # there and back by a symmetric method, or by steps within 1e-9


@cache
def driven(ahead: float = 0.0) -> dyn.System:
    """A pendulum whose pivot is shaken: its equation knows the time.  ahead: of its clock [s]."""
    return dyn.System(
        lambda q, qd, t: 0.5 * qd[0] ** 2 + (3.0 + cg.sin(5.0 * (t + ahead))) * cg.cos(q[0]), ["angle"], damping=0.1
    )


@mark.parametrize("method", EVERY_METHOD)
def test_a_run_goes_to_t_end_whatever_is_recorded(method: str) -> None:
    """What ends the run after the last recorded time is seen, and the run says that it was there."""
    late = dyn.Event("late", lambda q, qd, t: t - 0.8, terminal=True)
    options: dict[str, Any] = {"t_eval": [0.0, 0.25], "backend": "python", **step(method, 0.05)}
    run = dyn.simulate(oscillator(), [1.0], [0.0], 1.0, method, events=late, **options)
    assert run.stats.message == "event 'late' at t = 0.8 s"
    assert run.t == approx([0.0, 0.25, 0.8], rel=ROUNDING)
    whole = dyn.simulate(oscillator(), [1.0], [0.0], 1.0, method, **options)
    assert (whole.t.tolist(), whole.stats.message) == ([0.0, 0.25], "reached t_end")
    if method in EQUAL:
        assert whole.stats.steps == 20
        many = dyn.simulate_many(oscillator(), [[1.0], [2.0]], [0.0], 1.0, method, **options)
        assert many.stats.steps.tolist() == [20, 20]
        assert many.q[0] == approx(whole.q, abs=ROUNDING)
        assert many.t.tolist() == [0.0, 0.25]


@mark.parametrize("method", [*[name for name in EQUAL if name not in LIKE_OTHERS], *slow(*LIKE_OTHERS)])
def test_only_the_equations_know_where_time_begins(method: str) -> None:
    times = np.linspace(0.0, 1.0, 5)
    options = step(method, 0.0625) | {"backend": "python"}
    first = dyn.simulate(driven(4.0), [1.0], [0.0], 1.0, method, t_eval=times, **options)
    second = dyn.simulate(driven(), [1.0], [0.0], t_span=(4.0, 5.0), method=method, t_eval=4.0 + times, **options)
    third = dyn.simulate(driven(), [1.0], [0.0], 5.0, method, t0=4.0, t_eval=4.0 + times, **options)
    assert second.t.tolist() == (4.0 + times).tolist()
    assert second.q == approx(first.q, abs=ROUNDING)
    assert (third.q == second.q).all()
    assert (third.energy == second.energy).all()


@mark.parametrize("method", ["rk4", "midpoint", "gauss6"])
def test_a_motion_back_in_time_is_the_motion(method: str) -> None:
    """There and back: the start comes out, at the times asked for, through the same events the other way round."""
    hanging = dyn.Event("hanging", lambda q, qd, t: q[0])
    options: dict[str, Any] = {"events": hanging, **step(method, 2e-3)}
    there = dyn.simulate(driven(), [1.0], [0.0], t_span=(-1.0, 2.0), method=method, t_eval=[-1.0, 0.0, 2.0], **options)
    start = there.q[-1], there.qd[-1]
    back = dyn.simulate(driven(), *start, t_span=(2.0, -1.0), method=method, t_eval=[2.0, 0.0, -1.0], **options)
    assert back.stats.message == "reached t_end"
    assert back.t.tolist() == [2.0, 0.0, -1.0]
    assert back.q == approx(there.q[::-1], abs=BACK)
    assert back.qd == approx(there.qd[::-1], abs=BACK)
    assert back.energy == approx(there.energy[::-1], abs=10.0 * BACK)
    assert len(there.events["hanging"].t)
    assert back.events["hanging"].t == approx(there.events["hanging"].t[::-1], abs=BACK)
    every = dyn.simulate(driven(), *start, t_span=(2.0, -1.0), method=method, **options)
    assert (np.diff(every.t) < 0.0).all()
    assert every.stats.dt > 0.0
    ends = dyn.Event("ends", lambda q, qd, t: t - 0.5, terminal=True)
    cut = dyn.simulate(driven(), *start, t_span=(2.0, -1.0), method=method, **options | {"events": ends})
    assert (cut.t[-1], len(cut.t)) == (approx(0.5), np.searchsorted(-every.t, -0.5) + 1)


@mark.parametrize("method", ["rk4", "verlet"])
@mark.parametrize(
    "times", [[-1.0, -0.3, 0.7, 2.0], [2.0, 1.1, 0.0], [5.0, 5.1, 5.4], [-0.25, -0.75, -1.25], [1e-3, 0.0, -0.4]]
)
def test_many_from_any_time_to_any_other_are_each_the_one(times: list[float], method: str) -> None:
    """The end is no row where one time is left out; all steps are rows where none is asked for."""
    options: dict[str, Any] = {"t_span": (times[0], times[-1]), "method": method, **step(method, 0.05)}
    for t_eval in (times, times[:-1], times[1:], None):
        many = dyn.simulate_many(driven(), [[1.0], [0.3]], [0.2], t_eval=t_eval, **options)
        for k, q in enumerate((1.0, 0.3)):
            one = dyn.simulate(driven(), [q], [0.2], t_eval=t_eval, **options)
            assert many.t == approx(one.t, abs=ROUNDING)
            assert many.q[k] == approx(one.q, abs=ROUNDING)
            assert many.stats.steps[k] == one.stats.steps
