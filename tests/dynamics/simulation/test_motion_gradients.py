"""gradient and sensitivities: derivatives of what a method computes, through every step."""

import math
import tracemalloc
import warnings
from dataclasses import replace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS, System
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.integrators import derive
from dynamics.simulation.gradients import differentiated_run
from dynamics.simulation.gradients.gradient import MotionGradient
from dynamics.simulation.gradients.motion_programs import motion_equations
from dynamics.simulation.gradients.rate_pullback import RatePullback, rate_pullback, sharing
from tests.bench.speed.scenes import load
from tests.dynamics.linkages import four_bar
from tests.dynamics.mechanisms import random_mechanism
from tests.dynamics.models import driven_pendulum, magnetic, random_arm, relativistic
from tests.dynamics.parametrized import parametrized
from tests.slow import slow
from tests.tolerances import EQUATIONS, LONG_SUM, SHORT_SUM, SOLVED
from tests.trust.random_motions import random_task

DUAL = 1e-12  # of the size of the terms: a gradient beside forward sensitivities
DIFFERENCES = 2e-8  # central differences over 1e-5 of float64
WRT = ["q", "qd", "tau", "m", "k"]
USUAL = "rk4 dopri5 rodas radau verlet gauss4".split()
OTHERS = [name for name in METHODS if name not in USUAL]


def bead(unit: float = 1.0) -> System:
    """A bead on a wire, with a mass that depends on where it is, and a force that depends on time. unit: of q [m]."""

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        x, v = unit * q[0], unit * qd[0]
        return 0.5 * p["m"] * (1.0 + x**2) * v**2 + p["k"] * cg.cos(x) + 0.1 * cg.sin(3.0 * t) * x

    return System(lagrangian, ["s"], {"m": 1.3, "k": 2.0}, damping=0.2 * unit**2)


BEAD = bead()  # what is derived of it is derived once


def loss(q: Any, qd: Any, t: Any, p: Any) -> Any:
    return q[0] * qd[0] + p["m"] * q[0] ** 2


def slope(q: Any, qd: Any) -> Any:
    """Of `loss`, in the state."""
    return np.array([qd[0] + 2.0 * 1.3 * q[0], q[0]])


def options(method: str) -> dict[str, Any]:
    """Steps of the same length, whatever the method."""
    if METHODS[method].adaptive:
        return {"rtol": 10.0, "atol": 10.0, "max_step": 0.1, "first_step": 0.1}
    return {"dt": 0.1, "estimate_error": False}  # they are off, and right derivatives of that


@mark.parametrize("method", [*USUAL, *slow(*OTHERS)])
def test_what_gradients_of_every_method_are(method: str) -> None:
    """The end's slope along forward sensitivities; the same in any order; lam . dx at any step; differences."""
    given = {"t_end": 0.5, "method": method, "tau": [0.3], "backend": "python", **options(method)}
    result = dyn.gradient(BEAD, loss, [0.5], [0.2], wrt=WRT, **given)
    forward = dyn.sensitivities(BEAD, [0.5], [0.2], wrt=WRT, **given)
    assert len(forward.t) in (6, 7)
    at_end = slope(forward.q[-1], forward.qd[-1])
    for name in WRT:
        rows = forward[name][-1]
        direct = forward.q[-1, 0] ** 2 if name == "m" else 0.0
        size = np.abs(at_end) @ np.abs(rows) + abs(direct)
        assert np.all(np.abs(at_end @ rows + direct - result[name]) <= DUAL * size)
        assert not forward.times[name].any()
    turned = dyn.gradient(BEAD, loss, [0.5], [0.2], wrt=WRT[::-1], **given)
    assert [np.squeeze(turned[name]) for name in WRT] == [np.squeeze(result[name]) for name in WRT]

    later = {name: value for name, value in given.items() if name != "t_end"}
    if "dt" in later:
        later["dt"] *= 1.0 + 1e-9  # the time that is left is a whole number of steps, to rounding
    products = [np.squeeze([result["q"], result["qd"]])]
    for row in (2, 4):
        span, start = (forward.t[row], 0.5), (forward.q[row], forward.qd[row])
        bar = dyn.gradient(BEAD, loss, *start, t_span=span, wrt=WRT, **later)
        assert len(bar.t) == len(forward.t) - row
        products.append(
            np.squeeze([bar["q"], bar["qd"]]) @ np.concatenate([forward["q"][row], forward["qd"][row]], axis=1)
        )
    assert np.array(products) == approx(np.tile(products[0], (3, 1)), rel=LONG_SUM, abs=LONG_SUM)

    def value(q: float = 0.5, m: float = 1.3) -> float:
        changed = {**given, "parameters": {"m": m}}
        return dyn.gradient(BEAD, loss, [q], [0.2], wrt=WRT, **changed).value

    for name, at in {"q": 0.5, "m": 1.3}.items():
        difference = (value(**{name: at + 1e-5}) - value(**{name: at - 1e-5})) / 2e-5
        assert float(np.squeeze(result[name])) == approx(difference, rel=DIFFERENCES, abs=DIFFERENCES)


