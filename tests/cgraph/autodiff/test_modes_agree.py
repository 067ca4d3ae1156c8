"""Forward and reverse mode, and all that is made of them, give one derivative: at kinks and behind branches too.

A path from an input to an output counts unless a selecting operation on it leaves its argument out. Where the partials
on all paths that count are finite, the derivative is the sum of their products, in every mode.
"""

import math
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

import cgraph as cg
from cgraph.core.node import apply
from cgraph.extend import cotangents
from cgraph.operations.operation import OPS
from cgraph.program.functions import derivative
from tests.tolerances import LONG_SUM

NAMES = ("x", "y", "z")
SPECIAL = (0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 0.5, 3.0, math.nextafter(1.0, 2.0), 1e-160, -1e160, 1e308)
SIZES = (1e-9, 1e9)  # of partials: products of a few dozen neither overflow nor vanish
x, y = cg.variables("x y")


class At(NamedTuple):
    graph: cg.Graph
    point: dict[str, float]


@st.composite
def graphs(draw: st.DrawFn) -> At:
    """Random graphs over all operations at special points, out of their domains too; half of the nodes select."""
    names = NAMES[: draw(st.integers(1, 3))]
    pool = [*cg.variables(list(names)), cg.constant(draw(st.sampled_from(SPECIAL)))]
    every = st.sampled_from(sorted(OPS.keys() - {"zero_safe_mul"})) | st.sampled_from(("where", "minimum", "maximum"))
    index = st.integers(0, 3) | st.integers(0, 99)
    for _ in range(draw(st.integers(2, 12))):
        op = OPS[draw(every)]
        arguments = [pool[-1 - draw(index) % len(pool)] for _ in range(op.arity)]
        pool.append(apply(op, *arguments))
    point = {name: draw(st.sampled_from(SPECIAL)) for name in names}
    outputs = {f"f{k}": node for k, node in enumerate(pool[-draw(st.integers(1, 3)) :])}
    return At(cg.Graph(cg.variables(list(names)), outputs), point)


