"""Impedance control by the graph's own M, C, g and J: another plant then behaves as the equation that was asked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
import dynamics as dyn
from dynamics.equations.coriolis import coriolis
from tests.dynamics.models import Array

OFF = 1e-9  # m, of an error of 0.1 m: RK4's fourth power of the step
RESIDUAL = 1e-8  # N, of forces of some 10 N: the rounding of the plant's accelerations
INERTIA, DAMPING, STIFFNESS = 2.0, 20.0, 50.0  # kg, N s/m, N/m of each axis: critically damped, rate 5 /s
RATE = 5.0
STEPS, DT = 400, 1e-3  # s


def robot() -> dyn.Mechanism:
    """Three rods in the plane of x and z, with damping."""
    joints = [dyn.Joint("revolute", (0, -1, 0), (0, 0, -float(i > 0)), damping=0.3) for i in range(3)]
    rod = {"mass": 1.0, "center": (0, 0, -0.5), "inertia": (1 / 12, 1 / 12, 0)}
    return dyn.serial_arm([{"joint": joint, **rod} for joint in joints])


def target(t: float) -> tuple[Array, Array, Array]:
    """Where the tip should be, its velocity and acceleration: a circle."""
    c, s = np.cos(2.0 * t), np.sin(2.0 * t)
    return np.array([1.5 + 0.2 * c, -1.0 + 0.2 * s]), 0.4 * np.array([-s, c]), -0.8 * np.array([c, s])


class Controller:
    """tau for INERTIA e'' + DAMPING e' + STIFFNESS e = 0 of the tip's error e; damped in what the tip does not feel."""

    def __init__(self, model: dyn.Mechanism) -> None:
        system = model.system
        self.n, self.damping = system.n, np.array(system.damping)
        places = model.position("link 3", (0, 0, -1)).outputs
        tip = cg.Graph(system.q, {"x": places["x"], "z": places["z"]})
        velocity = cg.Graph([*system.q, *system.qd], cg.jvp(tip)(*system.q, *system.qd))
        drift = cg.jvp(velocity, system.q)(*system.q, *system.qd, *system.qd)
        self.tip, self.velocity = cg.compile(tip, "python"), cg.compile(velocity, "python")
        self.jacobian = cg.compile(cg.jacobian(tip), "python")
        self.drift = cg.compile(cg.Graph([*system.q, *system.qd], drift), "python")
        self.terms = [cg.compile(make(model), "python") for make in (dyn.mass_matrix, coriolis, dyn.gravity_force)]

    def task(self, q: Array, qd: Array) -> tuple[Array, Array, Array, Array]:
        """The tip's place and velocity, J, and dJ/dt qd."""
        x = np.concatenate([q, qd])
        return self.tip(q), self.velocity(x), self.jacobian(q).reshape(2, self.n), self.drift(x)

    def __call__(self, t: float, q: Array, qd: Array) -> Array:
        x = np.concatenate([q, qd])
        mass, rates, gravity = (term(x) for term in self.terms)
        mass, rates = mass.reshape(self.n, self.n), rates.reshape(self.n, self.n)
        place, velocity, jacobian, drift = self.task(q, qd)
        wanted, wanted_velocity, wanted_acceleration = target(t)
        pull = DAMPING * (wanted_velocity - velocity) + STIFFNESS * (wanted - place)
        back = np.linalg.solve(mass, jacobian.T)
        inertia = np.linalg.inv(jacobian @ back)  # of the tip
        force = inertia @ (wanted_acceleration + pull / INERTIA - drift)
        unfelt = np.eye(self.n) - jacobian.T @ inertia @ back.T
        return rates @ qd + gravity + self.damping * qd + jacobian.T @ force - unfelt @ (2.0 * qd)


def closed_loop(accelerations: Callable[[Array, Array, Array], Array]) -> tuple[float, float]:
    """The largest residual of the impedance equation on the way [N], and how far e is from its solution at the end."""
    model = robot()
    control, n = Controller(model), model.system.n

    def rate(t: float, x: Array) -> Array:
        return np.concatenate([x[n:], accelerations(x[:n], x[n:], control(t, x[:n], x[n:]))])

    x = np.array([0.9, 0.5, 0.4, 0.1, -0.2, 0.3])
    worst = 0.0
    first: tuple[Array, Array] | None = None
    for step in range(STEPS + 1):
        t = step * DT
        k1 = rate(t, x)
        place, velocity, jacobian, drift = control.task(x[:n], x[n:])
        wanted, wanted_velocity, wanted_acceleration = target(t)
        e, e_dot = wanted - place, wanted_velocity - velocity
        e_ddot = wanted_acceleration - (jacobian @ k1[n:] + drift)
        first = first or (e, e_dot)
        worst = max(worst, float(np.abs(INERTIA * e_ddot + DAMPING * e_dot + STIFFNESS * e).max()))
        if step == STEPS:
            break
        k2 = rate(t + DT / 2, x + DT / 2 * k1)
        k3 = rate(t + DT / 2, x + DT / 2 * k2)
        x = x + DT / 6 * (k1 + 2 * k2 + 2 * k3 + rate(t + DT, x + DT * k3))
    expected = (first[0] + (first[1] + RATE * first[0]) * t) * np.exp(-RATE * t)
    return worst, float(np.abs(e - expected).max())


def test_on_our_own_plant() -> None:
    forward = cg.compile(dyn.forward_dynamics(robot()), "python")
    residual, off = closed_loop(lambda q, qd, tau: forward(np.concatenate([q, qd, tau])))
    assert residual < RESIDUAL
    assert off == approx(0.0, abs=OFF)


def test_on_mujoco_s_plant(record_property: Callable[[str, object], None]) -> None:
    pytest.importorskip("mujoco")
    from dynamics.io.mujoco_twin import MujocoTwin

    residual, off = closed_loop(MujocoTwin(robot()).accelerations)
    record_property("residual [N]", residual)
    print(f"residual {residual:.1e} N, off the solution {off:.1e} m")  # noqa: T201
    assert residual < RESIDUAL
    assert off < OFF
