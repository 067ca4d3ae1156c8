"""Planar arms and scenes: how they hang, what is in them."""

import math

import numpy as np
from pytest import approx, mark

import dynamics as dyn
from dynamics.multibody.builders.planar_arm import planar_links
from tests.tolerances import LAST_BITS


def test_joint_positions_hang_down_at_zero_and_swing_to_the_right() -> None:
    arm = dyn.planar_arm([1.0, 1.0], [2.0, 1.0])
    hanging, right, folded = arm.joint_positions(np.array([[0.0, 0.0], [math.pi / 2, 0.0], [math.pi / 2, math.pi / 2]]))
    assert hanging == approx(np.array([[0, 0], [0, -2], [0, -3]]), abs=LAST_BITS)
    assert right == approx(np.array([[0, 0], [2, 0], [3, 0]]), abs=LAST_BITS)
    assert folded == approx(np.array([[0, 0], [2, 0], [2, 1]]), abs=LAST_BITS)


def test_the_triple_pendulum_is_the_paper_s() -> None:
    scene = dyn.scenes.load("triple_pendulum")
    assert [(link.mass, link.length) for link in planar_links(scene.model)] == [(1.0, 1.0), (0.8, 0.8), (0.7, 0.7)]
    assert (scene.system.damping, scene.model.gravity) == ((0.1, 0.1, 0.1), (0.0, 0.0, -9.81))
    assert (scene.q, scene.qd) == ((math.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert {link.inertia for link in planar_links(dyn.scenes.load("triple_pendulum", mass_model="point").model)} == {
        0.0
    }


@mark.parametrize("n", [1, 4, 10])
def test_a_chain_weighs_a_kilogram_and_is_a_metre_long_however_many_links(n: int) -> None:
    links = planar_links(dyn.scenes.load("chain", n=n).model)
    assert len(links) == n
    assert (sum(x.mass for x in links), sum(x.length for x in links)) == approx((1.0, 1.0), rel=LAST_BITS)
