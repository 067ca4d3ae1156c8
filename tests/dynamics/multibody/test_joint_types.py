"""A type of joint is one object: what else the library does with it follows, as of a screw."""

import math
from dataclasses import replace

import numpy as np
from pytest import approx, importorskip, raises

import dynamics as dyn
from tests.dynamics.mechanisms import PITCH, random_mechanism
from tests.dynamics.models import error, run, states
from tests.tolerances import LAST_BITS

ROUNDING = 1e-11  # of the largest torque


def test_it_winds_along_its_axis() -> None:
    nut = dyn.Mechanism(
        [dyn.Body("nut", dyn.Joint("screw", (0.0, 0.0, 1.0), pitch=PITCH), mass=2.0, inertia=(1.0, 1.0, 0.5))]
    )
    place = nut.motion("nut", (1.0, 0.0, 0.0)).evaluate({"q0": math.pi / 2, "qd0": 2.0})
    assert [place[name] for name in ("x", "y", "z")] == approx([0.0, 1.0, PITCH * math.pi / 2])
    assert [place[name] for name in ("vx", "vy", "vz", "wz")] == approx([-2.0, 0.0, 2.0 * PITCH, 2.0], abs=LAST_BITS)
    falls = dyn.forward_dynamics(nut).evaluate({"q0": 0.3, "qd0": 0.0, "tau0": 0.0})
    assert falls["qdd0"] == approx(-2.0 * 9.81 * PITCH / (0.5 + 2.0 * PITCH**2))


def test_screws_of_other_pitches_are_told_apart() -> None:
    """Also where mechanisms that derive from one another share the motions of their bodies."""
    first = random_mechanism(5, ("screw",), 2)
    steeper = replace(first.bodies[2], joint=replace(first.bodies[2].joint, pitch=2.0 * PITCH))
    bodies = [*first.bodies[:2], steeper, *first.bodies[3:]]
    derived, fresh = replace(first, bodies=bodies), dyn.Mechanism(bodies, first.gravity)
    run(dyn.bias(first), states(first, 3))
    given = states(fresh, 3)
    torques = run(dyn.inverse_dynamics(fresh), given)
    assert np.array_equal(run(dyn.inverse_dynamics(derived), given), torques)
    assert error(dyn.Rows(derived).inverse(*(given[name] for name in ("q", "qd", "qdd"))), torques) < ROUNDING


def test_only_a_screw_has_a_pitch_and_none_is_without() -> None:
    for joint, said in (
        (dyn.Joint("screw"), "body 'b': a joint of the kind 'screw' needs a pitch, got 0.0 m/rad"),
        (dyn.Joint("revolute", pitch=0.1), "body 'b': only a screw has a pitch, not 'revolute', got 0.1 m/rad"),
        (dyn.Joint("screw", pitch=math.nan), "body 'b': pitch must be finite, got nan m/rad"),
    ):
        with raises(dyn.MechanismError, match=said):
            dyn.Mechanism([dyn.Body("b", joint, mass=1.0)])
    importorskip("mujoco")
    with raises(dyn.MechanismError, match="no joint of the kind 'screw'"):
        dyn.to_mjcf(dyn.Mechanism([dyn.Body("b", dyn.Joint("screw", pitch=PITCH), mass=1.0, inertia=(1.0, 1.0, 1.0))]))
