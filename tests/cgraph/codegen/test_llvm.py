"""Machine code: every operation to the last bit, batches of any kind, threads, pickles."""

import copy
import math
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings

import cgraph as cg
from cgraph.codegen import batch_ir, llvm_engine, schedule
from cgraph.codegen.llvm_ir import scalar_ir
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from cgraph.program.functions import compiled as functions
from tests.cgraph.engines import evaluated, graph_of, points_of
from tests.each_row import each_row
from tests.repeated import repeated
from tests.strategies import cases, examples
from tests.ulps import same, ulps_apart

pytestmark = pytest.mark.optimized

pytest.importorskip("llvmlite")

BATCH_ULPS = 4.0  # of a batch against one point at a time


def batch_source(function):
    """The text of the function for batches."""
    return function._runner.columns("x")[1].source


def chain():
    """A graph with several outputs, one of them an input and one a constant, and an input that is not used."""
    x, y, z = cg.variables("x y z")
    u = cg.sin(x) * cg.cos(x) + cg.exp(y) + 4.0  # no cancellation, so that ulps can be counted
    return cg.Graph(
        [x, z, y], {"u": u, "v": cg.sqrt(u * u + 1.0) + y * y * u, "x": x, "c": cg.constant(2.5), "again": u}
    )


@pytest.mark.parametrize("op", [pytest.param(op, id=op.name) for op in OPS.values()])
def test_an_operation_is_that_of_evaluate_to_the_last_bit_and_on_vectors_to_some(op):
    graph, points = graph_of(op), points_of(op, 200)
    expected = evaluated(graph, points)
    function = cg.compile(graph, "llvm")
    for fused in (function, cg.compile(graph, "llvm", fma=False)):
        assert same(np.array([fused(point) for point in points]), expected)
    together = function.batch(np.array(points).T).T
    assert ulps_apart(together, expected) <= BATCH_ULPS
    assert np.all((np.signbit(together) == np.signbit(expected)) | np.isnan(expected))


@given(case=cases(max_operations=8))
@settings(max_examples=examples(30), deadline=None)
def test_a_random_graph_in_a_batch_agrees_in_every_lane_with_every_other(case):
    graph, values = case
    function = cg.compile(graph, "llvm")
    columns = function.batch(np.repeat([[values[name]] for name in graph.input_names], 11, axis=1))
    assert all(same(columns[:, k], columns[:, 0]) for k in range(11))


@pytest.mark.parametrize("lanes", [lanes for lanes in (2, 4, 8) if lanes <= llvm_engine.host().lanes])
@each_row(("n_in", "n_out"), [(2, 1), (3, 7), (8, 8), (9, 17), (30, 41)])
def test_points_in_rows_are_read_and_written_as_they_lie(n_in, n_out, lanes, monkeypatch):
    """Bit by bit what points in columns give, into part of an array too, whatever the vectors."""
    monkeypatch.setattr(llvm_engine.host(), "lanes", lanes)
    x = cg.variables([f"x{i}" for i in range(n_in)])
    function = cg.compile(cg.Graph(x, {f"y{k}": x[k % n_in] * x[(3 * k + 1) % n_in] + float(k) for k in range(n_out)}))
    for count in (0, 1, 7, 8, 19):
        rows = np.random.default_rng(count).normal(size=(count, n_in))
        expected, found = function.batch(np.ascontiguousarray(rows.T)), function.batch(rows.T)
        assert np.array_equal(found, expected)
        assert found.T.flags.c_contiguous
        wide = np.full((count, n_out + 5), 7.0)
        assert function.batch(rows.T, out=wide[:, 2:-3].T).base is wide
        assert np.array_equal(wide[:, 2:-3].T, expected)
        assert (np.delete(wide, np.s_[2:-3], axis=1) == 7.0).all()


