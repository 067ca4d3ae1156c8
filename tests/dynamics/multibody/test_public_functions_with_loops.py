"""Every public function of a model, of one with a loop: of the whole, or of its tree, as its documentation says."""

import inspect
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph._shared import Array
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.simulation.gradients.gradient import Sensitivities

from ..linkages import bar, four_bar

MODEL = four_bar()
TREE = replace(MODEL, loops=())
Q, QD = nearest_state(MODEL, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
STILL = np.zeros(3)
TAU = {"tau": [0.4, 0.1, -0.2]}


def at_rest(graph: cg.Graph) -> Array:
    """Accelerations there, of the outputs of a graph."""
    arrays = dyn.arrays_at(MODEL, graph, Q, STILL, **TAU)
    return np.array([value for name, value in arrays.items() if name.startswith("qd") and name != "qd"]).ravel()


def caught() -> tuple[Array, Array]:
    load = bar("load", "coupler", 0.2, (0.4, 0.0, 0.0), kind="fixed")
    after = dyn.attach_with_impact(MODEL, Q, QD, load, velocity=(1.0, 0.0, 0.5))
    return after.q, after.qd


def moved() -> tuple[Array, Array]:
    with pytest.warns(dyn.ConstraintWarning, match="the velocities do not meet the constraints"):
        return dyn.consistent_state(MODEL, Q + 1e-3, QD + 0.1)


def ended(run: Any) -> tuple[Array, Array]:
    return run.q[..., -1, :].ravel(), run.qd[..., -1, :].ravel()


def columns(run: Sensitivities) -> tuple[Array, Array]:
    return run.q[-1], run["tau"][-1, :3]


# A configuration, and what the loop has to let through there: velocities, accelerations from rest, or columns of them.
HELD: dict[str, Callable[[], tuple[Array, Array]]] = {
    "forward_dynamics": lambda: (Q, at_rest(dyn.forward_dynamics(MODEL))),
    "state_equation": lambda: (Q, at_rest(dyn.state_equation(MODEL))),
    "as_system": lambda: (Q, at_rest(dyn.forward_dynamics(dyn.as_system(MODEL)))),
    "prune": lambda: (Q, at_rest(dyn.prune(MODEL, dyn.forward_dynamics, effects=["gravity"]).graph)),
    "with_controller": lambda: (
        Q,
        at_rest(dyn.forward_dynamics(dyn.with_controller(MODEL, lambda q, qd, t: [1.0 - q[0], 0.0, 0.0]))),
    ),
    "state_space": lambda: (Q, dyn.arrays_at(MODEL, dyn.state_space(MODEL), Q, QD, **TAU)["B"][3:]),
    "linearize_many": lambda: (Q, dyn.linearize_many(MODEL, [Q], [QD])[1][0, 3:]),
    "linearize": lambda: (Q, dyn.linearize(MODEL, Q, QD)[1][3:]),
    "reduced_linearization": lambda: (Q, dyn.reduced_linearization(MODEL, Q, QD).displacements[:3]),
    "consistent_state": moved,
    "attach_with_impact": caught,
    "simulate": lambda: ended(dyn.simulate(MODEL, Q, QD, 0.1)),
    "prepare": lambda: ended(dyn.prepare(MODEL)(Q, QD, 0.1)),
    "simulate_many": lambda: ended(dyn.simulate_many(MODEL, [Q], [QD], 0.1, t_eval=[0.1])),
    "sensitivities": lambda: columns(dyn.sensitivities(MODEL, Q, QD, 0.1, wrt=["tau"])),
    "reference": lambda: tuple(np.split(dyn.reference(MODEL, Q, QD, [0.01], digits=15).x[-1], 2)),
}
ELSEWHERE = {
    *("certify", "freedom", "raise_if_singular", "release"),  # tests of what they say
    *("gradient", "gradient_many"),  # tests of gradients, which are compared with sensitivities
    *("hamiltonian", "hamilton_equations", "conserved"),  # which refuse it, and name what it does not hold
    "to_mjcf",  # tests of files
    *("arrays_at", "display_names", "start"),  # numbers and names of any graph or model
}


def of_models() -> list[str]:
    functions = {name: getattr(dyn, name) for name in dyn.__all__ if inspect.isfunction(getattr(dyn, name))}
    first = {name: [*inspect.signature(function).parameters, ""][0] for name, function in functions.items()}
    return [name for name, argument in first.items() if argument in ("model", "mechanism")]


def held_rows(q: Array) -> Array:
    """J of the loop's rows in x and z, from how the bodies move."""
    system = MODEL.system
    graph = cg.Graph([*system.q, *system.qd], {f"{k}": system.constraints.rates[k] for k in (0, 2)})
    state = {f"q{i}": x for i, x in enumerate(q)} | {f"qd{i}": row for i, row in enumerate(np.eye(3))}
    return np.array(list(graph.evaluate(state).values()))


@pytest.mark.parametrize("name", HELD)
def test_what_is_of_the_whole_keeps_the_loop_closed(name: str) -> None:
    q, motion = HELD[name]()
    assert motion.shape[0] == 3
    assert np.abs(motion).max() > 1e-3
    assert np.abs(held_rows(q) @ motion).max() < 1e-13 * np.abs(motion).max()


@pytest.mark.parametrize("name", [name for name in of_models() if name not in HELD and name not in ELSEWHERE])
def test_what_is_of_the_tree_is_the_same_without_the_loop(name: str) -> None:
    of = ("rocker",) if name.startswith("frame_") else ()
    found, expected = (read(getattr(dyn, name)(model, *of)) for model in (MODEL, TREE))
    assert found == expected


def read(result: Any) -> Any:
    """A graph, a table or an array as something to compare."""
    if isinstance(result, np.ndarray):
        return result.tolist()
    if isinstance(result, dict):
        return result
    if hasattr(result, "grouping"):
        return result.names, result.columns.tolist(), result.grouping.tolist()
    return getattr(result, "graph", result).listing()  # tags too


def test_the_path_from_a_loop_force_to_a_joint_is_told() -> None:
    told = str(cg.why(dyn.forward_dynamics(MODEL), "lambda0", "qd0"))
    assert "lambda0" in told
    assert "qd0" in told
    assert dyn.display_names(MODEL)["lambda0"] == "lambda.coupler to rocker x"
