"""Runs of models whose velocities are no rates of coordinates: quaternions stay unit, and everything has its shape."""

import warnings
from functools import cache

import numpy as np
import pytest
from pytest import mark

import dynamics as dyn
from dynamics import METHODS
from dynamics.integrators.tableau import COMPOSITIONS
from tests.dynamics.scipy_motion import scipy_states

IN_TURN = ("symplectic_euler", "verlet")  # they step coordinates and momenta in turn
METHODS_OF_STATES = [
    pytest.param(name, marks=mark.slow if name in COMPOSITIONS and name != "yoshida6" else ())
    for name in METHODS
    if name not in IN_TURN
]
UNIT = 4.0 * 2.0**-53  # roundings of a quotient by a length
AS_WELL = 2e-8  # of runs at rtol 1e-9, and of equal steps of 0.01 s of order 4 and more
COARSE = {"euler": 0.05, "midpoint": 3e-4, "yoshida4": 1e-7}  # as accurate as these are at steps of 0.01 s
TURN = [1.0, 0.2, 0.3, 0.1]


@cache
def top(gravity: float = 9.81) -> dyn.Mechanism:
    """A body on a ball joint."""
    inertia = np.diag([1.0, 1.5, 2.0])
    body = dyn.Body("top", dyn.Joint("ball"), mass=2.0, center=[0.0, 0.05, 0.2], inertia=inertia)
    return dyn.Mechanism([body], gravity=(0.0, 0.0, -gravity))


@cache
def drone() -> dyn.Mechanism:
    """A free body with a hinged arm."""
    base = dyn.Body("base", dyn.Joint("free"), mass=2.0, center=[0.1, 0.0, 0.0], inertia=np.diag([1.0, 1.5, 2.0]))
    joint = dyn.Joint("revolute", axis=[0.0, 1.0, 0.0], position=[0.3, 0.0, 0.0])
    arm = dyn.Body("arm", joint, "base", mass=0.5, center=[0.2, 0.0, 0.0], inertia=0.1 * np.eye(3))
    return dyn.Mechanism([base, arm])


def lengths(q: np.ndarray) -> np.ndarray:
    """Of the quaternions that q (.., nq) begins with."""
    return np.linalg.norm(q[..., :4], axis=-1)


@cache
def _arrival() -> np.ndarray:
    """By SciPy."""
    end = scipy_states(top(), [*np.array(TURN) / np.linalg.norm(TURN), 0.3, 0.2, 4.0], [0.0, 1.0], 1e-13)[-1, :4]
    return np.asarray(end / np.linalg.norm(end))


@mark.parametrize("method", METHODS_OF_STATES)
def test_every_method_keeps_quaternions_unit_and_arrives_where_others_do(method: str) -> None:
    equal = not METHODS[method].adaptive
    options = {"dt": 0.01, "rtol": 1.0} if equal else {}
    run = dyn.simulate(top(), TURN, [0.3, 0.2, 4.0], 1.0, method, dense_output=True, **options)
    assert run.success
    assert np.abs(run.q[-1] - _arrival()).max() < COARSE.get(method, AS_WELL)
    between, _ = run.solution(np.linspace(0.0, 1.0, 37))
    assert np.abs(lengths(np.concatenate([run.q, between])) - 1.0).max() <= UNIT


def test_coordinates_and_velocities_have_the_shapes_of_their_own() -> None:
    start = [0.0, 0.0, 1.0, *TURN, 0.4], [0.5, 0.0, 2.0, 0.3, 0.2, 1.0, -2.0]
    run = dyn.simulate(drone(), *start, 0.5, tau=[0, 0, 1.0, 0, 0, 0, 0.3], t_eval=[0.0, 0.1, 0.5])
    assert (run.q.shape, run.qd.shape, run.qdd.shape, run.forces.shape) == ((3, 8), (3, 7), (3, 7), (3, 7))
    assert np.ptp(run.energy) > 0.1  # tau works
    forward = dyn.forward_dynamics(drone())
    state = [*run.q[1], *run.qd[1], *[0, 0, 1.0, 0, 0, 0, 0.3]]
    accelerations = list(forward.evaluate(dict(zip(forward.input_names, state, strict=True))).values())
    np.testing.assert_allclose(run.qdd[1], accelerations, rtol=1e-12)


@mark.parametrize("size", [1e-150, 3.0, 1e150])
def test_of_a_quaternion_only_the_direction_counts(size: float) -> None:
    turned = np.array(TURN) / np.linalg.norm(TURN)
    run = dyn.simulate(top(), size * turned, [0.0, 0.0, 1.0], 0.1, "rk4", dt=0.05, estimate_error=False)
    same = dyn.simulate(top(), turned, [0.0, 0.0, 1.0], 0.1, "rk4", dt=0.05, estimate_error=False)
    np.testing.assert_allclose(run.q, same.q, rtol=8 * UNIT)


