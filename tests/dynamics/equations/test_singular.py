"""Mass matrices that are not positive definite at one state: seen, and the coordinate named."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.equations_of_motion import (
    SOLUTIONS,
    SingularMassMatrixError,
    forward_dynamics,
    raise_if_singular,
)

METHODS = [name for name in SOLUTIONS if name != "auto"]


def accelerations(system: dyn.System, method: str, **values: float) -> dict[str, float]:
    """The outputs at a state that is zero but for `values`, checked."""
    graph = forward_dynamics(system, method, check=True)
    result = graph.evaluate(dict.fromkeys(graph.input_names, 0.0) | system.parameters | values)
    raise_if_singular(system, result["info"])
    return result


@pytest.mark.parametrize("method", METHODS)
def test_an_inertia_that_vanishes_at_one_state_is_found_there(method):
    system = dyn.System(lambda q, qd, t: 0.5 * qd[0] * qd[0] * q[0], ["slider"])
    assert accelerations(system, method, q0=0.5, tau0=1.0)["qdd0"] == 2.0
    for place in (0.0, -0.5, math.nan):
        with pytest.raises(SingularMassMatrixError, match="not positive definite: coordinate 'slider'"):
            accelerations(system, method, q0=place, tau0=1.0)


@pytest.mark.parametrize("method", METHODS)
def test_a_negative_inertia_is_found_though_the_result_is_finite(method):
    system = dyn.System(lambda q, qd, t: 0.5 * qd[0] * qd[0] * cg.cos(q[0]), ["joint"])
    accelerations(system, method, q0=1.5)
    with pytest.raises(SingularMassMatrixError, match="joint"):
        accelerations(system, method, q0=1.6)


def two_points(inner: float) -> dyn.System:
    """A double pendulum of two points, the inner of the given mass, on rods of 1 m; q1 is relative to the first rod."""

    def lagrangian(q, qd, t, p):
        first, second = q[0], q[0] + q[1]
        x = qd[0] * cg.cos(first) + (qd[0] + qd[1]) * cg.cos(second)
        y = qd[0] * cg.sin(first) + (qd[0] + qd[1]) * cg.sin(second)
        return 0.5 * p["inner"] * qd[0] * qd[0] + 0.5 * (x * x + y * y)

    return dyn.System(lagrangian, ["shoulder", "elbow"], {"inner": inner})


@pytest.mark.parametrize("method", METHODS)
def test_a_massless_point_on_a_straight_rod_has_no_acceleration(method):
    bent = accelerations(two_points(0.0), method, q1=1.0, tau0=1.0)
    assert math.isfinite(bent["qdd0"])
    with pytest.raises(SingularMassMatrixError, match="shoulder"):
        accelerations(two_points(0.0), method, tau0=1.0)
    assert accelerations(two_points(0.5), method, tau0=1.0)["qdd0"] == 2.0


@pytest.mark.parametrize("method", METHODS)
def test_a_negative_mass_is_found(method):
    with pytest.raises(SingularMassMatrixError, match="shoulder"):
        accelerations(two_points(-0.1), method, q1=0.1)


def string(n: int) -> dyn.System:
    """n beads on a line, each sprung and coupled to the next, of masses m0 .. ."""
    names = [f"m{i}" for i in range(n)]

    def lagrangian(q, qd, t, p):
        kinetic = [0.5 * p[name] * v * v for name, v in zip(names, qd, strict=True)]
        coupling = [0.05 * (a - b) * (a - b) for a, b in pairwise(qd)]
        return [*kinetic, *coupling]

    return dyn.System(lagrangian, [f"bead {i}" for i in range(n)], dict.fromkeys(names, 1.0))


def test_the_first_of_thirty_that_fails_is_named_in_a_batch_with_its_state():
    system = string(30)
    graph = forward_dynamics(system, check=True)
    assert len(graph.nodes) <= len(forward_dynamics(system).nodes) + 3 * 30 + 1
    columns = np.array([[system.parameters.get(name, 0.1)] * 4 for name in graph.input_names])
    columns[graph.input_names.index("m17"), 2] = -1.0
    columns[graph.input_names.index("m4"), 2] = -1.0
    run = cg.compile(graph)
    pivot = run.batch(columns)[list(graph.outputs).index("info")]
    assert pivot.tolist() == [0.0, 0.0, 18.0, 0.0]
    raise_if_singular(system, pivot[:2])
    with pytest.raises(SingularMassMatrixError, match="at state 2: coordinate 'bead 17'"):
        raise_if_singular(system, pivot)
    for name, column in zip(["m0", "m29"], columns.T, strict=False):
        column[graph.input_names.index(name)] = -1.0
        assert system.coordinates[int(run(column)[-1]) - 1] == f"bead {name[1:]}"


def test_the_pivots_say_what_the_eigenvalues_say():
    system = string(6)
    graph, matrix = forward_dynamics(system, "recursive", check=True), dyn.mass_matrix(system)
    rng = np.random.default_rng(0)
    signs = set()
    for _ in range(40):
        masses = dict(zip(system.parameters, rng.uniform(-0.1, 1.0, 6), strict=True))
        values = dict.fromkeys(graph.input_names, 0.3) | masses
        entries = matrix.evaluate({name: values[name] for name in matrix.input_names})
        positive = np.linalg.eigvalsh(np.reshape(list(entries.values()), (6, 6))).min() > 0
        assert (graph.evaluate(values)["info"] == 0.0) == positive
        signs.add(bool(positive))
    assert signs == {True, False}


def test_without_asking_nothing_is_added():
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    assert "info" not in forward_dynamics(arm).outputs


def test_a_coordinate_without_inertia_is_an_error_at_once():
    system = dyn.System(lambda q, qd, t: 0.5 * qd[0] * qd[0] - qd[1] * qd[1], ["good", "bad"])
    assert len(forward_dynamics(system).outputs) == 2
    with pytest.raises(SingularMassMatrixError, match="not positive definite: coordinate 'bad'"):
        forward_dynamics(system, check=True)
