"""Functions that keep a value as a default, `lambda q, qd, t, i=i: ..`: it is theirs, wherever a function is taken."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from pytest import approx, raises

import cgraph as cg
import dynamics as dyn

STIFFNESSES = (1.0, 4.0, 9.0)
TIMES = np.linspace(0.0, 1.0, 5)


def spring(q: Any, qd: Any, t: Any, k: float) -> cg.Node:
    return 0.5 * qd[0] ** 2 - 0.5 * k * q[0] ** 2


def free(q: Any, qd: Any, t: Any) -> cg.Node:
    return 0.5 * qd[0] ** 2


def ends(model: Any, **options: Any) -> float:
    return float(
        dyn.simulate(model, [1.0], [0.0], t_end=1.0, t_eval=TIMES, method="dop853", rtol=1e-10, **options).q[-1, 0]
    )


@pytest.mark.parametrize(
    "end",
    [
        lambda k: ends(dyn.System(lambda q, qd, t, k=k: spring(q, qd, t, k), "x")),
        lambda k: ends(dyn.System(lambda q, qd, t, p, k=k: spring(q, qd, t, k * p["one"]), "x", {"one": 1.0})),
        lambda k: ends(dyn.System(lambda q, qd, t=0.0, p=None, k=k: spring(q, qd, t, k * p["one"]), "x", {"one": 1.0})),
        lambda k: ends(dyn.System(lambda q, qd, t, *, k=k: spring(q, qd, t, k), "x")),
        lambda k: ends(dyn.System(partial(spring, k=k), "x")),
        lambda k: ends(dyn.System(free, "x", forces=lambda q, qd, t, k=k: [-k * q[0]])),
        lambda k: ends(dyn.System(free, "x"), tau=lambda q, qd, t, k=k: [-k * q[0]]),
        lambda k: ends(dyn.with_controller(dyn.System(free, "x"), lambda q, qd, t, k=k: [-k * q[0]])),
        lambda k: dyn.simulate(
            dyn.OdeSystem(lambda x, t, k=k: [x[1], -k * x[0]], "x v"),
            [1.0, 0.0],
            None,
            t_end=1.0,
            t_eval=TIMES,
            rtol=1e-10,
        ).q[-1, 0],
    ],
)
def test_a_kept_value_is_not_the_parameters(end: Any) -> None:
    assert [end(k) for k in STIFFNESSES] == approx([np.cos(np.sqrt(k)) for k in STIFFNESSES], rel=1e-6)


def test_nor_in_events_resets_and_losses() -> None:
    system = dyn.System(free, "x")
    events = [dyn.Event(f"at {i}", lambda q, qd, t, i=i: q[0] - i) for i in (1.0, 2.0)]
    back = dyn.Event("wall", lambda q, qd, t, i=3.0: q[0] - i, reset=lambda q, qd, t, i=-0.5: (q, [i * qd[0]]))
    run = dyn.simulate(system, [0.0], [1.0], t_end=4.0, events=[*events, back])
    assert {name: list(found.t) for name, found in run.events.items()} == {
        "at 1.0": [approx(1.0)],
        "at 2.0": [approx(2.0)],
        "wall": [approx(3.0)],
    }
    assert run.qd[-1] == approx([-0.5])
    loss = dyn.gradient(system, lambda q, qd, t, i=3.0: i * q[0], [0.0], [1.0], t_end=1.0, dt=0.1, method="rk4")
    assert loss.value == approx(3.0)


def test_a_function_without_t_is_refused_though_it_keeps_a_value() -> None:
    with raises(TypeError, match=r"lagrangian must take \(q, qd, t\) or \(q, qd, t, p\), got \(q, qd, k=2.0\)"):
        dyn.System(lambda q, qd, k=2.0: spring(q, qd, 0.0, k), "x")
