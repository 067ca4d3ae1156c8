"""Functions on vectors: their promise in ulps at every width, and the calls that machine code joins at one point."""

import ctypes
import itertools
import math
import pickle

import numpy as np
import pytest

import cgraph as cg
from cgraph.codegen import llvm_engine as llvm
from cgraph.codegen.batch_ir import batch_ir
from cgraph.codegen.llvm_ir import libm_functions
from cgraph.codegen.schedule import Joined, Merged, joined_calls, schedule
from cgraph.core.node import apply
from cgraph.core.traversal import topological
from cgraph.operations.operation import OPS
from tests.cgraph.engines import SPECIAL, evaluated, graph_of
from tests.each_row import each_row
from tests.ulps import exact, same, ulps_apart

pytestmark = pytest.mark.optimized

binding = pytest.importorskip("llvmlite.binding")

ULPS = 2.0  # what the polynomials promise
EDGES = (1e6, -1e6, np.nextafter(1e6, 2e6), -1e22, 1.7e308, -708.0, 709.0, 709.7, -745.0, 2.0**-1022, 2.0**-1040)
EDGES += tuple(math.pi / 2 * k for k in (2.0**20 + 1, 2.0**23 + 1, 2.0**26 - 2, 2.0**31 + 5))  # where an angle cancels
FUNCTIONS = ("sin", "cos", "exp", "log")  # by polynomials
OPTIONS = ({}, {"fma": False}, {"fast": True})


def angles():
    source = np.random.default_rng(0)
    spread = np.geomspace(1e-310, 1e6, 1500)
    uniform = source.uniform(-1e6, 1e6, 3000)
    small = source.uniform(-10.0, 10.0, 2000)
    near = np.arange(1.0, 636000.0, 331.0) * (math.pi / 2)  # where the reduction cancels
    worst = 6381956970095103.0 * 2.0 ** -np.arange(33.0, 60.0)  # digits of a famous neighbour of a multiple of pi/2
    far = np.geomspace(1e6, 1.7e308, 1000)
    quarters = np.pi / 2 * np.arange(-40.0, 41.0)
    return np.concatenate([spread, -spread, uniform, small, near, -near, worst, far, -far, quarters])


def exponents():
    uniform = np.random.default_rng(1).uniform(-708, 709, 3000)
    return np.concatenate([uniform, np.linspace(-2, 2, 1001), np.geomspace(1e-300, 1, 400)])


def positive():
    near_one = np.concatenate([np.linspace(0.4, 2.5, 3001), 1.0 + np.geomspace(1e-15, 1e-2, 400)])
    return np.concatenate([np.geomspace(2.3e-308, 1.7e308, 3000), near_one])


POINTS = {"sin": angles(), "cos": angles(), "exp": exponents(), "log": positive()}


def one(name):
    return graph_of(OPS[name])


def values_of(name, points):
    return evaluated(one(name), np.reshape(points, (-1, 1)))[:, 0]


def side_by_side(*names, width=1):
    """Each function of `width` inputs; the result of function f at input k is output f * width + k."""
    x = cg.variables([f"x{k}" for k in range(width)])
    return cg.Graph(x, {f"{name} {each.name}": apply(OPS[name], each) for name in names for each in x})


# Widths and processors: what one machine runs, another machine has to get right, too.


PROCESSORS = {  # features switched off -> a register that its code must not name
    "this": ("", None),
    "without AVX-512": ("avx512f", "zmm"),
    "without AVX and fused multiply-add": ("avx", "ymm"),
}


