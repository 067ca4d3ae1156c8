"""The state equation: the first-order form xdot = f(x, t) of any model, as one graph."""

from __future__ import annotations

from typing import NamedTuple

from cgraph import Graph

from ..systems.model import Model, as_ode, as_system
from ..systems.system import TIME
from .equations_of_motion import forward_dynamics


def state_equation(model: Model) -> Graph:
    """The rates of a model's state.

    A System, or what has one: inputs q0.., qd0.., tau0.., t if needed, parameters; outputs q0_dot.., qd0_dot.. with
    q_dot = qd and qd_dot from `forward_dynamics`. An OdeSystem: inputs its states, t if needed, parameters; outputs
    `<state>_dot`.

    Raises SingularMassMatrixError for a coordinate without inertia, TypeError for what is no model.
    """
    ode = as_ode(model)
    if ode is not None:
        return ode.graph
    system = as_system(model)
    accelerations = forward_dynamics(system)
    outputs = {f"q{i}_dot": qd for i, qd in enumerate(system.qd)}
    outputs |= {f"qd{i}_dot": accelerations.outputs[f"qdd{i}"] for i in range(system.n)}
    return Graph(accelerations.inputs, outputs)


class Inputs(NamedTuple):
    """What the inputs of a state equation are, in the order of the graph."""

    states: tuple[str, ...]  # as many as outputs, and in their order
    applied: tuple[str, ...]  # tau0.., constant during a run
    timed: bool  # whether t is an input
    parameters: dict[str, float]  # with the model's own values


def state_inputs(model: Model) -> Inputs:
    """The names behind `state_equation(model)`, without building it."""
    ode = as_ode(model)
    if ode is not None:
        return Inputs(ode.states, (), ode.extra_inputs[:1] == [ode.t], dict(ode.parameters))
    system = as_system(model)
    states = tuple([str(node.name) for node in (*system.q, *system.qd)])
    applied = tuple([str(node.name) for node in system.tau])
    timed = TIME in [node.name for node in system.extra_inputs[:1]]
    return Inputs(states, applied, timed, dict(system.parameters))
