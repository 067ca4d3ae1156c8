"""Planar arms and scenes: the Lagrangian against masses in motion, written down anew."""

import math
from typing import Any

import numpy as np
from mpmath import mp, mpf
from pytest import approx, mark

import dynamics as dyn
from dynamics import as_system
from dynamics.multibody.builders.planar_arm import planar_links
from tests.dynamics.models import at, random_arm, run, states
from tests.tolerances import LAST_BITS

ROUNDING = 1e-13


def particles(arm: dyn.Mechanism, model: str, q: list[Any]) -> list[tuple[float, Any, Any]]:
    """(mass, x, y) of point masses that move as the arm does, from the words of `planar_arm` alone.

    A rod is two half masses at its Gauss points: its velocity squared is quadratic along it, so the sum is exact.
    """
    places = [(1.0, 1.0)] if model == "point" else [(0.5, (1 + s / mp.sqrt(3)) / 2) for s in (-1, 1)]
    x, y, angle = mpf(0), mpf(0), mpf(0)
    result = []
    for link, turn in zip(planar_links(arm), q, strict=True):
        angle += turn
        right, up = link.length * mp.sin(angle), -link.length * mp.cos(angle)
        result += [(share * link.mass, x + part * right, y + part * up) for share, part in places]
        x, y = x + right, y + up
    return result


@mark.parametrize("model", ["rod", "point"])
@mark.parametrize("n", [1, 2, 3, 7])
def test_energy_and_lagrangian_are_those_of_the_arm_s_particles(n: int, model: str) -> None:
    arm = random_arm(n, model=model)
    state = at(states(arm, 1), 0)
    with mp.workdps(60):
        h = mpf(10) ** -20
        q, qd = ([mpf(float(value)) for value in state[name]] for name in ("q", "qd"))
        ahead, behind = (
            particles(arm, model, [x + sign * h * v for x, v in zip(q, qd, strict=True)]) for sign in (1, -1)
        )
        kinetic = sum(m * ((a - c) ** 2 + (b - d) ** 2) for (m, a, b), (_, c, d) in zip(ahead, behind, strict=True))
        kinetic = float(kinetic / (8 * h * h))
        potential = float(sum(m * mpf(9.81) * y for m, _, y in particles(arm, model, q)))
    system = as_system(arm)
    size = ROUNDING * (
        abs(kinetic) + sum(9.81 * link.mass for link in planar_links(arm)) * sum(x.length for x in planar_links(arm))
    )
    lagrangian = run(system.graph({"L": system.lagrangian}, system.q, system.qd), state)[0]
    assert run(dyn.energy(arm), state)[0] == approx(kinetic + potential, rel=0.0, abs=size)
    assert lagrangian == approx(kinetic - potential, rel=0.0, abs=size)
    split = system.graph({"K": system.kinetic, "P": system.potential}, system.q, system.qd)
    assert run(split, state) == approx(np.array([kinetic, potential]), rel=0.0, abs=size)


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


def test_the_rotor_s_inertia_and_stiffness_are_inputs() -> None:
    scene = dyn.scenes.load("spring_mass")
    assert dyn.inverse_dynamics(scene).evaluate({"q0": 0.5, "qd0": 0.3, "qdd0": 2.0, "I": 3.0, "k": 4.0}) == {
        "tau0": 3.0 * 2.0 + 4.0 * 0.5
    }
