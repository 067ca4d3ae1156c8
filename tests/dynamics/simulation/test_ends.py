"""Ends of many prepared motions are the last rows of `simulate_many`, to the bit, also where motions stop early."""

import re
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from cgraph import Node
from dynamics.simulation.ensembles.simulate_many import simulate_many
from tests.each_row import each_row

RNG = np.random.default_rng(30)
ARM = dyn.planar_arm([1.0, 0.8], [1.0, 0.5])
SPRING = dyn.System(lambda q, qd, t, p: qd[0] ** 2 / 2 - p["k"] * q[0] ** 2 / 2, "x", parameters={"k": 1.0})
TUMBLING = dyn.Mechanism([dyn.Body("body", dyn.Joint("free"), mass=1.0, inertia=(1.0, 2.0, 2.5))])
RUNAWAY = dyn.OdeSystem(lambda x, t: [x[0] * x[0]], ["x"])


def push(q: Sequence[Node], qd: Sequence[Node], t: Node, p: Any) -> list[Any]:
    return [p["force"] - 0.1 * qd[0], 0.0]


@each_row(
    "model, many, options, varied, workers",
    [
        (ARM, 40, {"method": "rk4", "dt": 0.01, "tau": push, "estimate_error": False}, "force", 1),
        (ARM, 70, {"method": "rk4", "dt": 0.01, "tau": push, "estimate_error": False}, "force", 2),
        (ARM, 9, {"method": "rk4", "dt": 0.01, "tau": push}, "force", 1),  # side by side, with an estimate
        (ARM, 33, {"rtol": 1e-8, "tau": push}, "force", 1),  # in lanes, with steps of their own
        (ARM, 3, {"rtol": 1e-8, "tau": push, "form": "momentum"}, "force", ThreadPoolExecutor(1)),
        (ARM, 8, {"method": "gauss4", "dt": 0.02, "estimate_error": False, "form": "momentum"}, "", 1),
        (SPRING, 34, {"rtol": 1e-9}, "k", 1),
        (TUMBLING, 33, {"method": "dopri5"}, "", 1),
    ],
)
def test_ends_are_the_last_rows_of_simulate_many(
    model: Any, many: int, options: dict[str, Any], varied: str, workers: Any
) -> None:
    nq, n = len(model.coordinates), len(model.velocities)
    motion = dyn.prepare(model, varied=varied or (), **options)
    for t0, t_end in ((0.0, 0.3), (0.3, 0.5)):  # the second time on other numbers
        q, qd = RNG.normal(size=(many, nq)), RNG.normal(size=n)
        given = {varied: RNG.uniform(1.0, 2.0, many)} if varied else None
        end = motion.ends(q, qd, t_end, t0, given, workers=workers)
        rows = simulate_many(model, q, qd, t_end, t0=t0, t_eval=[t_end], parameters=given, **options)
        assert end.t == t_end
        assert (end.q.tobytes(), end.qd.tobytes()) == (rows.q[:, 0].tobytes(), rows.qd[:, 0].tobytes())


def test_a_motion_that_stops_is_nan_and_the_others_go_on() -> None:
    for method, dt in (("rk4", 0.01), ("dop853", None)):
        motion = dyn.prepare(RUNAWAY, method, dt=dt, estimate_error=None if dt is None else False)
        starts = np.where(np.arange(40) == 7, 1.2, 0.5)[:, None]
        with pytest.warns(dyn.SimulationWarning, match="1 of 40 trajectories stopped early: trajectory 7 at t = "):
            end = motion.ends(starts, None, 1.0)
        assert np.isnan(end.q[:, 0]).tolist() == [k == 7 for k in range(40)]
        assert end.q[0] == pytest.approx(1.0, rel=1e-6)  # x0 / (1 - x0 t)


@each_row(
    "call, said",
    [
        (
            lambda: dyn.prepare(SPRING).ends([1.0], [0.0], 1.0, parameters={"k": [1.0, 2.0]}),
            "parameter 'k' has a value for each motion, and the motion was prepared with one for all",
        ),
        (
            lambda: dyn.prepare(ARM, events=dyn.Event("zero", lambda q, qd, t: q[0])).ends([[0.1, 0.2]], [0, 0], 1.0),
            "ends of many motions are of those without events: simulate_many looks for them",
        ),
        (
            lambda: dyn.prepare(ARM, tau=push, varied="force").ends([[0.1, 0.2]], [0, 0], 1.0),
            "parameter 'force' of the controller needs a value",
        ),
        (
            lambda: dyn.prepare(ARM, tau=dyn.SampledController(lambda q, qd, t: [0.0, 0.0], 0.1)).ends(
                [[0.1, 0.2]], [0, 0], 1.0
            ),
            "a SampledController may remember what it has seen, and so controls one motion: ends of many are without",
        ),
        (lambda: dyn.prepare(ARM).ends([[0.1, 0.2]], [0], 1.0), "qd must have shape (N, 2), or (2,)"),
        (lambda: dyn.prepare(ARM).ends([[0.1, 0.2]], [0, 0], 1.0, workers=0), "workers must be a whole number from 1"),
    ],
)
def test_what_cannot_be_is_told(call: Callable[[], Any], said: str) -> None:
    with pytest.raises((TypeError, ValueError), match=re.escape(said)):
        call()
