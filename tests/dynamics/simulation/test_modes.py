"""Rates that jump or kink: steps end at the surfaces, motions slide on them, and slopes go across."""

import itertools
import math
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.integrators import METHODS, derive
from dynamics.integrators.rate_in_modes import switched
from tests.slow import slow

EVERY = ["dop853", "rk4", "radau", *slow("dopri5", "rodas", "taylor", "gauss4", "midpoint", "verlet", "kahan_li6")]
SECOND_ORDER = {"midpoint", "verlet"}


def options(method: str) -> dict[str, Any]:
    return {} if METHODS[method].adaptive else {"dt": 0.005}


def sliding(**friction: float) -> dyn.System:
    """A block of 1 kg under a load that grows with time, with dry friction."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * qd[0] ** 2 + p["load"] * t * q[0],
        ["x"],
        {"mu": 2.0, "load": 1.0} | friction,
        forces=lambda q, qd, t, p: [-p["mu"] * cg.sign(qd[0])],
    )


@mark.parametrize("method", EVERY)
def test_a_block_comes_to_rest_sticks_and_breaks_away(method: str) -> None:
    """v' = t - 2 sign v from v = 1: at rest at 2 - sqrt(2), stuck until t = 2, then v = (t - 2)^2 / 2."""
    rest, end = 2.0 - math.sqrt(2.0), 4.0
    way = rest - rest**2 + rest**3 / 6.0
    run = dyn.simulate(sliding(), [0.0], [1.0], end, method, t_eval=[1.0, end], **options(method))
    rel = 1e-4 if method in SECOND_ORDER else 1e-7
    assert run.q[:, 0] == approx([way, way + (end - 2.0) ** 3 / 6.0], rel=rel)
    assert run.qd[0, 0] == 0.0
    assert run.qd[1, 0] == approx(0.5 * (end - 2.0) ** 2, rel=rel)


@mark.parametrize("method", EVERY)
def test_slopes_go_through_rest_and_breaking_away(method: str) -> None:
    """x(4) = way(v, mu) + int from mu on of (t - mu)^2 / 2, with rest at mu - sqrt(mu^2 - 2 v): both closed."""

    def end(v: float, mu: float) -> float:
        rest = mu - math.sqrt(mu**2 - 2.0 * v)
        return v * rest - 0.5 * mu * rest**2 + rest**3 / 6.0 + (4.0 - mu) ** 3 / 6.0

    h = 1e-5
    right = [(end(1.0 + h, 2.0) - end(1.0 - h, 2.0)) / (2.0 * h), (end(1.0, 2.0 + h) - end(1.0, 2.0 - h)) / (2.0 * h)]
    how = options(method) | {"method": method, "wrt": ["qd", "mu"]}
    found = dyn.gradient(sliding(), lambda q, qd, t: q[0], [0.0], [1.0], 4.0, **how)
    forward = dyn.sensitivities(sliding(), [0.0], [1.0], 4.0, **how)
    assert [*found["qd"], found["mu"]] == approx(right, rel=1e-4)
    assert [*forward["qd"][-1, 0], forward["mu"][-1, 0]] == approx(right, rel=1e-4)


