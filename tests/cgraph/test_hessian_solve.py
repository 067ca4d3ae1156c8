"""Solving with a Hessian that is never formed, against Hessians by high-precision differences."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import cgraph as cg
from cgraph import GraphError
from cgraph.ldl import SingularError

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
