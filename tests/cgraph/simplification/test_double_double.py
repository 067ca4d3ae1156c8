"""Double-double: beside multiprecision, where sums cancel, in every back end."""

import itertools
import math
import operator

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph.core.node import apply
from cgraph.core.traversal import topological
from cgraph.extend import OPS
from tests.each_row import each_row
from tests.strategies import examples
from tests.tolerances import EQUATIONS, LONG_SUM

ROUND = 2.0**-98  # of an operation, with some to spare; relative to a bound on the terms that went into it
BACKENDS = {"python": {}, "numpy": {}, "llvm": {}, "llvm without fused multiply-add": {"fma": False}}


RULES = {  # value, and bound of its terms
    "add": lambda a, da, b, db: (a + b, da + db),
    "sub": lambda a, da, b, db: (a - b, da + db),
    "mul": lambda a, da, b, db: (a * b, da * db),
    "div": lambda a, da, b, db: (a / b, da / abs(b) + abs(a / b) * db / abs(b)),
    "neg": lambda a, da, *_: (-a, da),
    "sqrt": lambda a, da, *_: (mpmath.sqrt(a), da / mpmath.sqrt(a)),
    "pow": lambda a, da, b, db: (a**b, abs(b) * abs(a) ** (b - 1) * da),
}


def evaluated(graph, point):
    """(value, bound) of each output to 80 digits: the bound sums magnitudes where the value sums terms."""
    found = {}
    names = dict(zip(graph.input_names, map(mpmath.mpf, point), strict=True))
    for node in topological(graph.outputs.values()):
        if not node.args:
            value = names[node.name] if node.value is None else mpmath.mpf(node.value)
            found[node] = value, abs(value)
            continue
        (a, da), *more = [found[arg] for arg in node.args]
        b, db = more[0] if more else (mpmath.mpf(0), mpmath.mpf(0))
        found[node] = RULES[node.op.name](a, da, b, db)
    return [found[node] for node in graph.outputs.values()]


def both_parts(graph, point, backend="python", **options):
    """Values of the outputs and their low parts, as sums to 80 digits."""
    compiled = cg.compile(cg.double_double(graph, low=True), backend.split()[0], **options)
    found = np.asarray(compiled(np.array(point, dtype=np.float64)))
    half = len(graph.outputs)
    return [mpmath.mpf(hi) + mpmath.mpf(lo) for hi, lo in zip(found[:half], found[half:], strict=True)]


ARITHMETIC = (operator.add, operator.sub, operator.mul, lambda a, b: a / (b * b + 1.0))
leaves = st.sampled_from([*cg.variables("x y z"), cg.constant(3.0), cg.constant(0.1), cg.constant(-1e8)])
nodes = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(inner, inner).flatmap(lambda t: st.sampled_from([each(*t) for each in ARITHMETIC])),
        inner.map(lambda node: cg.sqrt(2.0 + node * node)),
        st.tuples(inner, st.sampled_from([2.0, 3.0, 7.0])).map(lambda t: t[0] ** t[1]),
        inner.map(lambda node: -node),
    ),
    max_leaves=25,
)
numbers = st.floats(0.5, 2.0).map(lambda x: x * (1.0 + 2.0**-40)) | st.floats(-1e6, 1e6).filter(lambda x: abs(x) > 1e-6)


@given(nodes, st.tuples(numbers, numbers, numbers))
@settings(max_examples=examples(300))
def test_random_arithmetic_keeps_twice_the_digits(node, point):
    graph = cg.Graph(cg.variables("x y z"), {"f": node, "g": (node + 1e10) - node})
    with mpmath.workdps(80):
        for found, (value, bound) in zip(both_parts(graph, point), evaluated(graph, point), strict=True):
            if 1e-100 < bound < 1e100:
                assert abs(found - value) <= ROUND * len(graph.nodes) * bound


x, y, z = cg.variables("x y z")
HARD = {
    "what a sum loses": (((x + y) - x) - y, (1.0, 1e-20, 0.0)),
    "what a product loses": (x * x - y * z, (1.0 + 2.0**-30, 1.0 + 2.0**-29, 1.0 + 2.0**-60)),
    "Rump": (
        333.75 * y**6.0 + x * x * (11.0 * x * x * y * y - y**6.0 - 121.0 * y**4.0 - 2.0) + 5.5 * y**8.0,
        (77.617, 33.096, 0.0),
    ),
    "a root of a polynomial": ((x - 1.0) ** 7.0 - (x**7.0 - 7.0 * x**6.0 + 21.0 * x**5.0), (1.0 + 1e-6, 0.0, 0.0)),
    "quotients": (x / y - (x + z) / y, (1.0, 3.0, 1e-20)),
    "root": (cg.sqrt(x * x + y) - x, (1e5, 1e-3, 0.0)),
    "a negative power": (x**-3.0 - 1.0 / (x * x * x + y), (3.0, 1e-18, 0.0)),
}


