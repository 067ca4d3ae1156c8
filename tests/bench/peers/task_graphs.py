"""Our graphs of the tasks, for our own machine code and for what others make of the same nodes."""

from __future__ import annotations

import numpy as np

import cgraph as cg
from cgraph import Graph
from dynamics.equations.equations_of_motion import forward_dynamics
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.equations.linearization.inverse_dynamics_derivatives import inverse_dynamics_derivatives
from dynamics.equations.linearization.linearization import state_space
from dynamics.equations.state_equation import state_equation
from dynamics.systems.model import Model
from tests.bench.peers.peer import NUDGE, PeerModel, rk4_step


def task_graph(case: PeerModel, task: str) -> Graph:
    """Our graph of a task."""
    if task == "rk4":
        return step_graph(rate_graph(case))
    if task == "derivatives":
        return slope_graph(case)
    make = {"inverse": inverse_dynamics, "forward": forward_dynamics, "inverse-derivatives": _inverse_derivatives}
    return case.bound(make[task](case.model))


def slope_graph(case: PeerModel) -> Graph:
    """(q0.., qd0.., tau0..) -> dqdd/d(q, qd, tau), row by row."""
    matrices, n = case.bound(state_space(case.model)), case.n
    names = [f"A_{i}_{j}" if j < 2 * n else f"B_{i}_{j - 2 * n}" for i in range(n, 2 * n) for j in range(3 * n)]
    return Graph(matrices.inputs, {name: matrices.outputs[name] for name in names})


def _inverse_derivatives(model: Model) -> Graph:
    graph = inverse_dynamics_derivatives(model)
    n = sum(name.startswith("tau") for name in graph.outputs)
    names = [f"{block}_{i}_{j}" for i in range(n) for block in ("dtau_dq", "dtau_dqd", "M") for j in range(n)]
    return cg.simplify(Graph(graph.inputs, {name: graph.outputs[name] for name in names}))


def rate_graph(case: PeerModel) -> Graph:
    """(q0.., qd0..) -> their rates without applied torque."""
    return cg.specialize(case.bound(state_equation(case.model)), {f"tau{i}": 0.0 for i in range(case.n)})


def step_graph(rate: Graph) -> Graph:
    """(q0.., qd0.., tau0..) -> (q0_next.., qd0_next..), one RK4 step; torques only where the rate takes them."""
    x = cg.variables(rate.input_names)
    width = len(rate.outputs)
    after = rk4_step(lambda at: np.array([*rate(*at, *x[width:]).values()]), np.array(x[:width]))
    return cg.simplify(Graph(x, {f"{node.name}_next": y for node, y in zip(x, after, strict=False)}))


def carried(case: PeerModel, task: str, graph: Graph) -> Graph:
    """What the inputs of a task become in one pass of a loop: the state after the step, or a nudged input."""
    if task == "rk4":
        return graph
    results = list(graph.outputs.values())
    nudged = [x + NUDGE * results[i] for x, i in zip(graph.inputs, case.nudges(task), strict=True)]
    return Graph(graph.inputs, {f"{node.name}_next": after for node, after in zip(graph.inputs, nudged, strict=True)})
