"""The balanced order of elimination on bodies: how deep, how many nodes, how exact; equal to the recursive one."""

from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.autodiff import balanced_elimination
from cgraph.extend import solve_nodes
from dynamics import as_system
from dynamics.systems.model import as_ode
from tests import high_precision
from tests.each_row import each_row
from tests.slow import slow
from tests.tolerances import SOLVED
from viz.paper.mechanisms import chain

from .test_hamiltonian import CASES, EQUAL, near, point, random_tree, values

DIGITS = 60


def solves(model: dyn.Mechanism) -> dict[str, cg.Graph]:
    """M^-1 tau by both orders."""
    system = as_system(model)
    return {
        order: cg.simplify(
            system.graph(
                {f"x{i}": x for i, x in enumerate(solve_nodes(system.lagrangian, system.qd, system.tau, order=order))},
                system.q,
                system.tau,
            )
        )
        for order in ("recursive", "balanced")
    }


def test_of_a_planar_chain_a_few_operations_of_depth_are_left_for_each_link() -> None:
    counts = {n: {order: g.counts() for order, g in solves(chain(0.1, 0.1, n)).items()} for n in (25, 50)}
    sizes = {order: (each.nodes, each.depth) for order, each in counts[50].items()}
    assert sizes == {"recursive": (3440, 566), "balanced": (5922, 175)}
    assert sizes["balanced"][1] - counts[25]["balanced"].depth <= 46  # of 25 links


@pytest.mark.slow
def test_a_planar_chain_of_a_thousand_links() -> None:
    """Depth 1209 in place of 11 491, for less than twice the nodes."""
    counts = {order: graph.counts() for order, graph in solves(chain(0.1, 0.1, 1000)).items()}
    assert counts["recursive"].depth > 11_000
    assert counts["balanced"].depth <= 1250
    assert counts["balanced"].nodes <= 2 * counts["recursive"].nodes


def test_both_forms_of_the_equations_of_motion_become_shallow() -> None:
    arm = chain(0.1, 0.1, 50)
    depths = [derive(arm, "balanced").counts().depth for derive in (dyn.forward_dynamics, dyn.hamilton_equations)]
    assert depths == [175, 223]


def test_it_loses_no_digits() -> None:
    """Beside 60 digits, bent and nearly straight."""
    graphs = solves(chain(0.1, 0.1, 50))
    for spread in (1.0, 1e-3):
        rng = np.random.default_rng(0)
        at = {
            name: rng.uniform(-1.0, 1.0) * (spread if name[0] == "q" else 1.0)
            for name in graphs["balanced"].input_names
        }
        exact = np.array([float(x) for x in high_precision.evaluate(graphs["recursive"], at, DIGITS).values()])
        for graph in graphs.values():
            found = np.array(list(graph.evaluate(at).values()))
            assert np.abs(found - exact).max() < EQUAL * np.abs(exact).max()


def equal_by_both_orders(model: Any, leaf: float, seed: int = 1) -> None:
    """In pieces of so many variables."""
    for derive in (dyn.forward_dynamics, dyn.hamilton_equations):
        with patch.object(balanced_elimination, "LEAF", leaf):
            graphs = [derive(model, method) for method in ("recursive", "balanced")]
        at = point(model, graphs, seed)
        first, second = (values(graph, at, "qdd" if derive is dyn.forward_dynamics else "") for graph in graphs)
        near(second, first, SOLVED / EQUAL * np.abs(first).max())


@each_row("name", CASES)
def test_models_move_alike(name: str) -> None:
    model = CASES[name]()
    if as_ode(model) is None and not len(as_system(model).constraints):
        equal_by_both_orders(model, 0.2)


@pytest.mark.parametrize("seed", [2, *slow(*range(3, 200))])
def test_random_trees_move_alike(seed: int) -> None:
    equal_by_both_orders(random_tree(seed, 6 if seed == 2 else 12), (0.5, 1.8, 0.2)[seed % 3], seed)


def test_constraints_have_no_balanced_order() -> None:
    rod = dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2),
        "x y",
        constraints=lambda q, t: {"rod": 0.5 * (q[0] ** 2 + q[1] ** 2 - 1.0)},
    )
    with pytest.raises(
        ValueError, match="method \"balanced\" needs a system without constraints, got constraint 'rod'"
    ):
        dyn.forward_dynamics(rod, "balanced")
