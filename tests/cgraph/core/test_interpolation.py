"""`interp`: tables as functions, beside NumPy's and SciPy's, and alike on every back end."""

import math
import pickle
import re

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.operations.table import FLAT
from tests.cgraph.engines import ENGINES, evaluated
from tests.each_row import each_row
from tests.slow import slow
from tests.ulps import same

KINDS = ("linear", "monotone", "natural")
OUTSIDE = ("constant", "linear")
ROUNDING = 1e-12  # of the largest value, over the smallest step for each derivative: a few dozen terms in another order
X = cg.variable("x")


def table(seed, *, least=2):
    """Knots and values: rough, in steps with flat stretches, or smooth; of any size."""
    draw = np.random.default_rng(seed)
    n = int(draw.integers(least, 25))
    xs = np.cumsum(draw.uniform(0.05, 1.0, n)) * 10.0 ** draw.uniform(-3, 3) - draw.uniform(-1, 1)
    ys = [draw.normal(size=n), np.cumsum(np.round(draw.uniform(0, 1.5, n))), np.sin(np.arange(n))][seed % 3]
    return xs, ys * 10.0 ** draw.uniform(-5, 5)


def with_slopes(node):
    graph = cg.Graph([X], {"y": node})
    slope = cg.gradient(graph)
    (y,), (d,), (c,) = [each.outputs.values() for each in (graph, slope, cg.gradient(slope))]
    return cg.Graph([X], {"y": y, "d": d, "c": c})


def reference(xs, ys, kind):
    scipy = pytest.importorskip("scipy.interpolate")
    if kind == "linear" or len(xs) == 2:
        exact = scipy.PPoly(np.array([np.diff(ys) / np.diff(xs), ys[:-1]]), xs)
    else:
        exact = scipy.PchipInterpolator(xs, ys) if kind == "monotone" else scipy.CubicSpline(xs, ys, bc_type="natural")
    return [exact, exact.derivative(), exact.derivative(2)]


@pytest.mark.parametrize("seeds", [range(6), *slow(range(6, 300))])
def test_values_and_slopes_are_those_of_scipy(seeds):
    for seed in seeds:
        xs, ys = table(seed)
        points = np.concatenate([np.random.default_rng(seed).uniform(xs[0], xs[-1], 100), xs[:-1]])
        for kind in KINDS:
            found = cg.compile(with_slopes(cg.interp(X, xs, ys, kind)), "numpy").batch([points])
            for order, (row, exact) in enumerate(zip(found, reference(xs, ys, kind), strict=True)):
                error = np.abs(row - exact(points)).max()
                assert error <= ROUNDING * np.abs(ys).max() / np.diff(xs).min() ** order, (seed, kind, order)


@each_row("n", [2, 3, 4, 7, 8, 9, 31, 32, 33, 100])
def test_a_table_of_any_size_is_searched_by_bisection(n):
    xs = np.arange(n) + 0.0
    ys = np.random.default_rng(n).normal(size=n)
    graph = cg.Graph([X], {"y": cg.interp(X, xs, ys, "linear")})
    points = np.concatenate([xs, np.nextafter(xs, -np.inf), xs + 0.5, [-1e3, 1e3]])
    assert np.abs(graph.evaluate({"x": points})["y"] - np.interp(points, xs, ys)).max() <= ROUNDING
    assert sum(node.op.name == "less" for node in graph.nodes) == n.bit_length()


@each_row("kind, outside", [(kind, outside) for kind in KINDS for outside in OUTSIDE])
def test_outside_it_goes_on_as_it_is_told(kind, outside):
    xs, ys = [0.0, 1.0, 3.0], [1.0, 2.0, 7.0]
    graph = with_slopes(cg.interp(X, xs, ys, kind, outside))
    ends = {x: graph.evaluate({"x": x}) for x in (-2.0, 0.0, math.nextafter(3.0, 0.0), 3.0, 5.0)}
    if outside == "constant":
        assert ends[-2.0] == {"y": 1.0, "d": 0.0, "c": 0.0}
        assert ends[5.0] == {"y": 7.0, "d": 0.0, "c": 0.0}
    else:
        assert ends[-2.0]["y"] == pytest.approx(1.0 - 2.0 * ends[0.0]["d"])
        assert ends[5.0]["y"] == pytest.approx(7.0 + 2.0 * ends[math.nextafter(3.0, 0.0)]["d"])
        assert ends[5.0]["c"] == ends[-2.0]["c"] == 0.0
    assert math.isnan(graph.evaluate({"x": math.nan})["y"])
    assert [graph.evaluate({"x": x})["y"] for x in xs] == ys


@each_row("seed", range(8))
def test_a_monotone_table_never_leaves_the_values_beside(seed):
    xs, ys = table(seed)
    points = np.sort(np.random.default_rng(seed).uniform(xs[0], xs[-1], 300))
    found = cg.compile(cg.Graph([X], {"y": cg.interp(X, xs, ys, "monotone")}), "numpy").batch([points])[0]
    place = np.searchsorted(xs, points, side="right") - 1
    slack = ROUNDING * np.abs(ys).max()
    assert (found >= np.minimum(ys[place], ys[place + 1]) - slack).all()
    assert (found <= np.maximum(ys[place], ys[place + 1]) + slack).all()


