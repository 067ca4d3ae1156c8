"""Planar arms against MuJoCo, quantity by quantity, then motion."""

import warnings

import numpy as np
from pytest import approx, mark, warns

import dynamics as dyn
from dynamics import to_mjcf
from dynamics.io.mujoco_module import mujoco
from dynamics.io.mujoco_twin import MujocoTwin
from dynamics.io.write_mjcf import STAND_IN
from tests.dynamics.models import Array

SAME_STEPS = 1e-10  # rad, rad/s: rounding of two codes grown by the motion over a second of RK4 steps


def motion(arm: dyn.Mechanism, q: Array, t_end: float, dt: float) -> tuple[dyn.Trajectory, tuple[Array, Array]]:
    still = np.zeros(len(arm.moving))
    return dyn.simulate(arm, q, still, t_end, "rk4", dt=dt), MujocoTwin(arm, dt).trajectory(q, still, round(t_end / dt))


@mark.parametrize("model", ["rod", "point"])
def test_the_triple_pendulum_moves_as_in_mujoco(model: str) -> None:
    scene = dyn.scenes.load("triple_pendulum", mass_model=model)
    ours, (q, qd) = motion(scene.model, np.array(scene.q), t_end=1.0, dt=1e-3)
    assert ours.q == approx(q, rel=0.0, abs=SAME_STEPS)
    assert ours.qd == approx(qd, rel=0.0, abs=SAME_STEPS)
    places = MujocoTwin(scene.model).arm_positions(q)
    assert scene.model.joint_positions(ours.q) == approx(places, rel=0.0, abs=SAME_STEPS)
    assert np.ptp(q, axis=0).min() > 0.5  # rad: every joint has moved


def test_small_masses_are_written_as_they_are_and_only_zeros_are_replaced() -> None:
    small = dyn.Body("small", dyn.Joint("revolute", (0, 1, 0)), mass=3e-15, center=(1, 0, 0), inertia=(2e-15, 2e-15, 0))
    model = mujoco().MjModel.from_xml_string(to_mjcf(dyn.Mechanism([small])))
    assert model.body_mass.tolist() == [0.0, 3e-15]
    assert model.body_inertia[1].tolist() == [2e-15, 2e-15, STAND_IN]


def test_a_warning_while_mujoco_runs_is_python_s_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    twin = MujocoTwin(dyn.planar_arm([1.0], [1.0]))
    with warns(UserWarning, match="^MuJoCo: Nan, Inf or huge value in QVEL at DOF 0"):
        twin.trajectory(np.zeros(1), np.full(1, np.nan), 1)
    assert not [*tmp_path.iterdir()]
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # an exception that left MuJoCo's callback would abort the process
        twin.trajectory(np.zeros(1), np.full(1, np.nan), 1)
    assert mujoco().get_mju_user_warning() is not None
