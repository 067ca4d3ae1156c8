"""Elimination in pieces: it solves the same equations as the matrix does, is shallow, and loses no digits."""

import numpy as np
import pytest

import cgraph as cg
from cgraph.autodiff import balanced_elimination
from cgraph.autodiff.hessian_solve import solve_nodes
from cgraph.autodiff.jacobian import hessian_nodes
from cgraph.autodiff.symmetric_elimination import SingularError
from cgraph.core.traversal import topological
from tests.each_row import each_row
from tests.tolerances import EQUATIONS, LONG_SUM

from .test_hessian_solve import FUNCTIONS, turning

SMALL = 0.2  # variables of a piece for each unknown that crosses: every variable is a piece, which no model needs


@pytest.fixture
def small_pieces(monkeypatch):
    monkeypatch.setattr(balanced_elimination, "LEAF", SMALL)


def running(x, rng, branches=0.0, still=0.0):
    """A function of running states: each is made of an earlier one, and has energies of its own; some variables none.

    branches: how often a state goes on from any earlier one.  still: how often it has no energy.
    """
    states = [(cg.constant(0.0), cg.constant(1.0))]
    total = cg.constant(0.0)
    for k, node in enumerate(x):
        at = int(rng.integers(0, k + 1)) if rng.uniform() < branches else k
        a, b = states[at]
        turn = float(rng.normal())
        c, s = cg.cos(cg.variable("angle") + turn), cg.sin(cg.variable("angle") + turn)
        a, b = c * a + s * b, c * b - s * a
        a, b = a + node * float(rng.uniform(0.5, 1.5)), b + 0.3 * cg.sin(node) if rng.uniform() < 0.5 else b - node
        states.append((a, b))
        if rng.uniform() >= still or k == len(x) - 1:
            total = total + float(rng.uniform(0.5, 2.0)) * (a * a + b * b) + 0.1 * cg.cosh(a - b) + 0.5 * node * node
    return total


def missing(total, x, values, rhs, **how):
    """How far H x is from the right-hand side, of the largest product in it."""
    solved = solve_nodes(total, x, [cg.constant(b) for b in rhs], **how)
    inputs = [node for node in topological([total]) if node.op.name == "variable"]
    inputs += [node for node in x if node not in inputs]
    graph = cg.Graph(inputs, {f"{i}": node for i, node in enumerate(solved)})
    at = {str(node.name): values[str(node.name)] for node in inputs}
    lower = hessian_nodes(total, x)
    entries = cg.Graph(inputs, {f"{i} {j}": lower[max(i, j)][min(i, j)] for i in range(len(x)) for j in range(len(x))})
    hessian = np.reshape(list(entries.evaluate(at).values()), (len(x), len(x)))
    found = np.array(list(graph.evaluate(at).values()))
    return np.abs(hessian @ found - rhs).max() / (np.abs(hessian) @ np.abs(found)).max()


@pytest.mark.usefixtures("small_pieces")
@each_row("name", [*FUNCTIONS, "turning"])
def test_functions_of_all_kinds_are_solved_in_pieces(name):
    function, n = (lambda m, *x: turning(m, 0.3, -0.8, x), 5) if name == "turning" else FUNCTIONS[name]
    x = cg.variables([f"x{i}" for i in range(n)])
    rng = np.random.default_rng(3)
    for _ in range(3):
        values = {f"x{i}": value for i, value in enumerate(rng.uniform(-0.6, 0.6, n))}
        assert missing(function(cg, *x), x, values, rng.normal(size=n), order="balanced") < LONG_SUM


@each_row(
    ("leaf", "branches", "still"),
    [(SMALL, 0.0, 0.4), (SMALL, 0.4, 0.0), (balanced_elimination.LEAF, 0.4, 0.4), (SMALL, 0, 0)],
)
def test_chains_and_trees_are_solved_in_pieces(monkeypatch, leaf, branches, still):
    """Some of them with variables that have no inertia before others have left."""
    monkeypatch.setattr(balanced_elimination, "LEAF", leaf)
    for seed in range(1 + (leaf == SMALL)):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(8, 12))
        x = cg.variables([f"x{i}" for i in range(n)])
        total = running(x, rng, branches, still) + 0.01 * sum([v * v for v in x], cg.constant(0.0)) * (still > 0)
        values = {f"x{i}": float(v) for i, v in enumerate(rng.uniform(-0.3, 0.3, n))} | {"angle": 0.4}
        assert missing(total, x, values, rng.normal(size=n), order="balanced") < EQUATIONS, seed


