"""Torques and accelerations of planar arms to 32 digits, beside the equation of one pendulum by mpmath."""

import numpy as np
import pytest
from mpmath import mp, mpf

import dynamics as dyn
from dynamics.multiprecision.chain_equations import Pair, accelerations, torques
from tests.dynamics import planar_arm_equations

pytest.importorskip("flint")
PAIR = mpf(2) ** -104  # of the value: what two float64 hold


def pendulum(mass: float, length: float, damping: float, q: float, qd: float) -> tuple[mpf, mpf]:
    """Inertia about the joint and what qdd = 0 takes: m l^2, and m g l sin q + c qd."""
    return mpf(mass) * mpf(length) ** 2, mpf(mass) * mpf(9.81) * mpf(length) * mp.sin(q) + mpf(damping) * mpf(qd)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_pair_has_32_digits_and_so_has_a_deviation_from_it(unit: float) -> None:
    """Of the nearest float64 it is the low part, of one a last bit further that bit and the low part."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        mass, length, damping, q, qd, given = (rng.uniform(0.3, 3.0, 6) * [unit, 1.0, unit, 1.0, 1.0, unit]).tolist()
        arm = dyn.planar_arm([mass], [length], damping=damping, mass_model="point")
        state = np.array([q]), np.array([qd]), np.array([given])
        with mp.workdps(60):
            inertia, right = pendulum(mass, length, damping, q, qd)
            for pair, exact in (
                (torques(arm, *state), inertia * mpf(given) + right),
                (accelerations(arm, *state), (mpf(given) - right) / inertia),
            ):
                assert_near(pair, exact)


def assert_near(pair: Pair, exact: mpf) -> None:
    assert pair.high[0] == float(exact)
    assert abs(mpf(pair.high[0]) + mpf(pair.low[0]) - exact) <= PAIR * abs(exact)
    for x in (pair.high[0], np.nextafter(pair.high[0], np.inf), -pair.high[0], 0.0):
        deviation = mpf(float(x)) - exact
        found = mpf(pair.deviation(np.array([x]))[0])
        assert abs(found - deviation) <= PAIR * abs(exact) + mpf(2) ** -53 * abs(deviation)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_newton_euler_in_space_and_closed_formulas_of_the_plane_agree_in_all_digits(n: int) -> None:
    """Lengths of 1e-6 and 1e6 m in turn, and masses 24 decades apart, for which the first attempt cannot do, too."""
    rng = np.random.default_rng(n)
    ordinary = rng.uniform(0.5, 1.5, (2, n))
    far, light = 10.0 ** (6.0 * (-1.0) ** np.arange(n)), np.array([*[1e-24] * (n - 1), 1.0])
    for masses, lengths in (ordinary, (ordinary[0], far), (light, ordinary[1])):
        arm = dyn.planar_arm(masses.tolist(), lengths.tolist(), damping=0.1)
        state = rng.uniform(-3.0, 3.0, n), rng.normal(size=n), rng.normal(size=n)
        for ours, theirs in (
            (torques, planar_arm_equations.torques),
            (accelerations, planar_arm_equations.accelerations),
        ):
            one, other = ours(arm, *state), theirs(arm, *state)
            assert one.high.tolist() == other.high.tolist()
            assert one.low.tolist() == pytest.approx(other.low.tolist(), rel=1e-9)
