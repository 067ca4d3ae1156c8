"""Sparsity: an entry that is left out is zero everywhere, and the entries are those that the operations' slopes say."""

import numpy as np
import pytest
from hypothesis import given

import cgraph as cg
from cgraph.autodiff.sparsity import pattern
from cgraph.extend import OPS
from tests.each_row import each_row
from tests.strategies import cases

x, y, z = cg.variables("x y z")


def places(graph, wrt=None):
    entries = pattern(graph, graph.select_inputs(wrt))
    return list(zip(entries.rows.tolist(), entries.columns.tolist(), strict=True))


@given(cases())
def test_what_is_left_out_is_zero_in_the_graph_of_the_jacobian(case):
    jacobian = list(cg.jacobian(case.graph).outputs.values())
    n = len(case.graph.inputs)
    nonzero = {divmod(k, n) for k, node in enumerate(jacobian) if node.value != 0.0}
    assert nonzero <= set(places(case.graph))


@each_row("name", sorted(OPS))
def test_an_operation_depends_on_what_it_has_a_slope_in(name):
    inputs = cg.variables([f"a{k}" for k in range(OPS[name].arity)])
    flat = {"floor", "ceil", "round", "sign", "less", "less_equal", "equal", "not_equal"}
    expected = [] if name in flat else [1, 2] if name == "where" else range(len(inputs))
    graph = cg.Graph(inputs, {"f": getattr(cg, name)(*inputs)})
    assert places(graph) == [(0, k) for k in expected]


def test_paths_through_zero_factors_and_conditions_do_not_count():
    graph = cg.Graph([x, y, z], {"f": 0.0 * x + cg.where(y > 0.0, z, 2.0), "g": cg.floor(x) * y, "h": cg.constant(3.0)})
    assert places(graph) == [(0, 2), (1, 1)]
    assert places(graph, ["y", "x"]) == [(1, 0)]


def test_rows_share_nodes_and_inputs_are_outputs():
    assert places(cg.Graph([x, y], {"f": x, "g": x * y, "h": x})) == [(0, 0), (1, 0), (1, 1), (2, 0)]


def test_scipy_gets_a_matrix_of_truth_values():
    sparse = pytest.importorskip("scipy.sparse")
    graph = cg.Graph([x, y, z], {"f": x * z, "g": cg.constant(1.0), "h": cg.sin(y)})
    found = cg.sparsity(graph)
    assert isinstance(found, sparse.csr_array)
    assert found.dtype == bool
    assert found.has_sorted_indices
    assert found.toarray().tolist() == [[True, False, True], [False, False, False], [False, True, False]]
    assert cg.sparsity(graph, wrt="y").toarray().tolist() == [[False], [False], [True]]


def test_a_long_chain_takes_little_memory_and_time():
    n = 20_000
    inputs = cg.variables([f"x{k}" for k in range(n)])
    graph = cg.Graph(inputs, {f"y{k}": inputs[k] * inputs[k - 1] for k in range(n)})
    entries = pattern(graph, graph.inputs)
    assert np.array_equal(np.bincount(entries.rows), np.full(n, 2))
