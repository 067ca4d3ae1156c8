"""Solving with a Hessian that is never formed, against Hessians by high-precision differences."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import mpmath
import numpy as np
import pytest

import cgraph as cg
from cgraph import GraphError
from cgraph.autodiff.hessian_solve import solve_nodes, solve_tangents
from cgraph.autodiff.jacobian import hessian_nodes
from cgraph.autodiff.rotation_pairs import rotations
from cgraph.autodiff.symmetric_elimination import SingularError, ldl_solve
from cgraph.core.forward import tangents
from cgraph.core.traversal import topological
from tests.cgraph.engines import ENGINES
from tests.each_row import each_row
from tests.tolerances import LONG_SUM

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


def solution(function: Callable[..., cg.Node], n: int, inputs: Sequence[cg.Node] = ()) -> cg.Graph:
    """x0.., r0.. -> s0.., pivot: what solves with the Hessian of the function, and the first pivot that fails."""
    x, rhs = (cg.variables([f"{name}{i}" for i in range(n)]) for name in "xr")
    *solved, info = cg.hessian_solve(cg.Graph([*inputs, *x], {"f": function(*x)}), x, rhs, check=True)
    return cg.Graph([*inputs, *x, *rhs], {f"s{i}": node for i, node in enumerate(solved)} | {"info": info})


def assert_solved(function: Callable[..., object], found: np.ndarray, point: np.ndarray, right: np.ndarray) -> None:
    """The Hessian, of numbers of mpmath, times what was found is the right-hand side; no pivot failed."""
    n = len(point)
    hessian = np.empty((n, n))
    with mpmath.workdps(40):
        for i, j in np.ndindex(n, n):
            orders = tuple((k == i) + (k == j) for k in range(n))
            hessian[i, j] = mpmath.diff(function, tuple(map(mpmath.mpf, point)), orders)
    expected = np.linalg.solve(hessian, right)
    assert found[:n] == pytest.approx(expected, rel=LONG_SUM, abs=LONG_SUM * np.abs(expected).max())
    assert found[n] == 0.0


@each_row("name", FUNCTIONS)
def test_solves_with_the_hessian_and_where_it_is_positive_definite_no_pivot_fails(name):
    function, n = FUNCTIONS[name]
    compiled, rng = cg.compile(solution(lambda *x: function(cg, *x), n)), np.random.default_rng(3)
    for _ in range(5):
        point, right = rng.uniform(-0.6, 0.6, n), rng.normal(size=n)
        assert_solved(lambda *v: function(mpmath, *v), compiled(np.concatenate([point, right])), point, right)


@each_row("name", FUNCTIONS)
def test_tangents_are_those_of_the_solution_at_every_node(name):
    """By forward mode along it."""
    function, n = FUNCTIONS[name]
    x, dots = (cg.variables([f"{letter}{i}" for i in range(n)]) for letter in "xd")
    output = function(cg, *x)
    found = solve_tangents(output, x, [cg.constant(1.0 + i) for i in range(n)])
    solution = [found[node] for node in x]
    known = [node for node in found if node.args]
    pushed = tangents(dict(zip(x, dots, strict=True)), known)
    graph = cg.Graph([*x, *dots], {f"{i}": pushed[node] for i, node in enumerate(known)})
    solved = cg.Graph(x, {f"{i}": node for i, node in enumerate([*solution, *[found[node] for node in known]])})
    point = dict(zip(solved.input_names, np.random.default_rng(5).uniform(-0.6, 0.6, n), strict=True))
    values = list(solved.evaluate(point).values())
    along = dict(zip([f"d{i}" for i in range(n)], values[:n], strict=True))
    assert values[n:] == pytest.approx(list(graph.evaluate(point | along).values()), rel=1e-12, abs=1e-12)


@each_row("n", [10, 40, 160])
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


def test_a_variable_without_a_positive_constant_pivot_is_named_by_its_index():
    x, y, z = cg.variables("x y z")
    without, negative = x * x + y + cg.sin(z) * y, cg.exp(x) - y * y
    for f, check, said in ((without, False, "pivot"), (negative, True, "not positive definite: pivot 1 is -2")):
        with pytest.raises(SingularError, match=said) as caught:
            cg.hessian_solve(cg.Graph([x, y, z], {"f": f}), [x, y], [1.0, 1.0], check=check)
        assert caught.value.index == 1
    assert len(cg.hessian_solve(cg.Graph([x, y], {"f": negative}), [x, y], [1.0, 1.0])) == 2


def test_wrong_calls_say_what_was_needed():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": x * x + y * y})
    with pytest.raises(ValueError, match="one entry for each of the 2 variables, got 1"):
        cg.hessian_solve(graph, [x, y], [1.0])
    with pytest.raises(GraphError, match="no input 'z'"):
        cg.hessian_solve(graph, ["z"], [1.0])
    with pytest.raises(GraphError, match="one output"):
        cg.hessian_solve(cg.Graph([x], {"f": x * x, "g": x}), [x], [1.0])


@pytest.mark.parametrize("backend", ENGINES)
def test_a_pivot_that_is_not_positive_is_found_as_it_happens(backend):
    # Eliminated from the last variable up: d2f/dx2^2 = 6 x2, d2f/dx1^2 = x0, and for x0 there remains 10 - x1^2 / x0.
    graph = solution(lambda x0, x1, x2: 5 * x0 * x0 + 0.5 * x0 * x1 * x1 + x2 * x2 * x2, 3)
    function = cg.compile(graph, backend=backend)

    nan = math.nan
    points = [(1, 0, 1), (1, 0, 0), (1, 0, -1), (0, 0, 1), (-1, 0, 1), (1, 100, 1), (nan, 0, 1), (1, 0, nan)]
    assert [function([*point, 1.0, 1.0, 1.0])[-1] for point in points] == [0, 3, 3, 2, 2, 1, 2, 3]


def test_the_pivots_of_a_matrix_are_watched_too():
    a = cg.variables("a b c")
    *_, info = ldl_solve([[a[0]], [a[1], a[2]]], [a[0], a[0]], check=True)
    graph = cg.Graph(a, {"info": info})
    found = graph.evaluate({"a": np.array([2.0, 1.0, 2.0]), "b": np.array([1.0, 1.0, 0.0]), "c": [1.0, 1.0, -1.0]})
    assert found["info"].tolist() == [0.0, 1.0, 2.0]


@each_row("point", [-1.0, 0.25])
def test_a_branch_that_is_not_taken_counts_nothing(point):
    x, y = cg.variables("x y")
    root = cg.where(x > 0, x * cg.sqrt(x), 0.0) + cg.exp(cg.sqrt(cg.maximum(x, 0.0)))
    graph = cg.Graph([x, y], {"f": x * x + x * y + 3.0 * y * y + root * y})
    solved = cg.hessian_solve(graph, [x, y], [1.0, 2.0])
    found = cg.Graph([x, y], {f"s{i}": node for i, node in enumerate(solved)}).evaluate({"x": point, "y": 0.5})
    hessian = np.reshape(list(cg.hessian(graph).evaluate({"x": point, "y": 0.5}).values()), (2, 2))
    assert hessian @ list(found.values()) == pytest.approx([1.0, 2.0], rel=LONG_SUM)


def test_pivots_that_are_zero_are_taken_in_pairs():
    names = "v0 v1 v2 v3"
    v = cg.variables(names)
    graph = cg.Graph(v, {"f": v[0] * v[1] + cg.exp(v[2]) * v[3] + v[1] * v[3] * 0.5 + v[0] * v[3]})
    rhs = [1.0, 2.0, 3.0, 4.0]
    lower = [list(row) for row in hessian_nodes(graph.only_output(), v)]
    for solved in (cg.hessian_solve(graph, v, rhs), ldl_solve(lower, [cg.constant(b) for b in rhs])):
        point = dict(zip(names.split(), (0.1, -0.2, 0.3, 0.7), strict=True))
        found = cg.Graph(v, {f"s{i}": node for i, node in enumerate(solved)}).evaluate(point)
        hessian = np.reshape(list(cg.hessian(graph).evaluate(point).values()), (4, 4))
        assert hessian @ list(found.values()) == pytest.approx(rhs, rel=LONG_SUM)
    with pytest.raises(SingularError, match="not positive definite"):
        cg.hessian_solve(cg.Graph(v[:2], {"f": v[0] * v[1]}), v[:2], rhs[:2], check=True)
    with pytest.raises(SingularError, match="singular by structure"):
        cg.hessian_solve(cg.Graph(v[:3], {"f": v[0] * v[1] + v[1] * v[2]}), v[:3], rhs[:3])


def alike(inputs: list[cg.Node], carried: list[cg.Node], apart: list[cg.Node]) -> bool:
    graph = cg.Graph(inputs, {f"s{i}": node for i, node in enumerate([*carried, *apart])})
    found = cg.compile(graph)(np.random.default_rng(0).uniform(0.2, 0.8, len(inputs)))
    return bool(found[: len(carried)] == pytest.approx(found[len(carried) :], rel=LONG_SUM))


def test_right_hand_sides_at_inner_nodes_are_carried_to_the_variables():
    x = cg.variables("x0 x1 x2")
    y, z = x[0] + cg.sin(x[1]), cg.exp(x[1]) * x[2]
    energy = y * y + z * z + cg.cosh(x[0]) + x[1] * x[1] + cg.cosh(y * z)
    b = cg.variables("b0 b1 b2 by bz")
    carried = solve_nodes(energy, x, b[:3], at={y: b[3], z: b[4], x[0]: b[0]})
    slopes = cg.jacobian(cg.Graph(x, {"y": y, "z": z}))(*x)
    rhs = [b[i] + slopes[f"dy/dx{i}"] * b[3] + slopes[f"dz/dx{i}"] * b[4] for i in range(3)]
    rhs[0] = rhs[0] + b[0]
    assert alike([*x, *b], carried, cg.hessian_solve(cg.Graph(x, {"f": energy}), x, rhs))
    a, *x = cg.variables("a x0 x1")  # and at a product within a rotation
    c, s = cg.cos(a), cg.sin(a)
    product = c * x[0]
    p, q = product + s * x[1], c * x[1] - s * x[0]
    energy = p * p + p * q + 3 * q * q
    carried = solve_nodes(energy, x, b[:2], at={product: b[2]})
    apart = cg.hessian_solve(cg.Graph([a, *x], {"f": energy}), x, [b[0] + c * b[2], b[1]])
    assert alike([a, *x, *b[:3]], carried, apart)


def turning(m, a, b, x):
    """Two vectors turned by one angle, one of them by another as well; mirrored, with an input in two pairs.

    The last variable is met before them, so what comes of it has to pass them down and up again.
    """
    ca, sa, cb, sb = m.cos(a), m.sin(a), m.cos(b), m.sin(b)
    u, v, w = x[0] + x[3] * x[3], m.sin(x[1]) - x[2], m.exp(x[2]) + x[3]
    p, q = ca * u + sa * v, ca * v - sa * u
    r, s = sa * w - ca * v, sa * v + ca * w  # turned the other way, one of them with its sign turned
    y, z = cb * p - sb * r, sb * p + cb * r
    k, n = cb * s + sb * y, cb * s - sb * y  # no rotation: both would have to be as long as (s, y)
    squares = sum(8 * e * e for e in x)
    last = (p - 2 * q + 3 * r + s * s) * x[4]
    return last + p * p * q + 3 * q * q + y * z * s + 2 * y * y + 4 * z * z + k * n * p + 5 * s * s + squares


def test_rotations_are_turned_back_as_one() -> None:
    a, b = cg.variables("a b")
    function = cg.compile(solution(lambda *x: turning(cg, a, b, x), 5, [a, b]))
    rng = np.random.default_rng(4)
    for _ in range(5):
        angles, point, right = rng.uniform(-3.0, 3.0, 2), rng.uniform(-0.3, 0.3, 5), rng.normal(size=5)
        found, at = function(np.concatenate([angles, point, right])), [mpmath.mpf(each) for each in angles]
        assert_solved(partial(lambda at, *v: turning(mpmath, *at, v), at), found, point, right)


def test_which_pairs_of_sums_are_rotations() -> None:
    def found(make: Callable[..., tuple[cg.Node, ...]], kept: bool = False) -> int:
        a, b, *x = cg.variables("a b x y z")
        nodes = make(cg.cos(a), cg.sin(a), cg.sin(b), *x)
        order = [node for node in topological(nodes) if node.op.name in ("add", "sub", "mul")]
        return len(rotations(order, {*x, *order}, [order[0]] if kept else []))

    assert found(lambda c, s, o, x, y, z: (c * x + s * y, c * y - s * x)) == 1
    assert found(lambda c, s, o, x, y, z: (s * x - y * c, y * s + x * c)) == 1
    assert found(lambda c, s, o, x, y, z: (c * x + s * y, c * y - s * x), kept=True) == 0
    assert found(lambda c, s, o, x, y, z: (c * x + s * y, c * y + s * x)) == 0
    assert found(lambda c, s, o, x, y, z: (c * x + s * y, c * z - s * x)) == 0
    assert found(lambda c, s, o, x, y, z: (c * x + o * y, c * y - o * x)) == 0
    assert found(lambda c, s, o, x, y, z: (c * x + s * x, c * x - s * x)) == 0

    def used_again(c: cg.Node, s: cg.Node, o: cg.Node, x: cg.Node, y: cg.Node, z: cg.Node) -> tuple[cg.Node, ...]:
        product = c * x
        return product + s * y, c * y - s * x, product * z

    assert found(used_again) == 0


def test_turning_a_pair_back_costs_what_its_blocks_need() -> None:
    """Of two pairs by one angle, blocks of 3, 3 and 4 numbers: 9, 9 and 11 operations, and one for 2 c."""
    a, *x = cg.variables("a x0 x1 x2 x3")
    c, s = cg.cos(a), cg.sin(a)
    p, q, r, t = c * x[0] + s * x[1], c * x[1] - s * x[0], c * x[2] + s * x[3], c * x[3] - s * x[2]
    energy = cg.cosh(p + 2.0 * q + 3.0 * r + 4.0 * t) + cg.exp(p) + cg.exp(q) + cg.exp(r) + cg.exp(t)

    def size() -> int:
        solved = cg.hessian_solve(cg.Graph([a, *x], {"f": energy}), x, [1.0, 2.0, 3.0, 4.0])
        return len(cg.simplify(cg.Graph([a, *x], {f"s{i}": node for i, node in enumerate(solved)})).nodes)

    assert size() == 126


def saddle(n, m, seed=0, scale=1.0):
    """A chain of squares and products in u, and multipliers s of rows that each hold a stretch of it; its matrix."""
    rng = np.random.default_rng(seed)
    u, s = cg.variables([f"u{i}" for i in range(n)]), cg.variables([f"s{k}" for k in range(m)])
    total, at = 0.0, 0.0
    for node in u:
        at = at + node * float(rng.uniform(0.5, 1.5))
        total = total + float(rng.uniform(0.5, 1.5)) * at * at * scale
    for k, node in enumerate(s):
        row = 0.0
        for other in u[k * n // m : (k + 1) * n // m]:
            row = row + float(rng.normal()) * other
        total = total + node * row
    hessian = cg.hessian(cg.Graph([*u, *s], {"f": total})).evaluate({node.name: 0.0 for node in (*u, *s)})
    return total, u, s, np.array(list(hessian.values())).reshape(n + m, n + m)


@each_row(("n", "m"), [(2, 1), (6, 2), (12, 4)])
def test_multipliers_are_solved_for_with_the_variables(n, m):
    total, u, s, matrix = saddle(n, m)
    rhs = np.random.default_rng(1).normal(size=n + m)
    solved = solve_nodes(total, [*u, *s], [cg.constant(x) for x in rhs], multipliers=s, check=True)
    assert solved[-1].value == 0.0
    assert np.array([node.value for node in solved[:-1]]) == pytest.approx(np.linalg.solve(matrix, rhs), rel=1e-9)


def test_the_sign_of_a_pivot_is_told_by_its_place():
    """Indefinite in u, or a row that says nothing new: the constant pivot of the one that has the wrong sign."""
    u, v, s, r = cg.variables("u v s r")
    one = cg.constant(1.0)
    with pytest.raises(SingularError) as raised:
        solve_nodes(u * u - v * v + s * u, [u, v, s], [one] * 3, multipliers=[s], check=True)
    assert raised.value.index == 1
    with pytest.raises(SingularError) as raised:
        solve_nodes(u * u + v * v + s * u + r * (2.0 * u), [u, v, s, r], [one] * 4, multipliers=[s, r])
    assert raised.value.index in (2, 3)
    x = cg.variable("x")
    *_, info = solve_nodes(u * u + x * v * v + s * (u + v), [u, v, s], [one] * 3, multipliers=[s], check=True)
    graph = cg.Graph([x], {"info": info})
    assert [graph.evaluate({"x": value})["info"] for value in (2.0, -2.0)] == [0.0, 2.0]
