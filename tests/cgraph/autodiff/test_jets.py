"""Taylor coefficients of solutions as graphs: which equations have them, and which are refused."""

import math

import numpy as np
import pytest

import cgraph as cg
from cgraph.autodiff import jets as module
from cgraph.core.node import Node, apply
from cgraph.extend import OPS, NoSeriesError, Op, jets


def an_operation(monkeypatch: pytest.MonkeyPatch, partial) -> Op:
    """f(x), whose slope is partial(f as a function of a node, x)."""

    def partials(y, a):
        return (partial(lambda node: apply(row, node), a),)

    row = Op("shifted", 1, math.sin, np.sin, partials, samples=((0.3,),))
    monkeypatch.setitem(OPS, "shifted", row)
    return row


@pytest.mark.parametrize("exact", [False, True])
def test_partials_without_end_are_refused(exact: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    x = cg.variable("x")
    endless = an_operation(monkeypatch, lambda f, a: f(a + 1.0))
    with pytest.raises(NoSeriesError, match="shifted has no Taylor series: its partials need partials of new nodes"):
        jets(cg.Graph([x], {"rate": Node(endless, (x,))}), exact=exact)
    periodic = an_operation(monkeypatch, lambda f, a: f(a) * a)
    assert jets(cg.Graph([x], {"rate": Node(periodic, (x,))}), exact=exact).sums > 0


@pytest.mark.parametrize("exact", [False, True])
def test_long_chains_of_operations_are_far_from_the_bound(exact: bool) -> None:
    x = cg.variable("x")
    y = x
    for _ in range(100):
        y = cg.tanh(cg.atan(cg.sin(y)))
    made = module._Jets(cg.Graph([x], {"rate": y}), "t", exact)
    assert max(made.rounds.values()) <= 4
