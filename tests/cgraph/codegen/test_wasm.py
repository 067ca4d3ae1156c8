"""WebAssembly: operations and graphs to the last bit of evaluation, and steps to the last bit of `simulate`."""

import itertools
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings

import cgraph as cg
import dynamics as dyn
from cgraph.codegen.wasm.functions import library, page_functions, text_of
from cgraph.core.node import apply
from cgraph.operations.operation import OPS, Op
from dynamics.integrators import TABLEAUS
from tests.cgraph.engines import SPECIAL, graph_of
from tests.each_row import each_row
from tests.strategies import cases, examples
from tests.tolerances import SUMS
from tests.ulps import same, ulps_apart
from tests.wasm import instance
from viz.paper.mechanisms import turned_arm

X, Y = cg.variables("x y")
STATE = cg.Graph([X, Y], {"x_dot": Y, "y_dot": -X})


def calls(op):
    """Whether the module computes the operation by a function of its own, which rounds otherwise than the C library."""
    return op.name in library(0) and op.name not in ("minimum", "maximum", "sign", "fmod")


@cache
def single(op):
    """The module of an operation alone."""
    return instance(graph_of(op))


@pytest.fixture(scope="module", autouse=True)
def let_go():
    """No module outlives wasmtime, which Python may end first."""
    yield
    single.cache_clear()


@each_row("op", OPS.values())
def test_every_operation_is_that_of_evaluate_and_a_function_agrees_in_kind(op):
    """Where no function intervenes to the last bit; else in zeros and their signs, infinities and NaN."""
    call, near = single(op), 12.0 if calls(op) else 0.0
    special = SPECIAL if op.arity < 3 else SPECIAL[::3]
    for point in [*itertools.product(special, repeat=op.arity), *op.samples]:
        found, expected = call(*point), [float(op.scalar(*point))]
        if expected[0] == 0.0 or near == 0.0:
            assert same(found, expected), point
        assert ulps_apart(found, expected) <= near, point


@given(case=cases(max_operations=30))
@settings(max_examples=examples(40))
def test_random_graphs_agree_to_the_last_bit_with_operations_one_by_one(case):
    """Those of evaluation, and in place of the C library's functions the modules' own."""
    values = {}
    for node in case.graph.nodes:
        if node.op.name == "variable":
            values[node] = case.values[node.name]
        elif node.op.name == "constant":
            values[node] = node.value
        else:
            point = [values[arg] for arg in node.args]
            values[node] = single(node.op)(*point)[0] if calls(node.op) else float(node.op.scalar(*point))
    found = instance(case.graph)(*[case.values[name] for name in case.graph.input_names])
    assert same(found, [values[node] for node in case.graph.outputs.values()])


def test_inputs_unused_passed_on_and_shared_by_outputs():
    z = cg.variable("z")
    u = X * Y
    outputs = {"a": u, "b": u, "x": X, "again": X, "c": -math.inf, "d": -0.0, "e": 0.1, "f": -0.1 * X}
    call = instance(cg.Graph([z, Y, X], outputs))
    assert same(call(3.0, 0.5, 7.0), [3.5, 3.5, 7.0, 7.0, -math.inf, -0.0, 0.1, -0.1 * 7.0])
    assert instance(cg.Graph([], {"y": cg.sin(cg.constant(0.3))}))() == [math.sin(0.3)]
    numbers = [0.0, -0.0, 1.0, -64.0, -63.0, 63.0, 64.0, 0.5, 0.1, 1e300, 5e-324, 2.0**127, 2.0**-149, 3.4e38, -2.5]
    constants = instance(cg.Graph([X], {f"{k}": number for k, number in enumerate(numbers)}))
    assert same(constants(0.0), numbers)  # each way of writing them


def test_a_deep_graph_and_a_wide_one_need_no_recursion():
    node = X
    for _ in range(5_000):
        node = node * 0.5 + 1.0
    wide = [X * float(k) for k in range(200)]
    total = sum([a * b for a, b in itertools.pairwise(wide)], start=cg.constant(0.0))
    graph = cg.Graph([X], {"deep": node, "wide": total})
    assert same(instance(graph)(0.3), list(graph.evaluate({"x": 0.3}).values()))


def test_the_bytes_are_these():
    """Whatever the machine: a header, the type (i32, i32) -> (), a page of memory, two exports, the code."""
    expected = "0061736d0100000001060160027f7f00030201000503010001071502066d656d6f72790200"
    expected += "086576616c7561746500000a19011701017c200120002b030022022002a24101b7a03903000b"
    assert cg.to_wasm(cg.Graph([X], {"y": X * X + 1.0})).hex() == expected


