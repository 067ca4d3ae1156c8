"""Derivatives of random graphs: both modes agree with each other and with central differences at 50 digits."""

import math

from hypothesis import assume, given, settings, strategies as st
from mpmath import mpf

import cgraph as cg
from cgraph.operations.operation import OPS
from tests import high_precision
from tests.strategies import Case, cases, examples, numbers

ADJOINT_TOLERANCE = 1e-12  # relative to the sum of the absolute values of all terms
DERIVATIVE_TOLERANCE = 1e-9  # relative to the same sum: partials are taken at arguments that were rounded
KINK_DISTANCE = 1e-6

weights = st.lists(numbers(), min_size=3, max_size=3)


def test_random_graphs_use_every_operation_and_share_nodes():
    """Test the tests: the properties below are tried on all that the table offers."""
    seen: list[cg.Graph] = []

    @settings(max_examples=150)
    @given(cases())
    def draw(case: Case) -> None:
        seen.append(case.graph)

    draw()
    assert {node.op.name for graph in seen for node in graph.nodes} >= set(OPS)
    assert sum(len({e.source for e in graph.edges if e.source.args}) < len(graph.edges) for graph in seen) > 50
    assert sum(len(graph.nodes) > 20 for graph in seen) > 15


@settings(max_examples=examples(200))
@given(cases(), weights, weights)
def test_jvp_and_vjp_are_adjoint(case, v, w):
    """<w, J v> = <J^T w, v>, relative to the sum over paths of the absolute values."""
    assume(high_precision.kink_distance(case.graph, case.values) > KINK_DISTANCE)  # for the size of terms alone
    x_dot, y_bar = dict(zip(case.graph.input_names, v, strict=False)), dict(zip(case.graph.outputs, w, strict=False))
    pushed = cg.jvp(case.graph).evaluate(case.values | {f"{name}_dot": v for name, v in x_dot.items()})
    pulled = cg.vjp(case.graph).evaluate(case.values | {f"{name}_bar": w for name, w in y_bar.items()})
    left = math.fsum(w * pushed[f"{name}_dot"] for name, w in y_bar.items())
    right = math.fsum(v * pulled[f"{name}_bar"] for name, v in x_dot.items())
    paths = high_precision.path_size(case.graph, case.values, x_dot)
    size = math.fsum(abs(w) * paths[name] for name, w in y_bar.items())
    assert math.isfinite(left)
    assert abs(left - right) <= ADJOINT_TOLERANCE * max(size, 1e-300)


def derivative_error(case: Case, x_dot: dict[str, float]) -> float:
    """Error of J v by both modes against central differences, relative to the sum over paths."""
    graph = case.graph
    pushed = cg.jvp(graph).evaluate(case.values | {f"{name}_dot": v for name, v in x_dot.items()})
    rows = cg.jacobian(graph).evaluate(case.values)
    exact = high_precision.directional(graph, case.values, x_dot)
    paths = high_precision.path_size(graph, case.values, x_dot)
    errors = [0.0]
    for name in graph.outputs:
        by_rows = math.fsum(v * rows[f"d{name}/d{x}"] for x, v in x_dot.items())
        both = (pushed[f"{name}_dot"], by_rows)
        errors += [float(abs(mpf(found) - exact[name])) / max(paths[name], 1e-3) for found in both]
    return max(errors)


@settings(max_examples=examples(200))
@given(cases(), weights)
def test_first_derivatives_are_central_differences(case, v):
    assume(high_precision.kink_distance(case.graph, case.values) > KINK_DISTANCE)
    assert derivative_error(case, dict(zip(case.graph.input_names, v, strict=False))) <= DERIVATIVE_TOLERANCE


@settings(max_examples=examples(200))
@given(cases(max_operations=8, max_outputs=1), weights)
def test_second_derivatives_are_central_differences_of_the_first(case, v):
    """The graph of the gradient, itself a random graph, is differentiated once more by both modes, as is its graph."""
    assume(high_precision.kink_distance(case.graph, case.values) > KINK_DISTANCE)
    first = Case(cg.gradient(case.graph), case.values)
    assume(high_precision.kink_distance(first.graph, case.values) > KINK_DISTANCE)
    along = dict(zip(case.graph.input_names, v, strict=False))
    assert derivative_error(first, along) <= DERIVATIVE_TOLERANCE
    hessian = cg.hessian(case.graph).evaluate(case.values)
    product = cg.hvp(case.graph).evaluate(case.values | {f"{name}_dot": x for name, x in along.items()})
    exact, paths = (
        each(first.graph, case.values, along) for each in (high_precision.directional, high_precision.path_size)
    )
    for row in case.graph.input_names:
        by_columns = math.fsum(v * hessian[f"d2f0/d{row}d{column}"] for column, v in along.items())
        for found in (by_columns, product[f"df0/d{row}_dot"]):
            assert abs(mpf(found) - exact[f"df0/d{row}"]) <= DERIVATIVE_TOLERANCE * max(1.0, paths[f"df0/d{row}"])
