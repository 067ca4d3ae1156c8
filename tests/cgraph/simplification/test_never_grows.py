"""Taking away never adds: simplify and specialize on random graphs and on the graphs of random mechanisms.

Values may move by rounding: by four units of the last place times the condition, which is the sum over all nodes of
|d output / d node| |node|, relative to the output (`high_precision.rounding_size`), before and after.
"""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from mpmath import mpf

import cgraph as cg
import dynamics as dyn
from tests import high_precision
from tests.dynamics.mechanisms import random_mechanism
from tests.slow import slow
from tests.strategies import cases, examples

FOUR_ULPS = 4 * 2.0**-52
KINK_DISTANCE = 1e-6
SCENES = 100
KINDS = (
    ["revolute"],
    ["prismatic"],
    ["revolute", "prismatic"],
    ["revolute", "fixed"],
    ["prismatic", "revolute", "fixed"],
)


def assert_no_larger(after: cg.Graph, before: cg.Graph) -> None:
    """In nodes, and where there are as many, in edges."""
    assert (len(after.nodes), len(after.edges)) <= (len(before.nodes), len(before.edges))


def assert_same_values(after: cg.Graph, before: cg.Graph, values: dict[str, float]) -> None:
    left = {name: value for name, value in values.items() if name in after.input_names}
    exact = high_precision.evaluate(before, values)
    sizes, more = high_precision.rounding_size(before, values), high_precision.rounding_size(after, left)
    for name, found in after.evaluate(left).items():
        assert abs(mpf(found) - exact[name]) <= FOUR_ULPS * (sizes[name] + more[name])


@settings(max_examples=examples(120), derandomize=True, database=None)
@given(cases(max_operations=30), st.data())
def test_on_random_graphs(case, data):
    graph = case.graph
    bound = data.draw(st.lists(st.sampled_from(graph.input_names), unique=True))
    kept = data.draw(st.lists(st.sampled_from(list(graph.outputs)), unique=True, min_size=1))
    results = [cg.simplify(graph), cg.specialize(graph, {name: case.values[name] for name in bound}, kept)]
    for result in results:
        assert_no_larger(result, graph)
    assume(high_precision.kink_distance(graph, case.values) > KINK_DISTANCE)
    for result in results:
        assert_same_values(result, graph, case.values)


def scene(seed: int) -> tuple[dyn.Mechanism, np.random.Generator]:
    """A random mechanism of 1 to 4 bodies; in every other one gravity pulls along an axis."""
    generator = np.random.default_rng(seed)
    found = random_mechanism(int(generator.integers(1, 5)), KINDS[seed % len(KINDS)], 3, seed)
    return (dyn.Mechanism(found.bodies, (0.0, 0.0, -9.81)) if seed % 2 else found), generator


@pytest.mark.parametrize("seed", [*range(8), *slow(*range(8, SCENES))])
def test_on_random_scenes(seed):
    model, generator = scene(seed)
    raw = dyn.inverse_dynamics(model, "chain_rule", simplify=False)
    simple = cg.simplify(raw)
    assert_no_larger(simple, raw)
    graphs = [raw, simple, dyn.forward_dynamics(model), dyn.energy(model)]
    for graph in graphs:
        values = {name: float(generator.choice([0.0, 1.0, generator.normal()])) for name in graph.input_names}
        bound = {name: value for name, value in values.items() if generator.random() < 0.4}
        kept = [name for name in graph.outputs if generator.random() < 0.6] or list(graph.outputs)
        special = cg.specialize(graph, bound, kept)
        assert_no_larger(special, graph)
        assert_no_larger(cg.specialize(special, {}), special)
    if seed % 10 == 0 and len(simple.nodes) < 700:
        values = dict(zip(raw.input_names, generator.normal(size=len(raw.inputs)).tolist(), strict=True))
        assert_same_values(simple, raw, values)


def test_a_changed_value_is_seen():
    """Test the tests: the tolerance does not hide another constant in the thirteenth digit."""
    x = cg.variable("x")
    graph, other = (cg.Graph([x], {"f": cg.sin(x) * c}) for c in (3.0, 3.0 * (1.0 + 1e-13)))
    with pytest.raises(AssertionError):
        assert_same_values(other, graph, {"x": 0.7})
    with pytest.raises(AssertionError):
        assert_no_larger(cg.Graph([x], {"f": cg.sin(x) * 3.0 + 0.0}), graph)
