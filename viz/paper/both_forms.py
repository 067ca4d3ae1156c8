"""Accelerations and momenta: the two forms of the equations of motion, their sizes, and their agreement."""

from collections.abc import Mapping, Sequence

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array
from dynamics.equations.equations_of_motion import momentum
from dynamics.equations.momentum.hamiltonian import hamilton_equations
from dynamics.equations.state_equation import state_equation
from dynamics.systems.model import Model, as_system

LAGRANGE, HAMILTON, VELOCITIES_ALONE = "state equation", "Hamilton's equations", "velocities alone"
SIZES = ("nodes", "edges", "depth", "width")


def both_forms(model: Model) -> dict[str, Graph]:
    """{name: graph} of the state equation and of Hamilton's equations, both solved by elimination.

    Raises as `hamilton_equations`.
    """
    hamilton = hamilton_equations(model)  # first: it says what has none
    return {LAGRANGE: state_equation(model, "recursive"), HAMILTON: hamilton}


def form_sizes(forms: Mapping[str, Graph]) -> dict[str, dict[str, int]]:
    """The sizes of both forms, and of the velocities within Hamilton's equations, on which the rest of them stands."""
    hamilton = forms[HAMILTON]
    velocities = Graph(hamilton.inputs, {name: node for name, node in hamilton.outputs.items() if name[0] == "q"})
    return {name: size_of(graph) for name, graph in {**forms, VELOCITIES_ALONE: velocities}.items()}


def size_of(graph: Graph) -> dict[str, int]:
    """{"nodes": .., "edges": .., "depth": .., "width": ..}."""
    counts = graph.counts()
    return {size: getattr(counts, size) for size in SIZES}


def form_agreement(model: Model, forms: Mapping[str, Graph], at: Mapping[str, float]) -> dict[str, float]:
    """Differences of the two forms at a state, relative to the largest entry: of q_dot, and of p_dot and dp/dt.

    at: values of the inputs of the state equation.
    """
    system, momenta = as_system(model), momentum(model)
    lagrange, hamilton = forms[LAGRANGE], forms[HAMILTON]
    moved = lagrange.evaluate({name: at[name] for name in lagrange.input_names})
    known = {**at} | momenta.evaluate({name: at.get(name, 0.0) for name in momenta.input_names})
    found = hamilton.evaluate({name: known[name] for name in hamilton.input_names})
    states = [str(node.name) for node in (*system.q, *system.qd)]
    rated = cg.jvp(momenta, [name for name in (*states, "t") if name in momenta.input_names])
    along = known | {name: moved.get(name, 1.0) for name in rated.input_names if name.endswith("_dot")}
    rates = rated.evaluate({name: along[name] for name in rated.input_names})
    q, p = ([f"{kind}{i}_dot" for i in range(n)] for kind, n in (("q", system.nq), ("p", system.n)))
    return {"velocities": _apart(found, moved, q), "momentum_rates": _apart(found, rates, p)}


def _apart(found: Mapping[str, float | Array], expected: Mapping[str, float | Array], names: Sequence[str]) -> float:
    largest = max([abs(float(expected[name])) for name in names])
    return max([abs(float(found[name]) - float(expected[name])) for name in names]) / (largest or 1.0)