@mark.parametrize("method", ["dop853", "taylor"])
def test_a_gradient_is_of_the_steps_of_simulate_at_any_tolerance(method: str) -> None:
    """The order of Taylor's steps, too, is by the tolerance; slopes by differences at the same steps."""
    for rtol in (1e-3, 1e-7):
        given = {"method": method, "rtol": rtol, "backend": "python", "t_end": 0.5}
        result, run = dyn.gradient(BEAD, loss, [0.5], [0.2], **given), dyn.simulate(BEAD, [0.5], [0.2], **given)
        assert (result.q.tolist(), result.qd.tolist()) == (run.q[-1].tolist(), run.qd[-1].tolist())
        assert result.t.tolist() == run.t.tolist()
        at_most = {**given, "max_step": 1e-2, "first_step": 1e-2}  # so short that all starts have the same steps
        short, (after, before) = (
            dyn.gradient(BEAD, loss, [0.5], [0.2], **at_most),
            [dyn.gradient(BEAD, loss, [0.5 + change], [0.2], **at_most) for change in (1e-5, -1e-5)],
        )
        assert after.t.tolist() == before.t.tolist()
        assert short["q"] == approx([(after.value - before.value) / 2e-5], rel=DIFFERENCES)


def pendulum_step(x: Any, tau: Any, m: Any, h: float) -> Any:
    """A step of RK4 for a rod of 1 m, in complex numbers."""

    def rate(x: Any) -> Any:
        return np.array([x[1], (tau - 0.5 * m * 9.81 * np.sin(x[0]) - 0.1 * x[1]) / (m / 3.0)])

    a = rate(x)
    b = rate(x + h / 2 * a)
    c = rate(x + h / 2 * b)
    return x + h / 6 * (a + 2 * b + 2 * c + rate(x + h * c))


@mark.parametrize("backend", ["python", "llvm"])
def test_torques_a_step_a_running_loss_and_a_parameter_beside_complex_steps(backend: str) -> None:
    if backend == "llvm":
        pytest.importorskip("llvmlite")
    rod = dyn.planar_arm(["m"], [1.0], damping=0.1, parameters={"m": 1.2})
    tau, h = np.random.default_rng(0).normal(size=(20, 1)), 0.5 / 20

    def total(q: Any, tau: Any, m: Any) -> Any:
        x, sums = np.array([q, 0.2 + 0j]), 0.0
        for u in tau:
            sums = sums + m * u * u + x[0] * u
            x = pendulum_step(x, u, m, h)
        return sums + x[0] * x[1]

    given = {"tau": tau, "backend": backend, "running": lambda q, qd, tau, t, p: p["m"] * tau[0] ** 2 + q[0] * tau[0]}
    final = lambda q, qd, t: q[0] * qd[0]  # noqa: E731
    result = dyn.gradient(rod, final, [0.5], [0.2], 0.5, wrt=["q", "tau", "m"], **given)
    tiny, forces = 1e-40, tau[:, 0].astype(complex)
    assert result.value == approx(total(0.5, forces, 1.2).real, rel=SHORT_SUM)
    assert result["tau"].flags.c_contiguous
    assert result["q"] == approx([total(0.5 + 1j * tiny, forces, 1.2).imag / tiny], rel=LONG_SUM)
    assert result["m"] == approx(total(0.5, forces, 1.2 + 1j * tiny).imag / tiny, rel=LONG_SUM)
    assert dyn.gradient(rod, final, [0.5], [0.2], 0.5, wrt="m", **given)["m"] == approx(result["m"], rel=SHORT_SUM)
    unit = 1j * tiny * np.eye(20)
    rows = [total(0.5, forces + unit[k], 1.2).imag / tiny for k in range(20)]
    assert result["tau"][:, 0] == approx(np.array(rows), rel=EQUATIONS, abs=LONG_SUM)


