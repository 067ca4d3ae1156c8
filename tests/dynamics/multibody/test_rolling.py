"""Rolling: the benchmark bicycle, a disk, and what a plane holds."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.states.consistent_state import nearest_state

Array = np.ndarray[Any, np.dtype[np.float64]]
DOWN = (0.0, 0.0, 9.81)  # z is down
ACROSS = (0.0, 1.0, 0.0)
ROLL, STEER, REAR, FRONT = 4, 7, 6, 8  # coordinates of the bicycle
RADII = 0.3, 0.35
PUBLISHED_MODES = {  # table 2, by the speed [m/s]
    0.0: [-5.53094371765393, -3.13164324790656, 3.13164324790656, 5.53094371765393],
    5.0: [-14.07838969279822, -0.77534188219585 - 4.46486771378823j, -0.77534188219585 + 4.46486771378823j]
    + [-0.32286642900409],
}


def inertia(xx: float, yy: float, zz: float, xz: float = 0.0) -> list[list[float]]:
    return [[xx, 0.0, xz], [0.0, yy, 0.0], [xz, 0.0, zz]]


@cache
def bicycle() -> dyn.Mechanism:
    """J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, Proc. R. Soc. A 463, 2007: table 1."""
    base, trail, tilt = 1.02, 0.08, math.pi / 10.0
    steering = (math.sin(tilt), 0.0, math.cos(tilt))

    def hinge(axis: Any, place: Any = (0.0, 0.0, 0.0)) -> dyn.Joint:
        return dyn.Joint("revolute", axis, place)

    slides = [dyn.Joint("prismatic", axis) for axis in np.eye(3)]
    bodies = [dyn.Body("x", slides[0]), dyn.Body("y", slides[1], "x"), dyn.Body("z", slides[2], "y")]
    bodies += [
        dyn.Body("yaw", hinge((0.0, 0.0, 1.0)), "z"),
        dyn.Body("roll", hinge((1.0, 0.0, 0.0)), "yaw"),
        dyn.Body("frame", hinge(ACROSS), "roll", 85.0, (0.3, 0.0, -0.9), inertia(9.2, 11.0, 2.8, 2.4)),
        dyn.Body("rear", hinge(ACROSS, (0, 0, -RADII[0])), "frame", 2.0, (0, 0, 0), inertia(0.0603, 0.12, 0.0603)),
        dyn.Body(
            "fork",
            hinge(steering, (base + trail, 0.0, 0.0)),
            "frame",
            4.0,
            (0.9 - base - trail, 0.0, -0.7),
            inertia(0.05892, 0.06, 0.00708, -0.00756),
        ),
        dyn.Body("front", hinge(ACROSS, (-trail, 0, -RADII[1])), "fork", 3.0, (0, 0, 0), inertia(0.1405, 0.28, 0.1405)),
    ]
    wheels = zip(("rear", "front"), RADII, strict=True)
    loops = [dyn.Loop("rolling", name, axis=ACROSS, to_axis=(0, 0, -1), length=radius) for name, radius in wheels]
    return dyn.Mechanism(bodies, DOWN, loops=loops)


def straight(speed: float) -> dict[str, float]:
    at = {f"{kind}{i}": 0.0 for kind in ("q", "qd", "tau") for i in range(9)}
    return at | {"qd0": speed, f"qd{REAR}": -speed / RADII[0], f"qd{FRONT}": -speed / RADII[1]}


def slopes(graph: cg.Graph, inputs: list[str], at: dict[str, float]) -> Array:
    values = cg.jacobian(graph, inputs).evaluate({name: at[name] for name in graph.input_names})
    return np.array(list(values.values())).reshape(len(graph.outputs), len(inputs))


def test_the_benchmark_bicycle_has_the_published_matrices_and_eigenvalues() -> None:
    """M, C1, K0, K2 of M x'' + v C1 x' + (g K0 + v^2 K2) x = f for roll and steer, and the modes of table 2."""
    model = bicycle()
    system, rate = model.system, dyn.state_equation(model)
    rows = cg.Graph([*system.q, *system.qd], {f"{k}": row for k, row in enumerate(system.constraints.rates)})
    states = [str(node.name) for node in (*system.q, *system.qd)]
    matrix = cg.Graph(rate.inputs, {f"qd{i}_dot": rate.outputs[f"qd{i}_dot"] for i in (ROLL, STEER)})
    at = straight(5.0)
    inverse = slopes(matrix, [f"tau{ROLL}", f"tau{STEER}"], at)
    mass = np.linalg.inv(inverse)
    given = [ROLL, STEER, 9 + ROLL, 9 + STEER]

    def stiffness(speed: float) -> Array:
        """M d(roll'', steer'')/d(roll, steer, roll', steer'), along motions that the rows allow."""
        fixed = [*given, *[i for i in range(9) if i not in given], 9 + REAR]
        held, free = slopes(rows, states, straight(speed)), [i for i in range(18) if i not in fixed]
        along = np.zeros((18, 4))
        along[given] = np.eye(4)
        along[free] = -np.linalg.lstsq(held[:, free], held[:, given])[0]
        assert np.abs(held @ along).max() < 1e-12
        result: Array = -mass @ slopes(matrix, states, straight(speed)) @ along
        return result

    slow, fast = stiffness(0.0), stiffness(5.0)
    published = {
        "M": ([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]], mass),
        "C1": ([[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]], fast[:, 2:] / 5.0),
        "K0": ([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]], slow[:, :2] / 9.81),
        "K2": ([[0.0, 76.59734589573222], [0.0, 2.65431523794604]], (fast - slow)[:, :2] / 25.0),
    }
    for name, (expected, found) in published.items():
        assert found == pytest.approx(np.array(expected), abs=1e-11), name
    for speed, expected in PUBLISHED_MODES.items():
        eigenvalues = np.linalg.eigvals(slopes(rate, states, straight(speed)))
        for mode in expected:
            assert np.abs(eigenvalues - mode).min() < 1e-10 * abs(mode)


