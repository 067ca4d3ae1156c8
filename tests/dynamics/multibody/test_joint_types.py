"""A type of joint is one object: what else the library does with it follows, as of a screw that is added here."""

import math

import numpy as np
from pytest import MonkeyPatch, approx, fixture, mark

import dynamics as dyn
from cgraph import Node
from dynamics.multibody.joints import TYPES
from dynamics.multibody.joints.revolute import Revolute
from dynamics.multibody.spatial import Array
from tests.dynamics.mechanisms import random_mechanism
from tests.dynamics.models import error, run, states
from tests.tolerances import LAST_BITS

PITCH = 0.3  # m a radian
ROUNDING = 1e-11  # of the largest torque


class Screw(Revolute):
    """A hinge that moves along its axis as it turns."""

    kind = "screw"
    mjcf = ""

    def shift(self, x: Node) -> Node:
        return PITCH * x

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        turn, _ = super().placement(axis, at)
        return turn, PITCH * at[0] * axis

    def resists(self, mass: float, inertia: Array) -> bool:
        return mass > 0.0 or super().resists(mass, inertia)

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        return 0.0, 0.0 * moment, 0.0 * inertia


@fixture(autouse=True)
def screw(monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setitem(TYPES, "screw", Screw())


def screwed(kinds: tuple[str, ...]) -> dyn.Mechanism:
    return random_mechanism(5, kinds, 2)


KINDS = [("screw",), ("revolute", "screw"), ("screw", "prismatic"), ("prismatic", "screw", "revolute")]


@mark.parametrize("kinds", KINDS)
def test_its_newton_euler_bias_is_lagrange_s(kinds: tuple[str, ...]) -> None:
    mechanism = screwed(kinds)
    system, given = mechanism.system, states(mechanism, 10)
    derived = dyn.System(lambda q, qd, t: list(system.partial_lagrangians), system.coordinates)
    assert error(run(dyn.bias(mechanism), given), run(dyn.bias(derived), given)) < ROUNDING


@mark.parametrize("kinds", KINDS)
def test_torques_body_by_body_and_regrouped_are_the_same(kinds: tuple[str, ...]) -> None:
    mechanism = screwed(kinds)
    given = states(mechanism, 5)
    torques = run(dyn.inverse_dynamics(mechanism), given)
    recursive = dyn.RecursiveInverseDynamics(mechanism)
    rows = np.array([recursive(*(given[name][k] for name in ("q", "qd", "qdd"))) for k in range(5)])
    assert error(rows, torques) < ROUNDING
    regrouped = dyn.Mechanism(mechanism.bodies, mechanism.gravity, base_parameters=True)
    assert error(run(dyn.inverse_dynamics(regrouped), given), torques) < ROUNDING


def test_it_winds_along_its_axis() -> None:
    nut = dyn.Mechanism([dyn.Body("nut", dyn.Joint("screw", (0.0, 0.0, 1.0)), mass=2.0, inertia=(1.0, 1.0, 0.5))])
    place = nut.motion("nut", (1.0, 0.0, 0.0)).evaluate({"q0": math.pi / 2, "qd0": 2.0})
    assert [place[name] for name in ("x", "y", "z")] == approx([0.0, 1.0, PITCH * math.pi / 2])
    assert [place[name] for name in ("vx", "vy", "vz", "wz")] == approx([-2.0, 0.0, 2.0 * PITCH, 2.0], abs=LAST_BITS)
    falls = dyn.forward_dynamics(nut).evaluate({"q0": 0.3, "qd0": 0.0, "tau0": 0.0})
    assert falls["qdd0"] == approx(-2.0 * 9.81 * PITCH / (0.5 + 2.0 * PITCH**2))


def test_locked_it_is_the_weld_that_it_stands_at() -> None:
    mechanism = screwed(("screw",))
    locked = mechanism.lock("b0", 0.7)
    graphs = [each.position("b4", (0.1, 0.2, 0.3)) for each in (mechanism, locked)]
    q = np.array([0.7, 0.3, -0.4, 0.2, 1.1])
    free, still = (
        graph.evaluate({f"q{i}": x for i, x in enumerate(values) if f"q{i}" in graph.input_names})
        for graph, values in zip(graphs, (q, q[1:]), strict=True)
    )
    assert [free[name] for name in "xyz"] == approx([still[name] for name in "xyz"])