def free_body() -> dyn.Mechanism:
    base = dyn.Body("base", dyn.Joint("free"), mass="m", center=(0.1, 0.0, 0.05), inertia=(0.1, 0.2, 0.3))
    hinge = dyn.Joint("revolute", axis=(0.0, 1.0, 0.0), position=(0.0, 0.0, -0.2), damping=0.05)
    arm = dyn.Body("arm", hinge, "base", 1.0, (0.0, 0.05, -0.3), (0.02, 0.03, 0.04))
    return dyn.Mechanism([base, arm], parameters={"m": 2.0})


def linkage() -> dyn.Mechanism:
    crank, *others = four_bar("hinge").bodies
    return replace(four_bar("hinge"), bodies=[replace(crank, mass="m"), *others], parameters={"m": 1.0})


@mark.parametrize("make", [free_body, linkage])
def test_quaternions_and_loops_by_displacements_and_through_projections(make: Any) -> None:
    model = make()
    rng = np.random.default_rng(1)
    nq, n = len(model.coordinates), len(model.velocities)
    if nq == n:
        q, qd = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    else:
        q, qd = rng.normal(size=nq), rng.normal(size=n)
        q[3:7] /= np.linalg.norm(q[3:7])
    final = lambda q, qd, t: q[2] * qd[1] + q[-1] ** 2  # noqa: E731
    given = {"t_end": 0.2, "dt": 0.02, "wrt": ["q", "qd", "m"], "backend": "python"}
    result, forward = dyn.gradient(model, final, q, qd, **given), dyn.sensitivities(model, q, qd, **given)
    bar = np.zeros(nq + n)
    np.add.at(bar, [2, nq - 1, nq + 1], [forward.qd[-1, 1], 2.0 * forward.q[-1, -1], forward.q[-1, 2]])
    for name in given["wrt"]:
        rows = forward[name][-1]
        assert np.all(np.abs(bar @ rows - result[name]) <= DUAL * (np.abs(bar) @ np.abs(rows)))
    shifts = forward["q"][0, :nq]  # dq of each displacement
    assert result["q"].shape == (n,) == (shifts.shape[1],)
    ends = []
    for sign in (1.0, -1.0):
        with warnings.catch_warnings(action="ignore", category=dyn.ConstraintWarning):
            ends.append(dyn.gradient(model, final, q + sign * 1e-6 * shifts @ np.ones(n), qd, **given).value)
    assert (ends[0] - ends[1]) / 2e-6 == approx(float(result["q"].sum()), rel=1e-6)


def falling() -> System:
    """A ball over a table that moves up and down."""

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        return 0.5 * p["m"] * qd[0] ** 2 - p["m"] * 9.81 * q[0]

    return System(lagrangian, ["height"], {"m": 1.0, "e": 0.8}, damping=0.3)


FALLING = falling()


def table(q: Any, qd: Any, t: Any) -> Any:
    return q[0] - 0.02 * cg.sin(3.0 * t)


