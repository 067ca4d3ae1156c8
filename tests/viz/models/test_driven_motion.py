"""Driven motions: under right torques a model follows, whatever the step that a formulation embeds."""

import numpy as np
import pytest

import dynamics as dyn
import viz
from viz.models import driven_motion

FOLLOWED = 1e-8  # of the swing: the error of the run


@pytest.mark.parametrize("formulation", ["chain_rule", "kinetic_only_exact"])
@pytest.mark.parametrize("t_end", [0.5, 2.0])
def test_a_model_follows_the_torques_of_a_sound_formulation(formulation: str, t_end: float) -> None:
    """The embedded step goes from the state one step before, place and velocity, to that of the instant."""
    arm = dyn.planar_arm([1.0, 0.5], [1.0, 0.8])
    run, wanted = viz.driven(arm, formulation, t_end)
    assert run.t[-1] == t_end
    assert np.abs(run.q - wanted(run.t)).max() < FOLLOWED * driven_motion.SWING
