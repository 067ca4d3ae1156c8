"""Motions of typed systems: those of the library, as exact as they say, and ended in a word where they cannot go on."""

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from tests.viz.typed.typed_script import run_typed

MOTION = """(text) => {
  const motion = TYPED.motionOf(parsed(text));
  return { ...motion, rods: motion.points && TYPED.rods(motion.points) };
}"""
NOTICES = "(text) => { const s = parsed(text); return TYPED.recordOf(s, TYPED.motionOf(s)).notices; }"
CART = """\
q: x, a
mc = 2, m = 0.5, l = 0.8, g = 9.81
x1 = x, y1 = 0
x2 = x + l*sin(a), y2 = -l*cos(a)
T = 0.5*mc*x'^2 + 0.5*m*(x2'^2 + y2'^2)
V = m*g*y2
damping x = 0.3
tau x = sin(t)
a(0) = 2
time = 4
"""


def test_a_motion_is_that_of_the_library():
    def lagrangian(q, qd, t, p):
        vx, vy = qd[0] + p["l"] * qd[1] * cg.cos(q[1]), p["l"] * qd[1] * cg.sin(q[1])
        kinetic = 0.5 * p["mc"] * qd[0] ** 2 + 0.5 * p["m"] * (vx * vx + vy * vy)
        return kinetic + p["m"] * p["g"] * p["l"] * cg.cos(q[1])

    values = {"mc": 2.0, "m": 0.5, "l": 0.8, "g": 9.81}
    cart = dyn.System(lagrangian, "x a", values, forces=lambda q, qd, t: [cg.sin(t), 0.0], damping=[0.3, 0.0])
    found = run_typed(MOTION, CART)
    assert found["t"] == pytest.approx(np.linspace(0.0, 4.0, len(found["t"])))
    run = dyn.simulate(cart, [0.0, 2.0], [0.0, 0.0], 4.0, "dopri5", rtol=1e-10, t_eval=np.array(found["t"]))
    assert found["change"] < 1e-6
    size = np.abs(run.q).max(axis=0)
    assert (np.abs(np.array(found["q"]) - run.q).max(axis=0) < found["change"] * size).all()  # what it says, or better
    assert found["points"][-1][0] == [found["q"][-1][0], 0.0]
    assert found["rods"] == [-1, -1, 1]  # from the cart to its bob, and none from the origin to the cart


def test_energy_is_kept_where_nothing_takes_it():
    found = run_typed(MOTION, "L = 0.5*(x'^2 + y'^2) + 1/sqrt(x^2 + y^2)\nx(0) = 1, y'(0) = 1.2\ntime = 20")
    assert np.ptp(found["energy"]) < 1e-6
    assert found["rods"] == [-1, -1]


def test_a_center_that_attracts_is_passed_by():
    """Where nobody said a start and the place of rest has no accelerations; its library says the same."""
    planet = "mu = 1\nL = 0.5*(x'^2 + y'^2) + mu/sqrt(x^2 + y^2)"
    found = run_typed(MOTION, planet)
    assert (found["moved"], found["stopped"]) == ("past", False)
    assert (found["q"][0], found["qd"][0]) == ([0.5, 0.5], [0.5, -0.5])
    (said,) = run_typed(NOTICES, planet)
    assert said.startswith("At 0 the accelerations are not finite, so all coordinates start at 0.5, their rates")


def test_a_motion_that_ends_before_its_time_says_so():
    """One that falls into the center, and one that runs to infinity in a finite time."""
    for text in ("L = 0.5*x'^2 + 1/x\nx(0) = 1\ntime = 3", "L = 0.5*x'^2 + x^4\nx(0) = 1\ntime = 30"):
        found = run_typed(MOTION, text)
        assert found["stopped"]
        assert all(np.isfinite(row).all() for row in (found["q"], found["qd"], found["qdd"], found["energy"]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("L = x'*y' - y^2", "At the start y has no inertia left: the mass matrix is not positive definite."),
        ("L = x'^2 + 1/x, x(0) = 0", "At the start the acceleration of x is not finite."),
    ],
)
def test_what_cannot_start_says_why(text, words):
    assert run_typed(MOTION, text)["error"] == words
    assert run_typed(NOTICES, text) == [words]


def test_what_would_rest_starts_elsewhere_unless_told():
    """At rest every product is zero, and nothing is to be seen."""
    for text in ("L = x'^2 + cos(x)", "L = x'^2 + y'^2 + 1/sqrt(x^2 + y^2)"):
        found = run_typed(MOTION, text)
        assert found["moved"]
        assert set(found["q"][0]) == {0.5}
    for text in ("L = x'^2 + cos(x), x(0) = 0", "L = x'^2 - x"):
        found = run_typed(MOTION, text)
        assert not found["moved"]
        assert found["q"][0] == [0]