BOUNCE = dyn.Event("bounce", table, direction=-1, reset=lambda q, qd, t, p: (q, [-p["e"] * qd[0] + 0.1 * t]))
TOP = dyn.Event("top", lambda q, qd, t: qd[0] - 0.2, direction=-1, terminal=True)


@mark.parametrize(
    ("method", "events"), [("rk4", [BOUNCE]), ("dopri5", [BOUNCE, TOP]), *slow(("gauss4", [BOUNCE, TOP]))]
)
def test_events_that_reset_the_state_or_end_the_motion(method: str, events: Any) -> None:
    given = {"t_end": 1.0, "method": method, "events": events, "wrt": ["q", "tau", "m", "e"], "backend": "python"}
    given |= {"rtol": 1e-7} if METHODS[method].adaptive else {"dt": 0.05}

    def at(q: float = 1.0, tau: float = 0.2, **numbers: float) -> MotionGradient:
        final = lambda q, qd, t: q[0] * qd[0] + t * q[0]  # noqa: E731
        return dyn.gradient(FALLING, final, [q], [0.1], tau=[tau], parameters=numbers, **given)

    result = at()
    forward = dyn.sensitivities(FALLING, [1.0], [0.1], tau=[0.2], **given)
    q, qd, t = forward.q[-1, 0], forward.qd[-1, 0], forward.t[-1]
    for name in given["wrt"]:
        rows, times = forward[name], forward.times[name]
        direct = np.array([qd + t, q]) @ rows[-1] + q * times[-1]
        assert direct == approx(result[name], rel=DUAL, abs=DUAL)
    resets = np.flatnonzero(np.diff(forward.t) == 0.0)
    assert len(forward.t) == len(result.t) + len(resets)
    assert len(resets) == 1
    assert forward.times["e"][: resets[0] + 1].any() == 0  # the first bounce is when it is, whatever comes after it
    assert forward.times["q"][resets[0]] != 0.0
    assert result.t[-1] == (1.0 if len(events) == 1 else approx(0.785, abs=1e-3))
    for name, value in {"q": 1.0, "e": 0.8}.items():
        difference = (at(**{name: value + 1e-6}).value - at(**{name: value - 1e-6}).value) / 2e-6
        assert float(np.squeeze(result[name])) == approx(difference, rel=DIFFERENCES)


@mark.parametrize(
    ("method", "backend"), [("rk4", "python"), ("rk4", "llvm"), ("gauss4", "llvm"), *slow(("gauss4", "python"))]
)
def test_many_gradients_are_those_one_by_one(method: str, backend: str) -> None:
    if backend == "llvm":
        pytest.importorskip("llvmlite")
    rng = np.random.default_rng(3)
    q, qd, tau, k = (rng.normal(size=shape) for shape in ((9, 1), (9, 1), (9, 4, 1), 9))
    given = {"t_end": 0.2, "method": method, "wrt": WRT, "backend": backend}
    running = lambda q, qd, tau, t: q[0] * tau[0]  # noqa: E731
    many = dyn.gradient_many(BEAD, loss, q, qd, tau=tau, parameters={"k": 2.0 + k}, running=running, **given)
    for row in (0, 4, 8):
        one = dyn.gradient(
            BEAD, loss, q[row], qd[row], tau=tau[row], parameters={"k": 2.0 + k[row]}, running=running, **given
        )
        assert many.value[row] == approx(one.value, rel=SHORT_SUM)
        assert (many.q[row], many.qd[row]) == (approx(one.q, rel=SHORT_SUM), approx(one.qd, rel=SHORT_SUM))
        for name in WRT:
            assert many[name][row] == approx(one[name], rel=LONG_SUM, abs=LONG_SUM)