def compiled(graph, lanes, processor, flags="contract"):
    """A function of X (n_in, N) through `batch_ir` at any width, for this processor or one with less."""
    llvm.host()
    features = binding.get_host_cpu_features()
    off, register = PROCESSORS[processor]
    if off and not features.get(off):
        pytest.skip(f"this processor has no {off}")
    machine = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=features.flatten() + (f",-{off}" if off else ""),
        opt=llvm.LEVEL,
        jit=True,
    )
    llvm.host().compile("", libm_functions(graph), 0)  # finds the functions
    source, size = batch_ir(graph, lanes, flags)
    module = binding.parse_assembly(source, binding.create_context())
    if register:
        assert register not in machine.emit_assembly(module)
    engine = binding.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 3, ctypes.c_void_p)
    entry = kind(engine.get_function_address("batch"))
    memory = np.empty(size + 8)

    def function(points):
        count = points.shape[1]
        columns = -(-count // lanes) * lanes
        filled = np.ones((len(graph.inputs), columns))
        filled[:, :count] = points
        result = np.full((len(graph.outputs), columns), math.nan)
        aligned = -(-memory.ctypes.data // 64) * 64
        entry(filled.ctypes.data, result.ctypes.data, columns, columns, columns, aligned)
        return result[:, :count]

    function.engine = engine  # which owns the code
    return function


@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("processor", PROCESSORS)
def test_a_polynomial_keeps_its_promise_at_any_width(lanes, processor):
    for flags in ("contract", ""):
        function = compiled(side_by_side(*FUNCTIONS), lanes, processor, flags)
        for row, name in enumerate(FUNCTIONS):
            points = POINTS[name]
            assert exact(name, points).error_of(function(points[None])[row]) <= ULPS, (name, flags)


@pytest.mark.parametrize("lanes", [2, 4, 8])
@pytest.mark.parametrize("processor", PROCESSORS)
def test_a_special_number_in_any_lane_of_any_width(lanes, processor):
    names, specials = (*FUNCTIONS, "tan", "sqrt"), (*SPECIAL, *EDGES)
    function = compiled(side_by_side(*names), lanes, processor)
    good = np.linspace(0.1, 0.9, lanes)
    values = {name: (values_of(name, good), values_of(name, specials)) for name in names}
    for lane, (k, special) in itertools.product(range(lanes), enumerate(specials)):
        points = good.copy()
        points[lane] = special
        found = function(points[None])
        for row, name in enumerate(names):
            expected = values[name][0].copy()
            expected[lane] = values[name][1][k]
            assert ulps_apart(found[row], expected) <= ULPS, (name, special)
            assert np.all((np.signbit(found[row]) == np.signbit(expected)) | np.isnan(expected)), (name, special)


@pytest.mark.parametrize("lanes", [2, 4, 8])
def test_all_operations_at_any_width_are_those_of_evaluate(lanes):
    a, b, c = inputs = cg.variables("a b c")
    graph = cg.Graph(inputs, {name: apply(op, *(a, b, c)[: op.arity]) for name, op in OPS.items()})
    points = np.array(list(itertools.product(SPECIAL, SPECIAL, (0.0, 1.5, math.nan)))).T
    found = compiled(graph, lanes, "this", "")(points)
    assert same(found.T, evaluated(graph, points.T))


@each_row(("name", "options"), itertools.product(FUNCTIONS, OPTIONS))
def test_a_polynomial_keeps_its_promise_in_a_batch(name, options):
    found = cg.compile(one(name), "llvm", **options).batch(POINTS[name][None])[0]
    assert exact(name, POINTS[name]).error_of(found) <= ULPS


@each_row(("names", "options"), itertools.product([("sin",), ("cos",), ("sin", "cos"), ("exp",), ("log",)], OPTIONS))
def test_a_joined_call_keeps_the_promise(names, options):
    """With three inputs, one lane of a joined call is left over; strict arithmetic joins nothing."""
    function = cg.compile(side_by_side(*names, width=3), "llvm", **options)
    assert ("@lanes" in function.source) == (options != {"fma": False})
    points = POINTS[names[0]][::4]
    points = points[: len(points) // 3 * 3]
    found = np.array([function(row) for row in points.reshape(-1, 3)]).reshape(-1, len(names), 3)
    for k, name in enumerate(names):
        assert exact(name, points).error_of(found[:, k].ravel()) <= ULPS


@each_row(("name", "width"), itertools.product(FUNCTIONS, (2, 3, 4, 5)))
def test_a_special_number_in_any_place_of_a_joined_call(name, width):
    function = cg.compile(side_by_side(name, width=width), "llvm")
    assert "@lanes" in function.source
    for place, special in itertools.product(range(width), (*SPECIAL, *EDGES)):
        points = np.linspace(0.1, 0.9, width)
        points[place] = special
        found, expected = function(points), values_of(name, points)
        assert ulps_apart(found, expected) <= ULPS, special
        assert np.all((np.signbit(found) == np.signbit(expected)) | np.isnan(expected)), special


def test_sine_and_cosine_share_a_call_and_are_what_they_are_alone():
    both = cg.compile(side_by_side("sin", "cos"), "llvm").batch(angles()[None])
    alone = [cg.compile(one(name), "llvm").batch(angles()[None])[0] for name in ("sin", "cos")]
    assert same(both, np.array(alone))


def test_a_point_is_a_batch_of_one_where_calls_are_joined():
    function = cg.compile(side_by_side("sin", "cos", "exp", width=4), "llvm")
    points = np.random.default_rng(2).uniform(-9.0, 9.0, (4, 200))
    assert same(np.array([function(point) for point in points.T]).T, function.batch(points))
    assert "call double @sin" in cg.compile(one("sin"), "llvm").source  # with nothing to join, to the C library


def test_fast_arithmetic_leaves_the_reduction_of_an_argument_alone():
    source = cg.compile(side_by_side("sin", "exp"), "llvm", fast=True)._runner.columns("x")[1].source
    assert "reassoc" in source
    for constant in ("3FF921FB54400000", "3FE62E42FEE00000"):  # of pi / 2, of ln 2
        assert [line.split()[3] for line in source.splitlines() if constant in line] == ["contract"]


def test_calls_are_joined_that_do_not_need_each_other():
    x, y, z = cg.variables("x y z")
    first = [cg.sin(x), cg.cos(x), cg.cos(y * z)]
    second = [cg.sin(first[0] + y), cg.cos(first[2])]
    graph = cg.Graph([x, y, z], {f"f{k}": node for k, node in enumerate((*first, *second, cg.exp(x), cg.exp(y)))})
    calls = joined_calls(graph, 4)
    assert len({id(calls[node]) for node in first}) == 1
    assert len({id(calls[node]) for node in second}) == 1
    assert set(calls[first[0]].arguments) == {x, first[2].args[0]}
    assert len(set(calls.values())) == 3
    assert {calls[node] for node in graph.nodes if node.op.name == "exp"} == {Joined(("exp",), (x, y))}


@each_row(("count", "together", "expected"), [(9, 4, [4, 4]), (10, 4, [4, 4, 2]), (3, 8, [3])])
def test_a_joined_call_has_at_most_so_many_arguments_and_one_left_over_stays_alone(count, together, expected):
    calls = joined_calls(side_by_side("log", width=count), together)
    assert [len(call.arguments) for call in dict.fromkeys(calls.values())] == expected


def test_one_at_a_time_only_sine_and_cosine_of_one_angle_are_joined():
    calls = joined_calls(side_by_side("sin", "cos", "exp", width=3), 1)
    assert {call.names for call in calls.values()} == {("sin", "cos")}
    assert all(len(call.arguments) == 1 for call in calls.values())


def two_chains(steps=40):
    """Two long products made side by side, in a graph that names one after the other, with a sum of 0 to fold."""
    a, b = nodes = cg.variables("a b")
    for _ in range(steps):
        nodes = [cg.sqrt(node * (node + 0.0) + 1.0) for node in nodes]
    return cg.Graph([a, b], dict(zip("ab", nodes, strict=True)))


@each_row("graph", [two_chains(), cg.simplify(two_chains()), pickle.loads(pickle.dumps(two_chains()))])
def test_operations_are_computed_in_the_order_in_which_they_were_made(graph):
    order = list(schedule(graph, Merged({}, {})))
    assert order == sorted(order, key=lambda node: node.serial)
    roots = [node for node in order if node.op.name == "sqrt"]
    below = [set(topological([node])) for node in graph.outputs.values()]
    assert [root in below[k % 2] for k, root in enumerate(roots)] == [True] * 80
