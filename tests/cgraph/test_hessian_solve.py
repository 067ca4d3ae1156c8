"""Solving with a Hessian that is never formed, against Hessians by high-precision differences."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import mpmath
import numpy as np
import pytest

import cgraph as cg
from cgraph import GraphError
from cgraph.hessian_solve import solve_nodes
from cgraph.ldl import SingularError, ldl_solve

# Each function runs on nodes and, with mpmath's functions, on high-precision numbers: {name: (function, inputs)}.
FUNCTIONS = {
    "quadratic": (lambda m, a, b, c: a * a + 2 * b * b + 3 * c * c + a * b - b * c, 3),
    "separate blocks": (lambda m, a, b, c, d: a * a + a * b + b * b + 4 * c * c + d * d + c * d, 4),
    "nonlinear": (lambda m, a, b, c: m.exp(a) + a * m.cos(b) + 3 * b * b + m.sqrt(1 + c * c) * (2 + m.sin(a)), 3),
    "relativistic": (lambda m, a, b: -m.sqrt(1 - a * a) - 2 * m.sqrt(1 - b * b / 4) + a * b / 8, 2),
    "several consumers": (lambda m, a, b: (a * b + a) * (a * b + b) + 4 * (a + b) * (a + b) + 9 * a * a + 8 * b * b, 2),
    "division": (lambda m, a, b, c: (a * a + b * b) / (2 + m.cos(c)) + 5 * c * c + a / (3 + b * b), 3),
    "same argument twice": (lambda m, a, b: (a + b) * (a + b) * (a + b) * (a + b) + a * a + b * b, 2),
    "branch": (lambda m, a, b: (a * a + m.sin(a) * b) + 3 * b * b, 2),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_solves_with_the_hessian(name):
    function, n = FUNCTIONS[name]
    x = cg.variables([f"x{i}" for i in range(n)])
    rhs = cg.variables([f"r{i}" for i in range(n)])
    solved = cg.hessian_solve(cg.Graph(x, {"f": function(cg, *x)}), x, rhs)
    graph = cg.Graph([*x, *rhs], {f"s{i}": node for i, node in enumerate(solved)})
    rng = np.random.default_rng(3)
    for _ in range(5):
        point, right = rng.uniform(-0.6, 0.6, n), rng.normal(size=n)
        with mpmath.workdps(40):
            hessian = np.empty((n, n))
            for i in range(n):
                for j in range(n):
                    orders = tuple((k == i) + (k == j) for k in range(n))
                    hessian[i, j] = mpmath.diff(lambda *v: function(mpmath, *v), tuple(map(mpmath.mpf, point)), orders)
        expected = np.linalg.solve(hessian, right)
        found = cg.compile(graph)(np.concatenate([point, right]))
        assert found == pytest.approx(expected, rel=1e-13, abs=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("n", [10, 40, 160])
def test_a_chain_costs_nodes_in_proportion_to_its_length(n):
    x = cg.variables([f"x{i}" for i in range(n)])
    angle = x[0]
    energy = x[0] * x[0]
    for each in x[1:]:
        angle = angle + each
        energy = energy + cg.cosh(each) + angle * angle
    solved = cg.hessian_solve(cg.Graph(x, {"f": energy}), x, [1.0] * n)
    graph = cg.simplify(cg.Graph(x, {f"s{i}": node for i, node in enumerate(solved)}))
    assert len(graph.nodes) == 15 * n - 16


def test_a_variable_that_does_not_matter_is_named_by_its_index():
    x, y, z = cg.variables("x y z")
    graph = cg.Graph([x, y, z], {"f": x * x + y + cg.sin(z) * y})
    with pytest.raises(SingularError, match="pivot") as caught:
        cg.hessian_solve(graph, [x, y], [1.0, 1.0])
    assert caught.value.index == 1


def test_wrong_calls_say_what_was_needed():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": x * x + y * y})
    with pytest.raises(ValueError, match="one entry for each of the 2 variables, got 1"):
        cg.hessian_solve(graph, [x, y], [1.0])
    with pytest.raises(GraphError, match="no input 'z'"):
        cg.hessian_solve(graph, ["z"], [1.0])
    with pytest.raises(GraphError, match="one output"):
        cg.hessian_solve(cg.Graph([x], {"f": x * x, "g": x}), [x], [1.0])


def solution(function: Callable[..., cg.Node], n: int) -> cg.Graph:
    """x0.., r0.. -> s0.., pivot: what solves with the Hessian of the function, and the first pivot that fails."""
    x, rhs = (cg.variables([f"{name}{i}" for i in range(n)]) for name in "xr")
    *solved, pivot = cg.hessian_solve(cg.Graph(x, {"f": function(*x)}), x, rhs, positive=True)
    return cg.Graph([*x, *rhs], {f"s{i}": node for i, node in enumerate(solved)} | {"pivot": pivot})


@pytest.mark.parametrize("name", FUNCTIONS)
def test_where_the_hessian_is_positive_definite_no_pivot_fails(name):
    function, n = FUNCTIONS[name]
    graph = solution(lambda *x: function(cg, *x), n)
    for point in np.random.default_rng(3).uniform(-0.6, 0.6, (5, n)):
        values = dict(zip(graph.input_names, [*point, *[1.0] * n], strict=True))
        assert graph.evaluate(values)["pivot"] == 0.0


@pytest.mark.parametrize("backend", ["python", "numpy", "llvm"])
def test_a_pivot_that_is_not_positive_is_found_as_it_happens(backend):
    if backend == "llvm":
        pytest.importorskip("llvmlite")
    # Eliminated from the last variable up: d2f/dx2^2 = 6 x2, d2f/dx1^2 = x0, and for x0 there remains 10 - x1^2 / x0.
    graph = solution(lambda x0, x1, x2: 5 * x0 * x0 + 0.5 * x0 * x1 * x1 + x2 * x2 * x2, 3)
    function = cg.compile(graph, backend=backend)

    def pivot(x0: float, x1: float, x2: float) -> float:
        return float(function([x0, x1, x2, 1.0, 1.0, 1.0])[-1])

    assert pivot(1.0, 0.0, 1.0) == 0
    assert pivot(1.0, 0.0, 0.0) == 3
    assert pivot(1.0, 0.0, -1.0) == 3
    assert pivot(0.0, 0.0, 1.0) == 2
    assert pivot(-1.0, 0.0, 1.0) == 2
    assert pivot(1.0, 100.0, 1.0) == 1  # 10 - x1^2 / x0
    assert pivot(np.nan, 0.0, 1.0) == 2
    assert pivot(1.0, 0.0, np.nan) == 3


def test_the_pivots_of_a_matrix_are_watched_too():
    a = cg.variables("a b c")
    *_, pivot = ldl_solve([[a[0]], [a[1], a[2]]], [a[0], a[0]], positive=True)
    graph = cg.Graph(a, {"pivot": pivot})
    found = graph.evaluate({"a": np.array([2.0, 1.0, 2.0]), "b": np.array([1.0, 1.0, 0.0]), "c": [1.0, 1.0, -1.0]})
    assert found["pivot"].tolist() == [0.0, 1.0, 2.0]


def test_watching_costs_two_operations_and_a_constant_for_each_variable():
    def sizes(n: int) -> tuple[int, int]:
        x = cg.variables([f"x{i}" for i in range(n)])
        energy = sum((cg.cosh(a + b) + a * a for a, b in pairwise(x)), cg.exp(x[-1]))
        graphs = [
            cg.Graph(x, {str(i): s for i, s in enumerate(cg.hessian_solve(cg.Graph(x, {"f": energy}), x, x, **how))})
            for how in ({}, {"positive": True})
        ]
        return tuple(len(cg.simplify(graph).nodes) for graph in graphs)

    for n in (5, 50):
        plain, watched = sizes(n)
        assert plain < watched <= plain + 3 * n + 1


def test_a_negative_constant_pivot_is_an_error_at_once():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": cg.exp(x) - y * y})
    assert len(cg.hessian_solve(graph, [x, y], [1.0, 1.0])) == 2
    with pytest.raises(SingularError, match="not positive definite: pivot 1 is -2") as caught:
        cg.hessian_solve(graph, [x, y], [1.0, 1.0], positive=True)
    assert caught.value.index == 1


def test_right_hand_sides_at_inner_nodes_are_carried_to_the_variables():
    x = cg.variables("x0 x1 x2")
    y, z = x[0] + cg.sin(x[1]), cg.exp(x[1]) * x[2]
    energy = y * y + z * z + cg.cosh(x[0]) + x[1] * x[1] + cg.cosh(y * z)
    b = cg.variables("b0 b1 b2 by bz")
    carried = solve_nodes(energy, x, b[:3], at={y: b[3], z: b[4], x[0]: b[0]})
    slopes = cg.jacobian(cg.Graph(x, {"y": y, "z": z}))(*x)
    rhs = [b[i] + slopes[f"dy/dx{i}"] * b[3] + slopes[f"dz/dx{i}"] * b[4] for i in range(3)]
    rhs[0] = rhs[0] + b[0]
    apart = cg.hessian_solve(cg.Graph(x, {"f": energy}), x, rhs)
    graph = cg.Graph([*x, *b], {f"s{i}": node for i, node in enumerate([*carried, *apart])})
    found = cg.compile(graph)(np.random.default_rng(0).uniform(0.2, 0.8, 8))
    assert found[:3] == pytest.approx(found[3:], rel=1e-13)