def test_sizes_of_arms():
    """The equations of the three-link arm are 659 bytes; exact sine and cosine of any argument take 0.75 kB."""
    three, seven = dyn.forward_dynamics(dyn.scenes.load("triple_pendulum")), dyn.forward_dynamics(turned_arm(7))
    assert len(cg.to_wasm(three, host=("sin", "cos"))) <= 800
    assert len(cg.to_wasm(three)) <= 1500
    assert len(cg.to_wasm(seven)) <= 9000


def test_functions_of_the_host_are_imported_when_asked_for():
    graph = cg.Graph([X], {"y": cg.sin(X) + cg.exp(X)})
    made = instance(graph, host=("sin", "cos"))
    assert made.imports == ["sin"]
    assert ulps_apart(made(0.7), [math.sin(0.7) + math.exp(0.7)]) <= 1.0
    assert instance(graph).imports == []


@each_row("name", ["wave", "product", "load", "double", "evaluate"])
def test_an_operation_called_as_a_function_within_is_none(name):
    """Rows of a program of its own have any name."""
    text = text_of(type(OPS["sin"])(name, 1, math.sin, np.sin, lambda y, a: (1.0,), ((0.3,),)), ())
    assert text.func.id == f"math.{name}"


# Steps.


def linear(x, y, t):
    """A state equation of products and sums alone."""
    return [y, -x * 1.7 - 0.3 * y * x * x + 0.25 * t]


@pytest.mark.parametrize("method", ["euler", "rk4"])
@pytest.mark.parametrize("timed", [False, True])
def test_a_thousand_steps_are_those_of_simulate_to_the_last_bit(method, timed):
    model = dyn.OdeSystem(lambda x, t: linear(x[0], x[1], t if timed else 1.0), ["x", "y"])
    motion = dyn.simulate(model, [0.7, -0.2], None, 10.0, method, dt=0.01, backend="python", rtol=0.1)
    assert motion.stats.success
    graph = dyn.state_equation(model)
    found = instance(graph, TABLEAUS).step(method, [0.7, -0.2, *[0.0] * timed], 0.01, 1000)
    assert same(found[:2], motion.q[-1])
    if timed:
        assert found[2] == motion.t[-1]


def test_a_thousand_steps_of_an_arm_are_those_of_simulate_to_the_last_digits():
    """Its sines differ from the C library's now and then in the last bit, and errors of a bit grow with the motion."""
    arm = dyn.scenes.load("triple_pendulum")
    motion = dyn.simulate(arm, arm.q, arm.qd, 1.0, "rk4", dt=0.001, backend="python")
    assert motion.stats.success
    graph = dyn.state_equation(arm)
    found = instance(graph, TABLEAUS).step("rk4", [*arm.q, *arm.qd, 0.0, 0.0, 0.0], 0.001, 1000)
    np.testing.assert_allclose(found[:6], [*motion.q[-1], *motion.qd[-1]], rtol=SUMS)


def test_steps_go_on_where_they_ended_and_keep_parameters():
    made = instance(dyn.state_equation(dyn.scenes.load("spring_mass")), TABLEAUS)
    start = [1.0, 0.0, 0.2, 1.5, 4.0]
    half = made.step("rk4", start, 0.01, 50)
    assert half[2:] == start[2:]
    assert made.step("rk4", half, 0.01, 50) == made.step("rk4", start, 0.01, 100)
    assert made.step("rk4", start, 0.01, 0) == start


