"""A Jacobian as a product repeated for colors is the Jacobian, and is taken where it is smaller."""

import numpy as np
from hypothesis import given

import cgraph as cg
from cgraph.autodiff import compressed_jacobian as module
from cgraph.extend import compressed_jacobian
from tests.cgraph.engines import evaluated
from tests.strategies import cases
from tests.tolerances import LONG_SUM


def assembled(parts, point):
    (known,) = evaluated(parts.primal, [point])
    sums = evaluated(parts.product, [[*known, color] for color in range(parts.colors)])
    return evaluated(parts.entries, [sums.T.ravel()])[0]


@given(cases())
def test_the_parts_make_the_jacobian(case):
    every, module.written_sizes = module.written_sizes, lambda graph, wrt: (0, 1, 1)  # so that it is compressed
    try:
        parts = compressed_jacobian(case.graph)
    finally:
        module.written_sizes = every
    point = list(case.values.values())
    (expected,) = evaluated(cg.jacobian(case.graph), [point])
    if parts.colors:
        size = np.abs(expected).max()
        np.testing.assert_allclose(assembled(parts, point), expected, rtol=LONG_SUM, atol=LONG_SUM * size)


def test_it_is_taken_where_it_is_smaller():
    x = cg.variables([f"x{k}" for k in range(12)])
    shared = cg.sin(sum(x[1:], x[0]))
    dense = cg.Graph(x, {f"y{k}": cg.exp(shared * cg.cos(shared)) * each for k, each in enumerate(x)})
    band = cg.Graph(x, {f"y{k}": cg.sin(x[k]) * x[k - 1] for k in range(12)})
    assert compressed_jacobian(band) is None
    parts = compressed_jacobian(dense, [each.name for each in x[:9]])
    assert parts.colors == 9
    assert len(parts.primal.nodes) + len(parts.product.nodes) < len(cg.jacobian(dense, x[:9]).nodes)
    point = np.linspace(0.1, 0.4, 12)
    np.testing.assert_allclose([assembled(parts, point)], evaluated(cg.jacobian(dense, x[:9]), [point]), rtol=LONG_SUM)