def test_many_gradients_with_what_is_the_same_for_all() -> None:
    held = {"tau": lambda q, qd, t, p: [p["gain"] * (1.0 - q[0])], "parameters": {"gain": [3.0, 4.0]}}
    given = {"t_end": 0.2, "dt": 0.05, "backend": "python"}
    two = dyn.gradient_many(BEAD, loss, [0.5], [0.2], wrt=["q", "gain", "m"], **given, **held)
    held["parameters"] = {"gain": 4.0}
    one = dyn.gradient(BEAD, loss, [0.5], [0.2], wrt=["q", "gain", "m"], **given, **held)
    assert [two[name][1] for name in ("q", "gain", "m")] == [approx(one[name]) for name in ("q", "gain", "m")]
    same = dyn.gradient_many(BEAD, loss, [[0.5], [0.5]], [0.2], tau=[0.3], **given)
    assert same["tau"].shape == (2, 1)
    with raises(
        ValueError, match=r"tau of shape \(1, 4, 1\) is one row a step, which needs equal steps: method 'radau'"
    ):
        dyn.gradient_many(BEAD, loss, [[0.5]], [0.2], 0.2, "radau", tau=np.zeros((1, 4, 1)))


@mark.parametrize("method", ["rk4", "dopri5", "rodas", "radau", "midpoint"])
def test_gradients_where_a_rate_or_its_slopes_do_not_depend_on_the_state(method: str) -> None:
    given: dict[str, Any] = {"t_end": 0.5, "method": method, "backend": "python", **options(method)}
    drift = dyn.OdeSystem(lambda x, t, p: [p["v"]], ["x"], {"v": 2.0})
    clock = dyn.OdeSystem(lambda x, t: [1.0 + 2.0 * t], ["x"])
    for system, end in ((drift, 2.0), (clock, 1.75)):
        assert dyn.gradient(system, lambda x, t: x[0] ** 2, [1.0], None, **given)["q"] == approx([2.0 * end], rel=1e-12)
        assert dyn.sensitivities(system, [1.0], None, wrt="q", **given)["q"][-1, 0] == approx([1.0], rel=1e-12)
    late = dyn.OdeSystem(lambda x, t, p: [p["v"] * t], ["x"], {"v": 2.0})  # from 0, where it has no size yet
    for system, slope in ((drift, 0.5), (late, 0.125)):
        assert dyn.sensitivities(system, [0.0], None, wrt="v", **given)["v"][-1] == approx([slope], rel=1e-12)
    thrown = System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1], ["x", "y"])
    result = dyn.gradient(thrown, lambda q, qd, t: q[0] * q[1], [1.0, 2.0], [3.0, 0.0], **given)
    assert result["qd"] == approx(0.5 * result.q[::-1], rel=1e-12)


@mark.parametrize("make", [free_body, linkage])
def test_what_parameters_alone_decide_is_in_no_step(make: Any) -> None:
    problem = derive(make(), {})
    equations = motion_equations(problem, problem.system.n)
    fixed = set(cg.variables([*equations.names, *equations.numbers.outputs]))
    for graph in (equations.problem.rate, equations.problem.projection):
        for node in [] if graph is None else graph.nodes:
            assert not node.args or any([arg not in fixed and arg.value is None for arg in node.args])
    assert len(equations.numbers.outputs) > len(equations.names)


@mark.parametrize(("name", "count"), [("planar 3", 162), ("planar 7", 514), ("arm 7", 1565)])
def test_a_rate_is_pulled_back_by_what_it_has_solved(name: str, count: int) -> None:
    """Operations, M solved as the rate solves it: of the arm in space by its factors, of the planar ones by bodies."""
    problem = derive(load(name).model, {})
    n = problem.size - problem.nq
    equations = motion_equations(problem, n)
    shared = sharing(equations.problem.rate, equations.pullback)
    pulled = shared[1]([*equations.problem.rate.inputs[: 2 * n]])
    assert sum([bool(node.args) for node in pulled.nodes]) == count


def test_a_rate_that_shares_nothing_with_its_pullback_is_pulled_back_by_its_graph() -> None:
    """Which rounds less."""
    task, motion = random_task(15), {"t_end": 1e-6, "dt": 1e-7, "estimate_error": False}
    with patch.object(RatePullback, "__call__", side_effect=AssertionError):
        dyn.gradient(task.model, lambda q, qd, t: q[0], task.q, task.qd, **motion)


