"""Random Lagrangians: the inverse dynamics by default, and by velocities, beside that of the paper's chain rule."""

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph import Node
from tests.dynamics.mechanisms import TREES, random_state
from tests.dynamics.models import Array, run
from tests.trust.random_motions import random_task

AGREEMENT = 1e-13  # of the largest torque
REWRITTEN = 9  # a task of which the larger graph is the smaller one once its outputs are written anew


def linkage(seed: int) -> tuple[dyn.System, Array, Array]:
    """Points on links that hang on one another or side by side from a cart, by their velocities in the plane."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    lengths, masses, springs = rng.uniform(0.3, 1.5, (3, n)).tolist()
    on = [int(rng.integers(0, i + 1)) for i in range(n)]  # 0: the cart, else the end of link on - 1
    relative = rng.random(n) < 0.5

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        turns, rates, ends = [cg.constant(0.0)], [cg.constant(0.0)], [(qd[0], cg.constant(0.0), cg.constant(0.0))]
        energy: Node = 0.5 * qd[0] ** 2 - 0.5 * springs[0] * q[0] ** 2
        for i in range(n):
            turn, rate = q[1 + i], qd[1 + i]
            if relative[i]:
                turn, rate = turns[on[i]] + turn, rates[on[i]] + rate
            x, z, height = ends[on[i]]
            x, z = x + lengths[i] * cg.cos(turn) * rate, z + lengths[i] * cg.sin(turn) * rate
            height = height - lengths[i] * cg.cos(turn)
            turns.append(turn)
            rates.append(rate)
            ends.append((x, z, height))
            energy = energy + 0.5 * masses[i] * (x**2 + z**2) - 9.81 * masses[i] * height
        return energy

    return dyn.System(lagrangian, [f"x{i}" for i in range(n + 1)]), *rng.uniform(-2.0, 2.0, (2, n + 1))


def without_velocity_nodes() -> dict[str, tuple[dyn.System, Array, Array]]:
    """Products of two coordinates, and quasi-velocities: no velocity node but qd is known, and none may be made up."""
    bent = dyn.System(
        lambda q, qd, t: (
            0.5 * (q[1] * qd[0] + q[0] * qd[1] + 2.0 * cg.sin(t)) ** 2 + 0.5 * (q[1] * qd[0]) ** 2 + qd[1] ** 2
        ),
        "x y",
    )
    balls = TREES["balls"]()
    quasi, parts = balls.system.kinematics.quasi, list(balls.system.partial_lagrangians)
    plain = dyn.System(lambda q, qd, t: parts, balls.coordinates, quasi_velocities=quasi)
    q, qd, _, _ = random_state(balls, 3)
    return {"bent": (bent, np.array([0.4, -0.7]), np.array([1.1, 0.3])), "balls": (plain, q, qd)}


def compared(model: dyn.System, q: Array, qd: Array, seed: int) -> tuple[dict[str, float], int, int]:
    """Errors over the largest torque near this state, and by how many nodes the default is smaller than both others."""
    off, qdd = np.random.default_rng(seed).normal(size=(2, len(q)))
    state = {"q": q * (1.0 + 0.01 * off), "qd": qd, "qdd": qdd, "t": 0.7}
    graphs = {"default": dyn.inverse_dynamics(model), "velocities": dyn.inverse_dynamics(model, "newton_euler")}
    chain_rule = dyn.inverse_dynamics(model, "chain_rule")
    right = run(chain_rule, state)
    errors = {
        name: float(np.abs(run(graph, state) - right).max() / np.abs(right).max()) for name, graph in graphs.items()
    }
    default, velocities = (len(graph.nodes) for graph in graphs.values())
    return errors, len(chain_rule.nodes) - default, velocities - default


@pytest.mark.parametrize("count", [8, pytest.param(200, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])])
def test_inverse_dynamics_by_default_and_by_velocities_is_that_of_the_chain_rule(count: int) -> None:
    tasks = [random_task(number) for number in {*range(count), REWRITTEN}]
    rows = {task.name: (task.model, np.array(task.q), np.array(task.qd)) for task in tasks}
    rows |= {f"linkage {seed}": linkage(seed) for seed in range(count)} | without_velocity_nodes()
    found = {name: compared(*row, seed) for seed, (name, row) in enumerate(rows.items())}
    worst = {
        each: max((errors[each], name) for name, (errors, *_) in found.items()) for each in ("default", "velocities")
    }
    smaller = sum([less > 0 for _, less, _ in found.values()])
    print(f"{len(rows)} Lagrangians, {smaller} smaller than by the chain rule: {worst}")  # noqa: T201
    assert max(worst.values())[0] < AGREEMENT
    assert {name: less for name, (_, *less) in found.items() if min(less) < 0} == {}
    assert smaller > count // 4  # the comparison is of two graphs