def long_chain(count):
    """Calls one behind another, and values that live across all of them."""
    x = node = cg.variable("x")
    early = [cg.cos(x * float(k)) for k in range(5)]
    for k in range(count):
        node = cg.sin(node) * 0.9 + early[k % 5] if k % 2 else node * 0.9995 + cg.exp(-node * node)
    return cg.Graph([x], {"first": early[0], "y": node, "x": x, "sum": sum(early, node)})


@pytest.mark.parametrize("graph", [long_chain(20), chain()], ids=["long chain", "chain"])
@pytest.mark.parametrize("fma", [False, True])
def test_the_bits_do_not_depend_on_how_code_is_divided_and_optimized(monkeypatch, graph, fma):
    """At a point, in batches of some tiles and a rest, and in loops."""
    points = np.random.default_rng(0).uniform(0.1, 0.9, (len(graph.inputs), 8 * 5 + 3))
    carried = {"x": "v" if "v" in graph.outputs else "y"}

    def results():
        function = cg.compile(graph, "llvm", fma=fma)
        rows = repeated(graph, carried, "llvm", fma=fma)(points[:, 0], 3)
        return [function(points[:, 0]), function.batch(points), rows], function

    whole, function = results()
    assert "@part1" not in batch_source(function)
    assert "@point.part1" not in function.source
    settings = {
        "steps": (schedule, "STEPS", 7),
        "level 0": (llvm_engine, "QUICK", 3),
        "level 1": (llvm_engine, "SHORT", 3),
    }
    settings["tiles"] = batch_ir, "FEW_PLACES", -1
    settings["tiles of two"] = batch_ir, "VECTORS", 2
    for name, (module, setting, value) in settings.items():
        with monkeypatch.context() as patch:
            patch.setattr(module, setting, value)
            if name == "tiles of two":
                patch.setattr(batch_ir, "FEW_PLACES", -1)
            other, function = results()
            assert all(map(same, other, whole)), name
            assert name != "steps" or ("@part1" in batch_source(function) and "@point.part1" in function.source)
    monkeypatch.setattr(llvm_engine.host(), "registers", 3)
    assert all(map(same, results()[0], whole))
    assert fma or same(whole[0], evaluated(graph, points.T[:1])[0])


def test_outputs_that_are_constants_are_divided_among_functions():
    """LLVM takes a time that grows with the square of the stores in one of them."""
    x = cg.variable("x")
    outputs = {f"{k}": cg.constant(float(k % 7)) for k in range(5 * schedule.STEPS)} | {"y": x * x}
    function = cg.compile(cg.Graph([x], outputs), "llvm")
    assert max(part.count("store double") for part in function.source.split("define internal")) <= schedule.STEPS + 1
    assert function([3.0]).tolist() == [float(k % 7) for k in range(5 * schedule.STEPS)] + [9.0]


def test_constants_stand_in_a_table_and_divisors_in_instructions():
    """An instruction with the address of its constant is twice as long; LLVM divides by 2 with a product."""
    x = cg.variable("x")
    graph = cg.Graph([x], {"y": cg.sqrt(x * 1.1 + 1.3) / 2.0, "z": (x + 1.3) * x})
    source = scalar_ir(graph)
    assert "[2 x double]" in source
    assert source.count("load ptr, ptr @point.constants") == 1
    assert "fdiv double" in source
    assert [line.split()[-1] for line in source.splitlines() if "fdiv" in line] == ["0x4000000000000000"]


def test_values_wait_in_memory_where_there_are_more_than_registers():
    def places(registers):
        return len(set(re.findall(r"ptr %w, i64 (\d+)", scalar_ir(graph, registers=registers))))

    x = cg.variables([f"x{k}" for k in range(10)])
    squares = [a * a for a in x]
    total = sum(squares[1:], squares[0])
    graph = cg.Graph(x, {f"y{k}": square / total for k, square in enumerate(squares)})
    assert [places(registers) for registers in (40, 12, 11, 8, 5)] == [0, 0, 0, 3, 6]