@cache
def disk(radius: float = 0.4, mass: float = 1.5) -> dyn.Mechanism:
    """A uniform thin disk on a plane, in axes of heading, lean and spin."""
    moments = (0.25 * mass * radius**2, 0.5 * mass * radius**2, 0.25 * mass * radius**2)
    slides = [dyn.Joint("prismatic", axis) for axis in np.eye(3)]
    bodies = [dyn.Body("x", slides[0]), dyn.Body("y", slides[1], "x"), dyn.Body("z", slides[2], "y")]
    bodies += [
        dyn.Body("heading", dyn.Joint("revolute", (0.0, 0.0, 1.0)), "z"),
        dyn.Body("lean", dyn.Joint("revolute", (1.0, 0.0, 0.0)), "heading"),
        dyn.Body("disk", dyn.Joint("revolute", ACROSS), "lean", mass, (0.0, 0.0, 0.0), moments),
    ]
    return dyn.Mechanism(bodies, loops=[dyn.Loop("rolling", "disk", axis=ACROSS, length=radius)])


@pytest.mark.parametrize(("share", "falls"), [(0.98, True), (1.02, False)])
def test_a_disk_rolls_upright_above_the_classical_speed(share: float, falls: bool) -> None:
    """v^2 = g r / 3 (E. J. Routh, The Advanced Part of a Treatise on the Dynamics of a System of Rigid Bodies)."""
    model, radius = disk(), 0.4
    speed = math.sqrt(share * 9.81 * radius / 3.0)
    at = {f"{kind}{i}": 0.0 for kind in ("q", "qd", "tau") for i in range(6)}
    at |= {"q2": radius, "qd0": speed, "qd5": speed / radius}
    rate = dyn.state_equation(model)
    eigenvalues = np.linalg.eigvals(slopes(rate, [f"{kind}{i}" for kind in ("q", "qd") for i in range(6)], at))
    assert (eigenvalues.real.max() > 0.3) == falls


def test_a_disk_rolls_on_without_slip_and_keeps_its_energy() -> None:
    model = disk()
    start = [0.0, 0.0, 0.4 * math.cos(0.3), 0.2, 0.3, 0.0], [0.0, 0.0, 0.0, 1.5, 0.1, 6.0]
    run = dyn.simulate(model, *nearest_state(model, *start), 3.0, rtol=1e-10)
    rates = {f"row{k}": z for k, z in enumerate(model.system.constraints.rates)}
    rows = model.system.graph(rates, model.system.q, model.system.qd)
    assert np.abs(dyn.arrays_at(model, rows, run.q, run.qd)["row"]).max() < 1e-13
    assert run.energy == pytest.approx(run.energy[0], rel=1e-8)