@pytest.mark.usefixtures("small_pieces")
def test_variables_without_inertia_wait_for_the_piece_that_gives_them_some():
    """A running sum of variables with squares at every third sum alone, and none but constants: exact, to rounding."""
    n = 12
    x, total, at = cg.variables([f"x{i}" for i in range(n)]), cg.constant(0.0), cg.constant(0.0)
    for k, node in enumerate(x):
        at = at + node
        total = total + at * at * (1.0 + k) + (node * node * 2.0 if k % 3 == 0 else 0.0)
    assert missing(total, x, dict.fromkeys([f"x{i}" for i in range(n)], 0.0), np.arange(1.0, n + 1)) < LONG_SUM
    rhs = np.arange(1.0, n + 1)
    assert missing(total, x, dict.fromkeys([f"x{i}" for i in range(n)], 0.0), rhs, order="balanced") < LONG_SUM
    with pytest.raises(SingularError):
        solve_nodes(x[0] * x[0] + x[1], x[:2], [cg.constant(1.0)] * 2, order="balanced")


@pytest.mark.usefixtures("small_pieces")
def test_right_hand_sides_at_inner_nodes_cross_between_pieces():
    rng = np.random.default_rng(2)
    x = cg.variables([f"x{i}" for i in range(9)])
    total = running(x, rng)
    at = {node: cg.constant(float(rng.normal())) for node in topological([total]) if node.op.name == "add"}
    solved = [solve_nodes(total, x, [cg.constant(1.0)] * 9, at=at, order=order) for order in ("recursive", "balanced")]
    angle = cg.variable("angle")
    graph = cg.Graph([angle, *x], {f"{k} {i}": node for k, nodes in enumerate(solved) for i, node in enumerate(nodes)})
    found = np.reshape(list(graph.evaluate(dict.fromkeys(graph.input_names, 0.2)).values()), (2, 9))
    assert found[1] == pytest.approx(found[0], rel=0.0, abs=EQUATIONS * np.abs(found[0]).max())


def info(total, inputs, x, values):
    *_, node = solve_nodes(total, x, [cg.constant(1.0)] * len(x), check=True, order="balanced")
    return cg.Graph(inputs, {"info": node}).evaluate(values)["info"]


@pytest.mark.usefixtures("small_pieces")
def test_a_matrix_that_is_not_positive_definite_is_told():
    """Of 16 random ones, by their eigenvalues; that of positive pieces is told apart from every other."""
    told = {True: 0, False: 0}
    for seed in range(16):
        rng = np.random.default_rng(seed)
        x, m = cg.variables([f"x{i}" for i in range(8)]), cg.variable("m")
        total, at = cg.constant(0.0), cg.constant(0.0)
        for k, node in enumerate(x):
            at = at * float(rng.uniform(0.5, 1.5)) + node
            total = total + at * at * (m if k == 4 else 1.0) + 0.5 * node * node
        mass = float(rng.uniform(-1.5, 0.5))
        names = ["m", *[f"x{i}" for i in range(8)]]
        values = dict.fromkeys(names, 0.0) | {"m": mass}
        matrix = np.reshape(list(cg.hessian(cg.Graph([m, *x], {"f": total}), x).evaluate(values).values()), (8, 8))
        positive = bool(np.linalg.eigvalsh(matrix).min() > 0.0)
        found = info(total, [m, *x], x, values)
        assert found in range(9)
        told[positive] += 1
        if not positive:
            assert found > 0
        elif mass > 0:
            assert found == 0
    assert min(told.values()) > 2


def test_what_cannot_be_is_said():
    x, y = cg.variables("x y")
    with pytest.raises(ValueError, match='order "balanced" needs a function without multipliers'):
        solve_nodes(x * x + x * y, [x, y], [x, y], multipliers=[y], order="balanced")


def test_the_order_of_what_is_no_chain_costs_nothing():
    """A function of one variable, of none that cross, and of one piece."""
    for n in (1, 2, 3):
        x = cg.variables([f"x{i}" for i in range(n)])
        graph = cg.Graph(x, {"f": sum([cg.cosh(node) for node in x], cg.constant(0.0))})
        sizes = [
            len(
                cg.Graph(x, {f"{i}": s for i, s in enumerate(cg.hessian_solve(graph, x, [1.0] * n, order=order))}).nodes
            )
            for order in ("recursive", "balanced")
        ]
        assert sizes[0] == sizes[1]


def test_what_pieces_would_make_deeper_stays_as_it_was():
    """A bushy tree: each of its 63 states goes on from that of its parent."""
    x, states, total = cg.variables([f"x{i}" for i in range(63)]), [], cg.constant(0.0)
    for i, node in enumerate(x):
        a, b = states[(i - 1) // 2] if i else (cg.constant(0.0), cg.constant(1.0))
        a, b = a + cg.cos(cg.variable("angle") + i) * node, b + cg.sin(cg.variable("angle") + i) * node
        states.append((a, b))
        total = total + a * a + b * b
    depths = {}
    for order in ("recursive", "balanced"):
        solved = solve_nodes(total, x, [cg.constant(1.0)] * 63, order=order)
        graph = cg.Graph([cg.variable("angle")], {f"{i}": node for i, node in enumerate(solved)})
        depths[order] = graph.counts().depth
    assert depths["balanced"] <= depths["recursive"]