def test_a_product_goes_into_its_sum_in_every_lane_and_at_a_point():
    """Of two products, of one that others need too, and where rows of a batch lie apart by a power of two."""
    a, b = cg.variables("a b")
    product = a * b
    few = cg.Graph([a, b], {"two": a * a - b * b, "sum": b + 3.0 * a, "kept": product - 1.0, "product": product})
    x = cg.variables([f"x{k}" for k in range(70)])
    many = cg.Graph(x, {f"y{k}": x[k] * x[k - 1] + 1.0 for k in range(70)})
    for graph, count in ((few, 43), (many, 512)):
        function = cg.compile(graph, "llvm")
        points = np.random.default_rng(count).normal(size=(len(graph.inputs), count))
        assert same(function.batch(points), np.array([function(point) for point in points.T]).T)


def test_auto_says_when_a_graph_is_too_large_for_machine_code(monkeypatch):
    monkeypatch.setattr(functions, "LARGE_GRAPH", 5)
    with pytest.warns(RuntimeWarning, match=r"has more than 5; backend='llvm' makes machine code"):
        function = cg.compile(chain())
    assert function.source == cg.compile(chain(), "python").source


@pytest.mark.parametrize("count", [1000, 4000])
def test_no_function_grows_with_the_graph(count):
    """On some graphs LLVM's time is quadratic in the length of a function."""
    functions = scalar_ir(long_chain(count)).split("define ")[1:]
    assert max(len(function.splitlines()) for function in functions) < 4 * schedule.STEPS
    assert len(functions) > count // schedule.STEPS


def test_fast_arithmetic_keeps_infinities_and_nan():
    x, y = cg.variables("x y")
    safe = apply(OPS["zero_safe_mul"], x, y)
    graph = cg.Graph([x, y], {"w": cg.where(x < 0.0, 0.0, cg.log(x)), "s": safe, "t": x * y})
    function = cg.compile(graph, "llvm", fast=True)
    points = [[0.0, math.inf], [-1.0, math.nan], [2.0, math.inf]]
    for point, expected in zip(points, evaluated(graph, points), strict=True):
        assert np.array_equal(function(point), expected, equal_nan=True)
        assert np.array_equal(function.batch(np.array([point] * 9).T)[:, 8], expected, equal_nan=True)


def test_a_pickle_of_another_version_is_refused_in_a_sentence(backend, monkeypatch):
    function = cg.compile(chain(), backend)
    with monkeypatch.context() as patch:
        patch.setattr(functions, "__version__", "0.0.9")
        written = pickle.dumps(function)
    with pytest.raises(
        ValueError, match=r"a compiled graph was pickled by cgraph 0\.0\.9, and this is cgraph .*: pickle"
    ):
        pickle.loads(written)
    assert same(copy.deepcopy(function)([0.1, 0.2, 0.3]), function([0.1, 0.2, 0.3]))


def test_the_source_is_the_text_of_llvm():
    function = cg.compile(chain(), "llvm")
    assert "define void @point" in function.source
    assert "contract" in function.source
    assert "contract" not in cg.compile(chain(), "llvm", fma=False).source
    assert "define void @batch" in batch_source(function)
    assert repr(function).startswith("<compiled <Graph (x, z, y)")
    assert cg.compile(chain()).source == function.source


def test_without_llvmlite_auto_is_generated_python(without, tmp_path):
    without("llvmlite")
    function = cg.compile(chain(), cache=tmp_path / "kept")
    assert list(tmp_path.iterdir()) == []
    assert function.source == cg.compile(chain(), "python").source
    assert same(function([0.1, 0.2, 0.3]), evaluated(chain(), [[0.1, 0.2, 0.3]])[0])
    assert function.batch(np.ones((3, 4))).shape == (5, 4)
    with pytest.raises(ImportError, match=r"pip install -e '\.\[native\]'"):
        cg.compile(chain(), "llvm")