@mark.parametrize("unit", [1e-6, 1.0, 1e6])
@mark.parametrize("count", [3, *slow(8)])
def test_coupled_joints_come_to_rest_in_any_units(unit: float, count: int) -> None:
    """Dry friction takes all energy: a chain of springs rests where no load is above its friction, and stays."""
    rng = np.random.default_rng(count)
    loss = rng.uniform(0.2, 0.4, count)

    def lagrangian(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> cg.Node:
        kinetic = sum(0.5 * v**2 for v in qd) + sum(0.3 * a * b for a, b in itertools.pairwise(qd))
        return kinetic - sum(0.5 * x**2 for x in q) - sum(0.2 * (a - b) ** 2 for a, b in itertools.pairwise(q))

    def friction(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> list[cg.Node]:
        return [-unit * each * cg.sign(v) for each, v in zip(loss, qd, strict=True)]

    chain = dyn.System(lagrangian, [f"x{k}" for k in range(count)], forces=friction)
    run = dyn.simulate(chain, unit * rng.uniform(-3.0, 3.0, count), np.zeros(count), 40.0)
    assert run.success
    assert (run.qd[-1] == 0.0).all()
    held = dyn.simulate(chain, run.q[-1], np.zeros(count), 40.0)
    assert held.q[-1].tolist() == run.q[-1].tolist()


def test_a_smooth_model_is_the_same_object() -> None:
    smooth = derive(dyn.planar_arm([1.0, 1.0], [1.0, 1.0]), {})
    assert switched(smooth) is smooth
    guarded = dyn.OdeSystem(lambda x, t: [cg.where(cg.equal(x[0], 0.0), 1.0, cg.sin(x[0]) / x[0])], ["x"])
    assert switched(derive(guarded, {})) is derive(guarded, {})


def test_surfaces_that_are_one_share_a_mode() -> None:
    """a < b, max(b, a), |2 a - 2 b| and sign(b - a)."""
    model = dyn.OdeSystem(
        lambda x, t: [
            cg.less(x[0], x[1]) + cg.maximum(x[1], x[0]) + cg.sign(x[1] - x[0]) + cg.abs(2.0 * (x[0] - x[1])),
            x[0] * cg.abs(1.0 + x[0] ** 2),
        ],
        ["a", "b"],
    )
    problem = switched(derive(model, {}))
    assert problem.switches is not None
    assert len(problem.switches.modes) == 1


def test_steps_from_one_time_to_the_next_cross_surfaces() -> None:
    for method in ("dop853", "rk4"):
        going = dyn.prepare(sliding(), method, **options(method)).start([0.0], [1.0], 4.0)
        while going.t < 1.0:
            going.step()
        going.propagate_until(4.0)
        assert going.q == approx(dyn.simulate(sliding(), [0.0], [1.0], 4.0).q[-1], rel=1e-7)


def test_a_pulse_far_shorter_than_a_step_is_met() -> None:
    pulse = dyn.System(
        lambda q, qd, t, p: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2,
        ["x"],
        {"width": 1e-6},
        forces=lambda q, qd, t, p: [cg.where(cg.abs(t - 50.0) < 0.5 * p["width"], 1.0 / p["width"], 0.0)],
    )
    assert dyn.simulate(pulse, [0.5], [0.0], 60.0).q[-1, 0] == approx(0.5 * math.cos(60.0) + math.sin(10.0), rel=1e-6)


def test_independent_stops_at_an_instant_have_slopes_and_others_are_said() -> None:
    def stops(coupling: float) -> dyn.System:
        return dyn.System(
            lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + coupling * qd[0] * qd[1],
            ["x", "y"],
            forces=lambda q, qd, t: [-cg.sign(v) for v in qd],
        )

    found = dyn.sensitivities(stops(0.0), [0.0, 0.0], [1.0, 1.0], 2.0, wrt="qd")
    assert found["qd"][-1, :2] == approx(np.eye(2), abs=1e-9)  # x = v^2 / 2
    with raises(ValueError, match=r"cross zero at one instant, t = 2\.25 s, and one hastens the other"):
        dyn.sensitivities(stops(0.5), [0.0, 0.0], [1.5, 1.5], 3.0, wrt="qd")


def test_a_mass_at_rest_in_the_fold_of_its_potential_stays() -> None:
    folded = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - cg.abs(q[0]), ["x"])
    for method in ("dop853", "rk4"):
        assert not dyn.simulate(folded, [0.0], [0.0], 10.0, method).q.any()


def test_what_a_step_holds_beyond_a_surface_does_not_count() -> None:
    """Neither an event there, nor a force that is no power of the depth beyond the touch."""
    thrown = dyn.System(
        lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.0 * q[0], ["x"], forces=lambda q, qd, t: [-7.0 * cg.sign(qd[0])]
    )
    landing = dyn.Event("landing", lambda q, qd, t: q[0], direction=-1, terminal=True)
    run = dyn.simulate(thrown, [0.0], [8.0], 9.0, "taylor", events=landing)
    assert run.t[-1] == approx(0.5 + math.sqrt(2.0), rel=1e-9)
    balls = [dyn.Body(name, dyn.Joint("prismatic", (1, 0, 0)), mass=1.0) for name in "ab"]
    contact = dyn.Contact("a", "b", radius=0.1, to_radius=0.1, stiffness=1e8)
    hit = dyn.simulate(dyn.Mechanism(balls, (0, 0, 0), forces=[contact]), [-1.0, 0.0], [2.0, 0.0], 2.0)
    assert hit.qd[-1] == approx([0.0, 2.0], abs=1e-8)


def test_a_ball_in_space_slides_rolls_and_bounces() -> None:
    """Where it rolls when it comes down no friction is needed, and none is there at the touch to tell its side."""
    ball = dyn.Body("ball", dyn.Joint("free"), mass=1.0, inertia=(0.004, 0.004, 0.004))
    ground = dyn.Contact("ball", radius=0.1, stiffness=1e5, dissipation=0.2, friction=0.5)
    model = dyn.Mechanism([ball], forces=[ground])
    run = dyn.simulate(model, [0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0)
    assert run.qd[-1, 0] == approx(5.0 / 7.0, rel=1e-9)
    assert run.qd[-1, 4] * 0.1 == approx(5.0 / 7.0, rel=1e-9)


@mark.parametrize("method", ["dop853", "rk4", *slow("dopri5", "radau", "rodas")])
def test_a_slide_and_a_side_may_be_short_beside_a_step(method: str) -> None:
    """At rest from T on, and loaded by t until it breaks away at 1; above the surface for 2 v, where y grows by t."""
    loaded = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"], forces=lambda q, qd, t: [-t - cg.sign(qd[0])])
    for rest in (0.9, 0.99, 0.9999):
        start = rest - 0.5 + (rest**2 - 0.25) / 2.0
        run = dyn.simulate(loaded, [0.0], [start], 2.0, method, t0=0.5, **options(method))
        assert run.qd[-1, 0] == approx(-0.5, rel=1e-7)
    hop = dyn.OdeSystem(lambda x, t: [x[1], -1.0, cg.less(0.0, x[0])], ["x", "v", "y"])
    for v in (0.1, 1e-3, 1e-5):
        end = dyn.simulate(hop, [-0.5 * v - 0.125, v + 0.5, 0.0], None, 1.0, method, **options(method)).q[-1]
        assert end[2] == approx(2.0 * v, rel=1e-4)


def test_what_is_at_rest_at_zero_stays_without_rounding() -> None:
    """Two blocks on one another, that a load lets go later."""
    blocks = dyn.System(
        lambda q, qd, t: qd[0] ** 2 + 0.5 * qd[1] ** 2,
        ["lower", "upper"],
        forces=lambda q, qd, t: [
            12.0 * cg.sin(t) - 3.0 * cg.sign(qd[0]) - 2.0 * cg.sign(qd[0] - qd[1]),
            2.0 * cg.sign(qd[0] - qd[1]),
        ],
    )
    runs = [dyn.simulate(blocks, [0.0, 0.0], [0.0, 0.0], 20.0, method) for method in ("dop853", "dopri5")]
    assert runs[0].modes.t[1] == approx(math.asin(0.25), rel=1e-9)
    assert runs[0].q[-1] == approx(runs[1].q[-1], rel=1e-7)
    assert len(runs[0].t) < 100


@mark.parametrize("method", ["rk4", *slow("euler", "verlet", "gauss4")])
def test_rows_of_forces_have_slopes_across_rest_and_where_they_break_it(method: str) -> None:
    pair = dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2 - (q[0] - q[1]) ** 2),
        ["x", "y"],
        {"f": 0.3},
        forces=lambda q, qd, t, p: [-p["f"] * cg.sign(qd[0]), 0.0],
    )
    tau = np.array([[0.5, 0.1], [-0.2, 0.0], [-0.2, 0.3], [0.2, -0.1], [1.5, 0.0], [0.3, 0.2]])

    def slopes(rows: Any) -> Any:
        how: dict[str, Any] = {"tau": rows, "wrt": "tau", "estimate_error": False}
        return dyn.gradient(pair, lambda q, qd, t: q[0] + q[1], [0.3, 0.0], [0.1, 0.0], 3.0, method, **how)

    found, h = slopes(tau)["tau"], 1e-6
    for k in np.ndindex(tau.shape):
        aside = np.zeros_like(tau)
        aside[k] = h
        assert found[k] == approx((slopes(tau + aside).value - slopes(tau - aside).value) / (2.0 * h), abs=1e-6)