@pytest.mark.parametrize("backend", BACKENDS)
def test_cancellation_in_every_back_end(backend):
    if backend.startswith("llvm"):
        pytest.importorskip("llvmlite")
    for name, (node, point) in HARD.items():
        graph = cg.Graph([x, y, z], {"f": node})
        with mpmath.workdps(80):
            ((value, bound),) = evaluated(graph, point)
            (found,) = both_parts(graph, point, backend, **BACKENDS[backend])
            assert abs(found - value) <= ROUND * bound, name
            plain = graph.evaluate(dict(zip("xyz", point, strict=True)))["f"]
            assert abs(plain - value) > 1e6 * ROUND * bound  # float64 does not do it


def test_vectors_agree_with_one_point():
    pytest.importorskip("llvmlite")
    graph = cg.double_double(cg.Graph([x, y, z], {name: node for name, (node, _) in HARD.items()}), low=True)
    rng = np.random.default_rng(1)
    points = rng.uniform(0.5, 2.0, (3, 21))
    compiled = cg.compile(graph, "llvm")
    columns = [compiled(np.ascontiguousarray(column)) for column in points.T]
    rows = compiled.batch(points).T
    assert rows == pytest.approx(np.array(columns), rel=LONG_SUM, abs=1e-25)


CHOICES = (
    (cg.where(x + y > x, 1.0, 2.0), (1.0, 1e-20), 1.0),
    (cg.where(x + y <= x, 1.0, 2.0), (1.0, 1e-20), 2.0),
    (cg.where(cg.equal(x + y, x), 1.0, 2.0), (1.0, 1e-20), 2.0),
    (cg.where(cg.not_equal(x + y, x), 1.0, 2.0), (1.0, 1e-20), 1.0),
    (cg.where((x + y) - x, 1.0, 2.0), (1.0, 1e-20), 1.0),
    (cg.minimum(x + y, x) - x, (1.0, -1e-20), -1e-20),
    (cg.maximum(x + y, x) - x, (1.0, -1e-20), 0.0),
    (cg.maximum(x, x + y) - x, (1.0, 1e-20), 1e-20),
    (abs(y - x) - x, (1.0, 1e-20), -1e-20),
    (cg.sign((x + y) - x), (1.0, -1e-20), -1.0),
    (cg.where(x > 0.0, x + y, y) - x, (1.0, 1e-20), 1e-20),
    (cg.sqrt(x), (0.0, 0.0), 0.0),
)


def test_choices_see_the_low_part():
    for node, point, expected in CHOICES:
        compiled = cg.compile(cg.double_double(cg.Graph([x, y], {"f": node})), "python")
        assert compiled(np.array(point))[0] == pytest.approx(expected, rel=LONG_SUM, abs=0.0)


@each_row("function", [cg.sin, cg.cos, cg.exp, cg.atan, cg.tanh, cg.log, cg.cosh])
def test_functions_take_the_low_part_of_their_argument_to_first_order(function):
    graph = cg.Graph([x, y], {"f": function(x + y) - function(x)})
    compiled = cg.compile(cg.double_double(graph), "python")
    with mpmath.workdps(40):
        slope = mpmath.diff(getattr(mpmath, function.__name__), 0.7)
    assert compiled(np.array([0.7, 1e-20]))[0] == pytest.approx(1e-20 * float(slope), rel=EQUATIONS)


def test_constants_are_folded_and_tags_and_inputs_stay():
    with cg.tag("spring"):
        node = x * x * 3.0
    graph = cg.Graph([x, y], {"f": node})
    found = cg.double_double(graph)
    assert found.input_names == ("x", "y")
    assert list(found.outputs) == ["f"]
    assert list(cg.double_double(graph, low=True).outputs) == ["f", "f_low"]
    assert all("spring" in each.tags for each in found.nodes if each.args)
    assert cg.double_double(cg.Graph([], {"c": cg.constant(2.0) * 3.0 + 1.0})).evaluate({})["c"] == 7.0


def test_a_special_constant_has_the_value_of_float64_or_none():
    """As any argument of any operation. NaN stands for what pairs lose: infinities, and what overflows on the way."""
    slots = [(op, slot) for op in OPS.values() for slot in range(op.arity)]
    for (op, slot), special in itertools.product(slots, (math.inf, -math.inf, 0.0, 0.5, -3.0, 64.5, 1e300)):
        args = [x, y, z][: op.arity]
        args[slot] = cg.constant(special)
        for low in (cg.constant(0.0), 1e-20 * z)[: 1 + (op.jumps is None)]:
            rest = [arg if arg.value is not None else arg + low for arg in args]
            graph = cg.Graph([x, y, z], {"f": apply(op, *rest)})
            for size in (0.7, 1.5):  # not 1, whose infinite power the low part decides
                values = dict.fromkeys("xyz", size)
                (found,), (plain,) = (each.evaluate(values).values() for each in (cg.double_double(graph), graph))
                near = pytest.approx(plain, rel=1e-14, nan_ok=True)
                assert math.isnan(found) or found == near, (op, slot, special, size)


def test_beyond_the_range_is_not_a_number():
    compiled = cg.compile(cg.double_double(cg.Graph([x, y], {"f": x * y})), "python")
    assert compiled(np.array([1e150, 1e150]))[0] == pytest.approx(1e300)
    assert math.isnan(compiled(np.array([1e305, 1e305]))[0])
    assert math.isnan(compiled(np.array([math.nan, 1.0]))[0])
