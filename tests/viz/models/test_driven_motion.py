"""Driven motions: under right torques a model follows, whatever the step that a formulation embeds."""

import numpy as np
import pytest

import dynamics as dyn
import viz
from tests.each_row import each_row
from viz.models import driven_motion

FOLLOWED = 1e-8  # of the swing: the error of the run
MODELS = {
    "arm": dyn.planar_arm([1.0, 0.5], [1.0, 0.8]),
    "system": dyn.System(lambda q, qd, t: qd[0] ** 2 + qd[1] ** 2 - q[0] ** 2 - q[0] * q[1], "x y"),
    "scene": dyn.scenes.load("triple_pendulum"),
}


@each_row(
    ("name", "formulation", "t_end"),
    [
        ("arm", "chain_rule", 0.5),
        ("arm", "kinetic_only_exact", 2.0),
        ("system", "chain_rule", 1.0),
        ("scene", "chain_rule", 1.0),
    ],
)
def test_a_model_follows_the_torques_of_a_sound_formulation(name: str, formulation: str, t_end: float) -> None:
    """The embedded step goes from the state one step before, place and velocity, to that of the instant."""
    run, wanted = viz.driven(MODELS[name], formulation, t_end)
    assert run.t[-1] == t_end
    assert np.abs(run.q - wanted(run.t)).max() < FOLLOWED * driven_motion.SWING


@each_row("name", ["system", "scene"])
def test_under_the_flawed_torque_it_falls_away(name: str) -> None:
    run, wanted = viz.driven(MODELS[name], "by_definition", t_end=1.0)
    assert run.stats.success
    assert np.abs(run.q - wanted(run.t)).max() > 0.05


def test_a_wanted_motion_needs_coordinates_of_its_own() -> None:
    rod = {"constraints": lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0}}
    with pytest.raises(ValueError, match="has constraints: a wanted motion cannot be chosen"):
        viz.driven(dyn.System(lambda q, qd, t: qd[0] ** 2 + qd[1] ** 2, "x y", **rod))
    free = dyn.Mechanism([dyn.Body("b", dyn.Joint("free"), mass=1.0, inertia=np.eye(3))])
    with pytest.raises(ValueError, match="has velocities that are not the rates of its coordinates"):
        viz.driven(free)