def test_checkpoints_give_the_same_numbers() -> None:
    given = {"t_end": 1.0, "dt": 0.01, "wrt": WRT, "backend": "python"}
    whole = dyn.gradient(BEAD, loss, [0.5], [0.2], **given)
    with patch.object(differentiated_run, "MOST_RECORDED", 1000):
        again = dyn.gradient(BEAD, loss, [0.5], [0.2], **given)
    assert (whole.checkpoints, again.checkpoints) == (0, 10)
    assert {name: np.squeeze(again[name]) for name in WRT} == {name: np.squeeze(whole[name]) for name in WRT}


def test_a_controller_s_gain_and_a_first_order_system() -> None:
    held = {"tau": lambda q, qd, t, p: [p["gain"] * (1.0 - q[0])], "parameters": {"gain": 3.0}}
    given = {"t_end": 0.5, "dt": 0.05, "backend": "python", "wrt": ["q", "gain"], **held}
    result = dyn.gradient(BEAD, loss, [0.5], [0.2], running=lambda q, qd, tau, t: tau[0] ** 2, **given)
    values = [
        dyn.gradient(
            BEAD, loss, [0.5], [0.2], running=lambda q, qd, tau, t: tau[0] ** 2,
            **(given | {"parameters": {"gain": gain}}),
        ).value
        for gain in (3.0 + 1e-5, 3.0 - 1e-5)
    ]  # fmt: skip
    assert result["gain"] == approx((values[0] - values[1]) / 2e-5, rel=DIFFERENCES)
    decay = dyn.OdeSystem(lambda x, t, p: [-p["rate"] * x[0]], ["x"], {"rate": 2.0})
    end = dyn.gradient(decay, lambda x, t: x[0], [3.0], None, 1.0, wrt=["q", "rate"], dt=0.02, backend="python")
    assert end["q"] == approx([math.exp(-2.0)], rel=1e-7)
    assert end["rate"] == approx(-3.0 * math.exp(-2.0), rel=1e-7)
    both = dyn.gradient(decay, None, [3.0], None, 1.0, running=lambda x, t: 0.02 * x[0], dt=0.02, backend="python")
    assert both["q"] == approx([0.02 * (1.0 - math.exp(-2.0)) / (1.0 - math.exp(-0.04))], rel=1e-7)


def test_a_parameter_of_losses_alone_is_an_input_of_them() -> None:
    """As the same number written into the loss, with the slope that the square says; of many, and of a rate alone."""
    steps: dict[str, Any] = {"t_end": 0.1, "dt": 0.05, "backend": "python", "parameters": {"goal": 0.3}}
    decay = dyn.OdeSystem(lambda x, t: [-2.0 * x[0]], ["x"])
    for model, qd in ((BEAD, [0.2]), (decay, None)):
        named = dyn.gradient(model, lambda *at: (at[0][0] - at[-1]["goal"]) ** 2, [0.5], qd, wrt=["q", "goal"], **steps)
        plain = dyn.gradient(
            model, lambda *at: (at[0][0] - 0.3) ** 2, [0.5], qd, wrt="q", **(steps | {"parameters": {}})
        )
        assert named.value == plain.value
        assert named["q"] == approx(plain["q"], rel=SHORT_SUM)
        assert named["goal"] == approx(-2.0 * (named.q[0] - 0.3), rel=SHORT_SUM)
    both = {"loss": lambda q, qd, t: 0.0, "running": lambda q, qd, tau, t, p: p["goal"] * q[0], "wrt": "goal"}
    many = dyn.gradient_many(BEAD, q=[0.5], qd=[0.2], **both, **(steps | {"parameters": {"goal": [0.3, 0.6]}}))
    assert many.value == approx(many["goal"] * [0.3, 0.6], rel=SHORT_SUM)
    with raises(ValueError, match=r"has no parameter 'goal' \(did you mean 'gaol'\?\)"):
        dyn.gradient(BEAD, q=[0.5], qd=[0.2], **both, **(steps | {"parameters": {"gaol": 0.3}}))