def sums_over_paths(graph: cg.Graph, point: dict[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(m, n): sums of the products along the paths that count, those of their sizes, and whether partials are tame."""
    partials = {str(k): edge.partial for k, edge in enumerate(graph.edges)}
    value = list(cg.Graph(graph.inputs, partials).evaluate(point).values()) if partials else []
    entering: dict[cg.Node, list[tuple[cg.Node, float]]] = {node: [] for node in graph.nodes}
    for edge, p in zip(graph.edges, value, strict=True):
        if not (edge.target.op.selects and p == 0.0) and getattr(edge.partial, "value", edge.partial) != 0.0:
            entering[edge.target].append((edge.source, float(p)))
    shape = len(graph.outputs), len(graph.inputs)
    total, size, tame = np.zeros(shape), np.zeros(shape), np.ones(shape, dtype=bool)
    for i, output in enumerate(graph.outputs.values()):
        for j, start in enumerate(graph.inputs):
            above = {output}
            for node in reversed(graph.nodes):
                if node in above:
                    above.update(arg for arg, _ in entering[node])
            sums = {start: (1.0, 1.0)}
            for node in graph.nodes:
                terms = [(p, *sums[arg]) for arg, p in entering[node] if arg in sums]
                if node is not start and terms and node in above:
                    tame[i, j] &= all(p == 0.0 or SIZES[0] < abs(p) < SIZES[1] for p, _, _ in terms)
                    sums[node] = sum(p * s for p, s, _ in terms), sum(abs(p) * a for p, _, a in terms)
            total[i, j], size[i, j] = sums.get(output, (0.0, 0.0))
    return total, size, tame


def every_jacobian(graph: cg.Graph, point: dict[str, float]) -> dict[str, np.ndarray]:
    m, n = len(graph.outputs), len(graph.inputs)
    rows, columns = np.eye(m), np.eye(n)

    def values(derived: cg.Graph, more: dict[str, float] | None = None) -> list[float]:
        return list(derived.evaluate(point | (more or {})).values())

    def seeded(derived: cg.Graph, unit: np.ndarray) -> list[float]:
        return values(derived, dict(zip(derived.input_names[n:], unit.tolist(), strict=True)))

    tall = cg.Graph(graph.inputs, {**graph.outputs, **{f"more{k}": cg.exp(v) for k, v in enumerate(graph.inputs)}})
    compiled, in_lanes = cg.compile(graph, "python"), cg.compile(graph, "python")
    compiled._derivatives.vector_cost, in_lanes._derivatives.vector_cost = math.inf, 0
    x = list(point.values())
    with patch.object(derivative, "CHECK", -1):  # guarded only where a slope is infinite
        in_lanes.jacobian(x)
    one_by_one = [cg.Graph(graph.inputs, {name: node}) for name, node in graph.outputs.items()]
    return {
        "jvp": np.array([seeded(cg.jvp(graph), unit) for unit in columns]).T,
        "jvp by one": np.array([seeded(cg.jvp(graph, v), np.ones(1)) for v in graph.inputs]).T,
        "vjp": np.array([seeded(cg.vjp(graph), unit) for unit in rows]),
        "jacobian": np.reshape(values(cg.jacobian(graph)), (m, n)),
        "jacobian, forward": np.reshape(values(cg.jacobian(tall)), (-1, n))[:m],
        "jvp, compiled": compiled.jvp(x, columns).T,
        "vjp, compiled": compiled.vjp(x, rows),
        "jacobian, compiled": compiled.jacobian(x),
        "jacobian, in lanes": in_lanes.jacobian(x),
        "gradient": np.array([values(cg.gradient(each)) for each in one_by_one]),
    }


def assert_one_jacobian(graph: cg.Graph, point: dict[str, float]) -> None:
    total, size, tame = sums_over_paths(graph, point)
    every = cg.Graph(graph.inputs, {str(k): node for k, node in enumerate(graph.nodes)}).evaluate(point)
    finite = all(map(math.isfinite, every.values()))
    m, n = len(graph.outputs), len(graph.inputs)
    seeds = {"jvp": n, "vjp": m, "jvp, compiled": n, "vjp, compiled": m, "jacobian, in lanes": max(m, n)}
    for name, found in every_jacobian(graph, point).items():
        if not finite and seeds.get(name, 1) > 1:
            continue  # a zero in the seed wins over a slope that is infinite, not over a value
        assert near(found, total, size, tame), f"{name}: {found}, not {total} where {tame}\n{graph.listing()}"


def near(found: np.ndarray, total: np.ndarray, size: np.ndarray, where: np.ndarray) -> bool:
    with np.errstate(all="ignore"):
        return bool((np.abs(found - total) <= LONG_SUM * size)[where].all())


@given(graphs())
def test_every_mode_gives_the_sum_over_the_paths_that_count(at):
    assert_one_jacobian(*at)


@given(graphs())
def test_every_mode_gives_it_of_a_gradient_and_the_hessian_is_that(at):
    graph = cg.Graph(at.graph.inputs, {"f": next(iter(at.graph.outputs.values()))})
    gradient = cg.gradient(graph)
    assume(len(gradient.nodes) < 200)
    assert_one_jacobian(gradient, at.point)
    total, size, tame = sums_over_paths(gradient, at.point)
    found = np.reshape(list(cg.hessian(graph).evaluate(at.point).values()), total.shape)
    assert near(found, total, size, np.tril(tame)), (found, total)


@pytest.mark.parametrize(
    ("f", "at"),
    [
        (cg.sqrt(cg.maximum(x, 0)), -1.0),
        (cg.maximum(x, 0) ** 0.5, -1.0),
        (cg.acos(cg.minimum(x, 1)), 2.0),
        (cg.sqrt(cg.where(x > 0, x, 0)), -1.0),
        (cg.sign(x) / 0.0, 1.0),
        (cg.where(x > 0, math.inf * x, 0.0), -1.0),
        (math.inf * cg.maximum(x, 0) + cg.maximum(x, 0), -1.0),
    ],
)
def test_what_is_left_out_counts_nothing_in_any_mode(f, at):
    graph = cg.Graph([x], {"f": f})
    assert {name: found.tolist() for name, found in every_jacobian(graph, {"x": at}).items() if found.any()} == {}
    assert cg.hessian(graph).evaluate({"x": at}) == {"d2f/dxdx": 0.0}


@pytest.mark.parametrize(
    ("f", "why"),
    [
        (cg.where(x > -1, cg.sqrt(x) ** 2, 0.0), "the slope is 1, but 0 times infinity on the way"),
        (cg.sqrt(cg.maximum(x, -1)) ** 2, "the same above the selection"),
        (cg.sqrt(x * x), "a norm written out has no slope at 0: hypot has the one by convention"),
    ],
)
def test_zero_times_infinity_on_a_path_that_counts_is_nan_in_every_mode(f, why):
    for name, found in every_jacobian(cg.Graph([x], {"f": f}), {"x": 0.0}).items():
        assert np.isnan(found).all(), (name, why)


def test_a_zero_in_a_seed_wins_over_a_slope_that_is_not_there():
    power = cg.jvp(cg.Graph([x, y], {"f": x**y}))
    assert power.evaluate({"x": -2.0, "y": 3.0, "x_dot": 1.0, "y_dot": 0.0}) == {"f_dot": 12.0}
    two = cg.Graph([x], {"root": cg.sqrt(x), "line": 3.0 * x})
    assert cg.vjp(two).evaluate({"x": 0.0, "root_bar": 0.0, "line_bar": 1.0}) == {"x_bar": 3.0}


@pytest.mark.parametrize("f", [1.0 / x, x / (x + 1.0), x**-1, x**-2.5, x**3, x**1.5, cg.log(x), cg.log1p(x), cg.tan(x)])
def test_a_zero_in_a_seed_needs_no_guard_where_a_slope_is_infinite_only_with_its_value(f):
    pushed, pulled = cg.jvp(cg.Graph([x, y], {"f": f + y})), cg.vjp(cg.Graph([x], {"f": f, "line": 3.0 * x}))
    assert "where" not in pushed.counts().by_operation | pulled.counts().by_operation
    for at in (5e-324, 1e-310, 1e-200, 1e-120, 0.5, 1e100, 1e308):
        if math.isfinite(cg.Graph([x], {"f": f}).evaluate({"x": at})["f"]):
            assert pushed.evaluate({"x": at, "y": 0.0, "x_dot": 0.0, "y_dot": 1.0}) == {"f_dot": 1.0}
            assert pulled.evaluate({"x": at, "f_bar": 0.0, "line_bar": 1.0}) == {"x_bar": 3.0}


def test_a_seed_counts_though_another_leaves_it_out():
    root = cg.sqrt(x)
    one = cg.constant(1.0)
    (bar,) = cotangents({root: one, cg.where(x > 1.0, root, 0.0): one}, [x])
    assert cg.Graph([x], {"x_bar": bar}).evaluate({"x": 0.25}) == {"x_bar": 1.0}
