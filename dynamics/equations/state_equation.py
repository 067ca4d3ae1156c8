"""The state equation: the first-order form xdot = f(x, t) of any model, as one graph."""

from __future__ import annotations

from typing import NamedTuple

from cgraph import Graph
from cgraph._shared import kept_by_first, require_choice

from ..systems.arguments import TIME
from ..systems.kinematics import ZERO
from ..systems.model import Equations, Model, as_equations, as_system
from ..systems.system import System
from .constraints.constraints import leave_no_motion
from .equation import Equation, Output, called
from .equations_of_motion import SOLUTIONS, forward_dynamics

FORMS = ("velocity", "momentum")  # of a motion: states (q, qd) or (q, p)


@Equation(
    "q qd tau", Output("q{}_dot", ("nq",), "rad/s or m/s"), Output("qd{}_dot", ("n",), "rad/s^2 or m/s^2")
).describes
def state_equation(model: Model, method: str = "auto") -> Graph:
    """The time derivative of a model's state, xdot = f(x, tau, t).

    Parameters
    ----------
    model : Model
        A system, a mechanism, a scene, or a first-order system.
    method : {"auto", "recursive", "dense", "balanced"}
        How accelerations are solved for, as of `forward_dynamics`; a first-order system has none.

    Returns
    -------
    q_dot is qd, or G(q) qd of `QuasiVelocities`, and qd_dot that of `forward_dynamics`, 0 where constraints that do not
    depend on time leave no motion. Of an OdeSystem: inputs its states, t if needed, parameters; outputs `<state>_dot`.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.
    ValueError
        For an unknown method, or one that takes no constraints.
    TypeError
        For what is no model.

    Examples
    --------
    >>> import dynamics as dyn
    >>> block = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2, ["x"])
    >>> dyn.state_equation(block).evaluate({"q0": 0.0, "qd0": 2.0, "tau0": 8.0})
    {'q0_dot': 2.0, 'qd0_dot': 2.0}
    """
    require_choice("method", method, SOLUTIONS)
    return called(with_multipliers(as_equations(model), method)[0], model)


def with_multipliers(model: Equations, method: str = "auto") -> tuple[Graph, Graph | None]:
    """The state equation, and over the same inputs the multipliers of its constraints by name; None without any."""
    if model.ode is not None:
        return model.ode.graph, None
    system = as_system(model)
    solved = forward_dynamics(system, method)
    outputs = {f"q{i}_dot": rate for i, rate in enumerate(system.q_dot)}
    still = leave_no_motion(system)  # the rounding of accelerations that are 0 is all that steps could be chosen by
    outputs |= {f"qd{i}_dot": ZERO if still else solved.outputs[f"qdd{i}"] for i in range(system.n)}
    multipliers = {name: solved.outputs[f"lambda{k}"] for k, name in enumerate(system.constraints.names)}
    return Graph(solved.inputs, outputs), Graph(solved.inputs, multipliers) if multipliers else None


def normalization(model: Model) -> Graph | None:
    """A state to the same one with the constraint of its coordinates met, as unit quaternions; None without any.

    Inputs and outputs the states.
    """
    return None if model.system is None else _normalization(model.system)


@kept_by_first
def _normalization(system: System) -> Graph | None:
    quasi = system.kinematics.quasi
    if quasi is None or quasi.normalized is None:
        return None
    states = [*system.kinematics.normalized(system.q), *system.qd]
    return Graph([*system.q, *system.qd], {f"x{k}": node for k, node in enumerate(states)})


class StateInputs(NamedTuple):
    """Inputs of a state equation by what they are, in the order of the graph."""

    states: tuple[str, ...]  # as many as outputs, and in their order
    applied: tuple[str, ...]  # tau0.., constant during a run
    timed: bool  # whether t is an input
    parameters: dict[str, float]  # with the model's own values


def state_inputs(model: Model) -> StateInputs:
    """The names behind `state_equation(model)`, without building it."""
    if (ode := model.ode) is not None:
        return StateInputs(ode.states, (), ode.extra_inputs[:1] == [ode.t], dict(ode.parameters))
    system = as_system(model)
    return _inputs_of(system)._replace(parameters=dict(system.parameters))  # which a person may change


@kept_by_first
def _inputs_of(system: System) -> StateInputs:
    states = tuple([str(node.name) for node in (*system.q, *system.qd)])
    applied = tuple([str(node.name) for node in system.tau])
    timed = TIME in [node.name for node in system.extra_inputs[:1]]
    return StateInputs(states, applied, timed, {})