@pytest.mark.parametrize("method", ["euler", "rk4", "dopri5"])
def test_the_order_of_a_method_is_its_own(method):
    made = instance(STATE, TABLEAUS)
    errors = [abs(made.step(method, [1.0, 0.0], 1.0 / n, n)[0] - math.cos(1.0)) for n in (8, 16)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(TABLEAUS[method].order, abs=0.35)


def reached(made, inputs, span, h, rtol, most=10_000):
    """The inputs after a span by chosen steps, and the step to go on with."""
    made.write(inputs)
    step = made.exports["dopri5_to"](made._store, 0, span, h, rtol, rtol, float(most))
    return made.read(0, made.sizes[0]), step


@each_row(("h", "rtol"), itertools.product((1e-6, 0.1, 50.0), (1e-4, 1e-7, 1e-10)))
def test_chosen_steps_keep_the_tolerance_whatever_the_first_is(h, rtol):
    (x, y), _ = reached(instance(STATE, TABLEAUS), [1.0, 0.0], 10.0, h, rtol)
    assert math.hypot(x - math.cos(10.0), y + math.sin(10.0)) <= 10.0 * rtol


def test_chosen_steps_end_at_the_end_and_go_on_with_the_step_they_had():
    t = cg.variable("t")
    made = instance(cg.Graph([X, t], {"x_dot": cg.cos(t)}), TABLEAUS)
    (x, end), step = reached(made, [0.0, 0.0], 2.0, 0.1, 1e-8)
    assert end == pytest.approx(2.0, rel=1e-15)
    assert x == pytest.approx(math.sin(2.0), abs=1e-7)
    (_, end), again = reached(made, [x, end], 1e-3, step, 1e-8)
    assert again >= step  # a span that is short says nothing about the step
    assert end == pytest.approx(2.001, rel=1e-15)


@pytest.mark.parametrize(
    "rate", [X * X, cg.sqrt(-X), 1.0 / (X - X)], ids=["blows up", "leaves the domain", "is nowhere"]
)
def test_chosen_steps_that_cannot_arrive_end_and_say_so(rate):
    made = instance(cg.Graph([X], {"x_dot": rate}), TABLEAUS)
    (x,), step = reached(made, [1.0], 2.0, 0.1, 1e-6, most=500)
    assert math.isnan(step)
    assert math.isfinite(x)  # the last state that was accepted


def test_memory_has_room_for_all_that_is_documented():
    """Inputs at 0, outputs behind them; steps spoil neither outputs nor the digits that sines need."""
    wide = [cg.variable(f"x{k}") for k in range(700)]
    graph = cg.Graph(wide, {f"y{k}": cg.sin(each) for k, each in enumerate(wide)})
    made = instance(graph, TABLEAUS)
    point = [1e20 + 1e6 * k for k in range(700)]
    before = made(*point)
    made.step("dopri5", point, 1e-3, 1)
    assert made(*point) == before
    assert ulps_apart(before, np.sin(point)) <= 2.0


def versin(python: str, javascript: str = "") -> cg.Graph:
    """An operation of a program's own, with a text in Python."""
    op = Op("versin", 1, lambda x: 2.0 * math.sin(x / 2.0) ** 2, lambda x: 2.0 * np.sin(x / 2.0) ** 2,
            lambda y, x: (cg.sin(x),), samples=((0.6,),), python=python, javascript=javascript)  # fmt: skip
    return cg.Graph([X], {"y": apply(op, X)})


def test_an_operation_of_ones_own_is_computed_in_a_module_or_imported():
    made = instance(versin("2.0 * sin({0} / 2.0) ** 2"))
    assert made.imports == []
    assert made(0.6) == pytest.approx([2.0 * math.sin(0.3) ** 2], rel=1e-15)
    function = "(x) => 2 * Math.sin(x / 2) ** 2"
    assert page_functions(versin("", function)) == f"{{ __proto__: Math, versin: {function} }}"
    assert page_functions(cg.Graph([X], {"y": cg.sin(X)}), versin("sin({0})")) == "Math"


@each_row(
    ("make", "kind", "said"),
    [
        (lambda: cg.to_wasm(X), TypeError, "to_wasm needs a cg.Graph, got Node"),
        (lambda: cg.to_wasm(STATE, [TABLEAUS["rk4"]]), TypeError, "methods"),
        (lambda: cg.to_wasm(STATE, {"rk4": 4}), TypeError, "method 'rk4' must be a tableau"),
        (lambda: cg.to_wasm(STATE, {"memory": TABLEAUS["rk4"]}), ValueError, "must not be called memory"),
        (lambda: cg.to_wasm(cg.Graph([X], {"a": X, "b": X}), TABLEAUS), cg.GraphError, "2 outputs of 1 input"),
        (lambda: cg.to_wasm(STATE, host=3), TypeError, "host"),
        (lambda: cg.to_wasm(STATE, host=("sine",)), ValueError, "no function sine"),
        (
            lambda: cg.to_wasm(versin("{0} % 2.0")),
            ValueError,
            "'versin' has no WebAssembly: its column .* got _0 % 2.0",
        ),
        (lambda: cg.to_wasm(versin("1 - math.cos({0})")), ValueError, "'versin' has no WebAssembly"),
        (lambda: cg.wasm_script(versin("")), ValueError, "'versin' calls versin, which no page has"),
        (lambda: cg.to_wasm(STATE, time=3), TypeError, "time must be the name of an input, got 3"),
    ],
)
def test_a_mistake_is_told_in_one_sentence(make, kind, said):
    with pytest.raises(kind, match=said) as caught:
        make()
    assert "\n" not in str(caught.value)