def test_what_is_not_there_is_said_in_a_sentence() -> None:
    def end(**given: Any) -> Any:
        return dyn.gradient(BEAD, loss, [0.5], [0.2], **({"t_end": 0.1, "dt": 0.05, "backend": "python"} | given))

    with raises(TypeError, match="SampledController calls Python"):
        end(tau=dyn.SampledController(lambda q, qd, t: q, 0.1))
    with raises(ValueError, match=r"wrt: the motion has no input 'mass'; it has q, qd, tau, m, k"):
        end(wrt="mass")
    with raises(ValueError, match=r"tau must have shape \(n,\) or \(steps, n\) with n = 1"):
        end(tau=np.zeros((2, 3)))
    with raises(ValueError, match="tau has 3 rows, and there are 2 steps"):
        end(tau=np.zeros((3, 1)))
    with raises(ValueError, match="needs equal steps: method 'dop853'"):
        end(tau=np.zeros((3, 1)), method="dop853", dt=None)
    one, two = (dyn.Event(name, lambda q, qd, t: q[0] - 0.5001, reset=lambda q, qd, t: (q, qd)) for name in ("a", "b"))
    with raises(ValueError, match="events a, b happen at one instant"):
        end(events=[one, two])
    with raises(ValueError, match="needs equal steps without events"):
        end(events=one, tau=np.zeros((2, 1)))
    with raises(dyn.MotionError, match=r"the motion stopped at t = 0.05 s: coordinate 's' is .* after the step"):
        end(tau=[1e300])


@mark.slow
def test_the_adjoint_of_a_million_steps_takes_at_most_200_mb() -> None:
    arm = dyn.planar_arm([1.0, 0.8, 0.6], [1.0, 0.8, 0.5], damping=0.1)
    final = lambda q, qd, t: q[0] ** 2 + q[2]  # noqa: E731
    start = ([0.5, 0.3, 0.1], [0.0, 0.1, 0.2])
    dyn.gradient(arm, final, *start, t_end=1e-2)
    tau = np.zeros((10**6, 3))
    tracemalloc.start()
    result = dyn.gradient(arm, final, *start, t_end=100.0, tau=tau)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert result.checkpoints == 1000
    assert result["tau"].shape == (10**6, 3)
    assert np.isfinite(result["tau"]).all()
    assert peak < 200e6


PULLED = {
    "tree": lambda: parametrized(random_mechanism(4, ("revolute", "prismatic"), 2, seed=5), 1, 0.3),
    "free": free_body,
    "arm": lambda: random_arm(3),
    "magnetic": magnetic,
    "relativistic": relativistic,
    "driven": driven_pendulum,
}


@mark.parametrize("name", PULLED)
def test_the_rate_is_pulled_back_by_inverse_dynamics_as_by_its_graph(name: str) -> None:
    """At states and cotangents of any kind: J^T y_bar of one way and the other."""
    problem = derive(PULLED[name](), {})
    by = [node for node in problem.rate.inputs if node.name != "t"]
    made, plain = rate_pullback(problem), cg.vjp(problem.rate, by)
    assert made is not None
    graph, rng = made(by), np.random.default_rng(2)
    for _ in range(3):
        numbers = {node.name: rng.uniform(0.2, 0.8) for node in problem.rate.inputs}
        numbers |= problem.system.parameters
        values, bars = list(problem.rate.evaluate(numbers).values()), rng.normal(size=problem.size).tolist()
        direct = plain.evaluate(numbers | dict(zip(plain.input_names[-problem.size :], bars, strict=True)))
        inputs = zip(graph.input_names, [*numbers.values(), *values, *bars], strict=True)
        pulled = graph.evaluate(dict(inputs))
        expected = np.array(list(direct.values()))
        assert np.array(list(pulled.values())) == approx(expected, rel=SOLVED, abs=SOLVED * np.abs(expected).max())