@mark.parametrize("method", ["dop853", "rk4"])
def test_events_read_and_leave_unit_quaternions(method: str) -> None:
    """A quantity of a quaternion's entry, a reset that gives another length, and the run between."""
    half = dyn.Event("half", lambda q, qd, t: q[3] - 0.5)
    turn = dyn.Event(
        "turn", lambda q, qd, t: q[3] - 0.7, reset=lambda q, qd, t: ([3.0 * x for x in q], [-w for w in qd])
    )
    options = {} if method == "dop853" else {"dt": 0.05, "rtol": 1e-2}
    start = [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0]
    rotor = dyn.Mechanism([dyn.Body("rotor", dyn.Joint("ball"), mass=1.0, inertia=np.diag([1.0, 2.0, 3.0]))])
    run = dyn.simulate(rotor, *start, 1.2, method, events=[half, turn], dense_output=True, **options)
    met = np.concatenate([run.events["half"].q, run.events["turn"].q, run.q, run.solution(run.t)[0]])
    assert np.abs(lengths(met) - 1.0).max() <= UNIT
    np.testing.assert_allclose(run.events["half"].q[:, 3], 0.5, rtol=1e-14)
    if method == "dop853":
        at = np.arcsin([0.5, 0.7])  # the angle is 2 t
        np.testing.assert_allclose(run.events["half"].t, [at[0], 2.0 * at[1] - at[0]], rtol=1e-8)
        np.testing.assert_allclose(run.events["turn"].t, at[1:], rtol=1e-8)


def test_the_entries_of_a_quaternion_share_a_tolerance_which_a_place_does_not() -> None:
    """Steps do not depend on how the axes of the world are turned, nor on the unit of lengths."""
    spin = [0.3, 2.0, 1.0]
    plain = dyn.simulate(top(0.0), [1.0, 0.0, 0.0, 0.0], spin, 5.0)
    turned = dyn.simulate(top(0.0), [0.5, -0.5, 0.5, 0.5], spin, 5.0)
    assert abs(plain.stats.steps - turned.stats.steps) <= 0.1 * plain.stats.steps
    ends = []
    for unit in (1.0, 2.0**-30):
        inertia = np.diag([1.0, 1.5, 2.0]) * unit**2
        stone = dyn.Mechanism(
            [dyn.Body("stone", dyn.Joint("free"), mass=2.0, center=[0.1 * unit, 0.0, 0.0], inertia=inertia)],
            gravity=(0.0, 0.0, -9.81 * unit),
        )
        run = dyn.simulate(stone, [0.0, 0.0, unit, *TURN], [0.1 * unit, 0.0, 0.0, *spin], 1.0)
        ends.append([*run.q[-1, :3] / unit, *run.q[-1, 3:], run.stats.steps])
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-7)


@mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: dyn.simulate(top(), [0.0] * 4, [0.0] * 3, 1.0),
            r"'top.qw', .*'top.qz' need a length .*, got \[0.0, 0.0, 0.0, 0.0\]$",
        ),
        (lambda: dyn.simulate(top(), [1.0, 0.0, 0.0], [0.0] * 3, 1.0), r"q must have shape \(4,\)"),
        (lambda: dyn.simulate(top(), TURN, [0.0] * 4, 1.0), r"qd must have shape \(3,\), one for each velocity"),
        (lambda: dyn.simulate(top(), TURN, None, 1.0), r"qd must have shape \(3,\), one for each velocity, got None"),
        (lambda: dyn.simulate(top(), TURN, [0.0] * 3, 1.0, tau=[1.0] * 4), "each of top.wx, top.wy, top.wz: 3, got 4"),
        (lambda: dyn.simulate(top(), TURN, [0.0] * 3, 1.0, atol=[1.0] * 6), r"shape \(7,\)"),
        (
            lambda: dyn.simulate_many(top(), [TURN, [0.0] * 4], [0.0] * 3, 1.0, t_eval=[1.0]),
            "'top.qw', .* need a length .* of trajectory 1",
        ),
        (lambda: dyn.simulate_many(top(), TURN, [[0.0] * 4], 1.0, t_eval=[1.0]), r"qd must have shape \(N, 3\)"),
        *[
            (
                lambda method=method: dyn.simulate(top(), TURN, [0.0] * 3, 1.0, method),
                "with quasi-velocities does not have: take 'midpoint'",
            )
            for method in IN_TURN
        ],
        (
            lambda: dyn.simulate(
                top(),
                TURN,
                [0, 0, 9.0],
                9.0,
                events=dyn.Event("e", lambda q, qd, t: q[3], reset=lambda q, qd, t: (q, q)),
            ),
            r"must be \(4 coordinates, 3 velocities\), got lengths \[4, 4\]",
        ),
    ],
)
def test_what_does_not_fit_is_named(call, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call()


def test_a_failed_run_names_the_velocity() -> None:
    blowing = dyn.Mechanism(
        [dyn.Body("kite", dyn.Joint("ball", damping=0.0), mass=1.0, inertia=np.diag([1.0, 2.0, 3.0]))]
    )
    with warnings.catch_warnings(action="ignore"):
        run = dyn.simulate(blowing, TURN, [1e200, 1e200, 1e200], 1.0, "rk4", dt=0.1)
    assert not run.success
    assert "kite." in run.message