@mark.parametrize("method", ["dop853", "rk4", *slow("dopri5", "radau", "gauss4")])
def test_slopes_go_across_a_surface_beyond_which_a_law_has_no_value(method: str) -> None:
    ball = dyn.System(
        lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0],
        ["x"],
        forces=lambda q, qd, t: [1e4 * cg.maximum(-q[0], 0.0) ** 1.5],
    )
    how: dict[str, Any] = {} if METHODS[method].adaptive else {"dt": 1e-3, "estimate_error": False}
    found = dyn.gradient(ball, lambda q, qd, t: q[0], [0.5], [0.0], 1.0, method, wrt="q", **how)
    ends = [dyn.simulate(ball, [0.5 + h], [0.0], 1.0, rtol=1e-12).q[-1, 0] for h in (-1e-6, 1e-6)]
    assert found["q"] == approx((ends[1] - ends[0]) / 2e-6, rel=1e-4)


def test_a_block_comes_to_rest_where_a_row_of_forces_begins() -> None:
    """By steps of 0.5 s it is at v = 0 to the bit there, so that the surface is met at the begin of a step."""
    block = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"], forces=lambda q, qd, t: [-cg.sign(qd[0])])
    rows = np.array([3.0, 3.0, *[0.0] * 6])[:, None]
    how: dict[str, Any] = {"tau": rows, "wrt": "tau", "estimate_error": False}
    found = dyn.gradient(block, lambda q, qd, t: q[0], [0.0], [0.0], 4.0, "euler", **how)
    assert found.value == 3.0
    assert found["tau"].ravel().tolist() == [1.5, 1.25, 1.0, 0.75, 0.5, 0.25, 0.0, 0.0]