def all_kinds(seed=0, **more):
    """One graph of a table in every kind, with its derivatives."""
    xs, ys = table(seed, least=4)
    outputs = {}
    for kind in KINDS:
        made = with_slopes(cg.interp(X, xs, ys, kind, **more))
        outputs |= {f"{name} {kind}": node for name, node in made.outputs.items()}
    ends = (xs[0] - 1.0, xs[-1] + 1.0)
    return cg.Graph([X], outputs), np.concatenate([np.random.default_rng(seed).uniform(*ends, 60), xs])[:, None]


@pytest.mark.parametrize("engine", ENGINES)
def test_every_engine_has_the_bits_of_evaluation(engine):
    graph, points = all_kinds(outside="linear")
    function = cg.compile(graph, engine, **({"fma": False} if engine == "llvm" else {}))
    assert same(function.batch(points.T).T, evaluated(graph, points))
    assert same(np.array([function(point) for point in points]), evaluated(graph, points))


@pytest.mark.parametrize("kind", KINDS)
def test_comparisons_say_whether_their_knots_are_kinks_through_all_transforms(kind):
    at, k = cg.variables("at k")
    knots, values = [0.0, 1.0, 3.0, 4.0], [0.0, 2.0, 1.0, 1.5]

    def smooth(graph):
        return {"smooth" in node.roles for node in graph.nodes if node.op.name in FLAT}

    table = cg.Graph([at, k], {"y": k * cg.interp(at * at, knots, values, kind, "linear")})
    slopes = cg.jvp(cg.gradient(cg.simplify(table), "at"), "at")
    held = cg.Graph([at], {"y": cg.interp(at, knots, values, kind)})  # its ends are kinks of minimum and maximum
    for graph in (table, held, slopes, cg.specialize(slopes, {"at": k + 1.0}), pickle.loads(pickle.dumps(slopes))):
        assert smooth(graph) == {kind != "linear"}
    beside = cg.Graph([at, k], {"y": table.outputs["y"] + cg.where(at * at < 1.0, at, k)})
    assert smooth(cg.simplify(beside)) == {kind != "linear", False}


def test_a_reference_solution_has_its_digits_through_a_knot():
    """x_dot = 1 + x up to x = 1, then 2 x."""
    table = dyn.OdeSystem(lambda x, t: [cg.interp(x[0], [0.0, 1.0, 2.0], [1.0, 2.0, 4.0], outside="linear")], ["x"])
    found = dyn.reference(table, [0.25], None, [1.0], digits=20).decimal[0][0]
    assert float(found) == pytest.approx(math.exp(2.0) / 1.6**2, rel=1e-15)
    run = dyn.simulate(table, [0.25], None, 1.0, rtol=1e-10)
    assert run.q[-1, 0] == pytest.approx(float(found), rel=1e-8)
    series = dyn.simulate(table, [0.25], None, 1.0, "taylor", rtol=1e-14)
    assert series.q[-1, 0] == pytest.approx(float(found), rel=1e-13)


@each_row("kind", KINDS)
def test_values_may_be_nodes_whose_derivatives_are_those_of_differences(kind):
    xs, names = [0.0, 1.0, 2.5, 4.0], ["a", "b", "c", "d"]
    ys = cg.variables(names)
    graph = cg.Graph([X, *ys], {"y": cg.interp(X, xs, ys, kind, "linear")})
    at = dict(zip(["x", *names], [1.7, 0.3, 0.5, 1.9, 2.0], strict=True))
    slopes = cg.gradient(graph).evaluate(at)
    for name in at:
        ends = [graph.evaluate({**at, name: at[name] + step})["y"] for step in (-1e-5, 1e-5)]
        assert slopes[f"dy/d{name}"] == pytest.approx((ends[1] - ends[0]) / 2e-5, rel=1e-7)
    numbers = cg.Graph([X], {"y": cg.interp(X, xs, [at[name] for name in names], kind, "linear")})
    assert graph.evaluate(at)["y"] == pytest.approx(numbers.evaluate({"x": 1.7})["y"], rel=ROUNDING)


@each_row(
    "arguments, said",
    [
        (([0.0, 1.0, 1.0], [0.0] * 3), "xs of interp must increase strictly, got xs[1] = 1.0 and xs[2] = 1.0"),
        (([0.0, -1.0], [0.0] * 2), "xs of interp must increase strictly, got xs[0] = 0.0 and xs[1] = -1.0"),
        (([0.0, math.nan], [0.0] * 2), "xs of interp must be finite, got xs[1] = nan"),
        (([0.0, 1.0], [0.0, math.inf]), "ys of interp must be finite, got ys[1] = inf"),
        (([0.0, 1.0], [0.0] * 3), "ys of interp must have a value for each of the 2 knots, got 3"),
        (([0.0], [0.0]), "xs of interp must be a sequence of two knots or more, got shape (1,)"),
        (([0.0, 5e-324], [0.0, 1.0]), "interp: a slope of the table is too large for float64"),
        (([0.0, 1.0], [0.0, 1.0], "cubic"), "kind of interp must be"),
        (([0.0, 1.0], [0.0, 1.0], "linear", "nan"), "outside of interp must be"),
    ],
)
def test_what_is_no_table_is_told(arguments, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        cg.interp(X, *arguments)


@each_row(
    "wrong, says", [(float, "cg.interp"), (bool, "cg.where"), (lambda x: np.interp(x, [0, 1], [0, 1]), "cg.interp")]
)
def test_a_node_where_a_number_is_needed_says_what_to_take(wrong, says):
    with pytest.raises(TypeError, match=says):
        wrong(X)
