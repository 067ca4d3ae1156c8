"""Derivatives at the points where others give NaN: branches not taken, losers, powers at zero, extreme sizes."""

import ctypes
import math
import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mpmath
import pytest
from mpmath import mp, mpf

import cgraph as cg
from tests import high_precision
from tests.each_row import each_row

TOLERANCE = 1e-14  # a few roundings
INF = math.inf


def derivatives(function: Callable[..., cg.Node], *point: float) -> dict[str, list[float]]:
    """First and second derivatives in the first argument, by every way to get there."""
    inputs = cg.variables("x y z")[: len(point)]
    values = dict(zip("xyz", point, strict=False))
    graph = cg.Graph(inputs, {"f": function(*inputs)})

    def at(transformed: cg.Graph, **more: float) -> float:
        return next(iter(transformed.evaluate(values | more).values()))

    jvp, vjp = cg.jvp(graph, "x"), cg.vjp(graph, "x")
    return {
        "first": [at(jvp, x_dot=1.0), at(vjp, f_bar=1.0), at(cg.gradient(graph, "x"))],
        "second": [
            at(cg.jvp(jvp, "x"), x_dot=1.0, x_dot2=1.0),
            at(cg.jvp(vjp, "x"), f_bar=1.0, x_dot=1.0),
            at(cg.vjp(jvp, "x"), x_dot=1.0, f_dot_bar=1.0),
            at(cg.vjp(vjp, "x"), f_bar=1.0, x_bar_bar=1.0),
            at(cg.hessian(graph, "x")),
            at(cg.gradient(cg.gradient(graph, "x"), "x")),
        ],
        "third": [at(cg.jvp(cg.hessian(graph, "x"), "x"), x_dot=1.0), at(cg.gradient(cg.hessian(graph, "x"), "x"))],
    }


def shared_by_branches(x: cg.Node) -> cg.Node:
    s = cg.sin(x)
    return cg.where(x > 0, cg.log(s), s * s)


def shared_with_outside(x: cg.Node) -> cg.Node:
    cube = x * x * x
    return cg.where(x > 0, cg.sqrt(cube), x) + cube * cube


# What is not taken at x: a function with a branch or operand, what is taken, by mpmath's functions, and x.
# fmt: off   (a table is read by columns)
BRANCHES: dict[str, tuple[Callable[[cg.Node], cg.Node], Callable[[mpf], mpf], float]] = {
    "log of a negative number": (lambda x: cg.where(x > 0, cg.log(x), x * x), lambda x: x * x, -1.0),
    "log of zero": (lambda x: cg.where(x > 0, cg.log(x), 3 * x), lambda x: 3 * x, 0.0),
    "sqrt at zero": (lambda x: cg.where(x > 0, cg.sqrt(x), 0 * x), lambda x: 0 * x, 0.0),
    "sinc": (lambda x: cg.where(cg.equal(x, 0), 1.0, cg.sin(x) / x), lambda x: mpf(1), 0.0),
    "infinite operand": (lambda x: cg.where(x < 1, x**3, 1 / (x - x)), lambda x: x**3, 0.5),
    "NaN far below the choice": (
        lambda x: cg.where(x > 0, cg.sin(cg.log(x)) * cg.exp(1 / x) + cg.sqrt(x) ** 3, cg.sin(x)),
        mpmath.sin,
        -0.7,
    ),
    "overflow below the choice": (lambda x: cg.where(x < 10, x * x, cg.exp(cg.exp(x * 1e3))), lambda x: x * x, 3.0),
    "choice within a choice": (
        lambda x: cg.where(x > 0, cg.where(x > 1, cg.log(x - 1), x**3), cg.sqrt(x)),
        lambda x: x**3,
        0.5,
    ),
    "choice within a branch not taken": (
        lambda x: cg.where(x > 0, cg.where(x > -1, cg.log(x), cg.sqrt(x)), cg.cos(x)),
        mpmath.cos,
        -0.5,
    ),
    "choice used further": (
        lambda x: cg.exp(cg.where(x > 0, cg.log(x), 2 * x)) * x,
        lambda x: mpmath.exp(2 * x) * x,
        -1.0,
    ),
    "node shared by both branches": (shared_by_branches, lambda x: mpmath.sin(x) ** 2, -1.0),
    "node shared with the outside": (shared_with_outside, lambda x: x + x**6, -1.0),
    "safe argument chosen first": (
        lambda x: cg.where(x > 0, cg.log(cg.where(x > 0, x, 1.0)), x**2),
        lambda x: x**2,
        -2.0,
    ),
    "minimum with infinity": (lambda x: cg.minimum(x * x, INF), lambda x: x * x, 0.7),
    "maximum with minus infinity": (lambda x: cg.maximum(cg.log(0 * x), x**3), lambda x: x**3, 0.7),
    "loser of minimum has a pole": (lambda x: cg.minimum(x * x, 1 / ((x - 1) * (x - 1))), lambda x: x * x, 1.0),
    "loser of minimum is steep": (lambda x: cg.minimum(x * x - 1, cg.sqrt(x)), lambda x: x * x - 1, 0.0),
    "loser of maximum is steep": (lambda x: cg.maximum(cg.cos(x), cg.sqrt(x)), mpmath.cos, 0.0),
    "loser of maximum overflows": (lambda x: cg.maximum(x**3, -cg.exp(cg.exp(x * 1e3))), lambda x: x**3, 2.0),
    "minimum within a maximum": (
        lambda x: cg.maximum(cg.minimum(x**3, 1 / (x - x)), cg.log(0 * x)),
        lambda x: x**3,
        2.0,
    ),
}
# fmt: on


@each_row("name", BRANCHES)
def test_what_is_not_taken_does_not_reach_a_derivative(name):
    function, taken, x = BRANCHES[name]
    for order, found in enumerate(derivatives(function, x).values(), 1):
        with mp.workdps(50):
            expected = float(mpmath.diff(taken, mpf(x), order))
        assert found == pytest.approx([expected] * len(found), rel=TOLERANCE, abs=TOLERANCE)


# First and second derivatives in the first argument at points where there is a limit, a side or a convention alone.
POWERS = {  # of x**exponent at 0: exponent * 0**(exponent - 1), exponent * (exponent - 1) * 0**(exponent - 2)
    -1: (-INF, INF), 0: (0, 0), 0.5: (INF, -INF), 1: (1, 0), 1.5: (0, INF), 2: (0, 2), 2.5: (0, 0), 3: (0, 0), 4: (0, 0)
}  # fmt: skip
CONVENTIONS = [
    *[(f"x**{n}", lambda x, n=n: x**n, (0.0,), *slopes) for n, slopes in POWERS.items()],
    *[("x**y", lambda x, y: x**y, (0.0, float(n)), *slopes) for n, slopes in POWERS.items()],
    *[("0**y", lambda y, x: x**y, (float(n), 0.0), 0.0, 0.0) for n in (0.5, 1, 2, 3)],  # 0 for every y near
    ("0**0", lambda y, x: x**y, (0.0, 0.0), 0.0, None),
    ("sqrt", cg.sqrt, (0.0,), INF, -INF),
    ("abs", abs, (0.0,), 1.0, 0.0),
    *[("hypot", cg.hypot, (x, 0.0), 0.0, None) for x in (0.0, -0.0)],
    ("hypot", cg.hypot, (3.0, 0.0), 1.0, None),
    ("hypot", cg.hypot, (0.0, 4.0), 0.0, 0.25),  # 1 / y
    ("maximum", cg.maximum, (0.3, 0.3), 0.0, 0.0),  # as if y, which was made later, were larger
    ("maximum", lambda x, y: cg.maximum(y, x), (0.3, 0.3), 0.0, 0.0),
    ("minimum", cg.minimum, (0.3, 0.3), 1.0, 0.0),
    ("maximum", lambda x: cg.maximum(0.3, x), (0.3,), 1.0, 0.0),  # and a constant smaller
    *[(f.__name__, lambda x, f=f: f(x * x, 2 * x - 1), (1.0,), 2.0, None) for f in (cg.minimum, cg.maximum)],
]


@each_row(("name", "function", "point", "first", "second"), CONVENTIONS)
def test_derivatives_at_limits_are_those_of_a_side_or_a_convention(name, function, point, first, second):
    found = derivatives(function, *point)
    assert found["first"] == [first] * 3
    assert second is None or found["second"] == [second] * 6


KINKED = {  # at x = y = 1 a kink for each operand, none in what is made of them: that, written without one
    "even power": (lambda x, y: abs(1 - x) ** 4 + abs(x - 1) ** 2, lambda x, y: (x - 1) ** 4 + (x - 1) ** 2),
    "even function": (lambda x, y: cg.cosh(abs(abs(x - y))), lambda x, y: cg.cosh(x - y)),
    "both signs": (lambda x, y: abs(2 * x - 2 * y) * abs((y - x) / 4), lambda x, y: (x - y) ** 2 / 2),
    "both parts": (lambda x, y: cg.maximum(x, 1) ** 2 + cg.minimum(x, 1) ** 2, lambda x, y: x**2 + 1),
    "stops": (lambda x, y: cg.maximum(x - 1, 0) ** 2 + cg.maximum(1 - x, 0) ** 2, lambda x, y: (x - 1) ** 2),
    "product": (lambda x, y: cg.maximum(x, y) * cg.minimum(y, x), lambda x, y: x * y),
    "sum": (lambda x, y: (cg.maximum(x, y) + cg.minimum(x, y)) ** 2, lambda x, y: (x + y) ** 2),
    "middle": (
        lambda x, y: (
            cg.maximum(cg.maximum(x, y), 1)
            * cg.maximum(cg.minimum(x, y), cg.minimum(cg.maximum(y, x), 1))
            * cg.minimum(1, cg.minimum(x, y))
        ),
        lambda x, y: x * y,
    ),
    "size": (lambda x, y: cg.maximum(x - y, y - x) * abs(x - y), lambda x, y: (x - y) ** 2),
    "half": (lambda x, y: cg.maximum(x, y) * (x + y - abs(y - x)) / 2, lambda x, y: x * y),
    "branches": (lambda x, y: cg.where(x < 1, 1 - x, x - 1) * abs(1 - x), lambda x, y: (x - 1) ** 2),
}


@each_row("name", KINKED)
def test_kinks_that_cancel_leave_the_slopes_of_what_is_smooth(name):
    found, expected = [derivatives(each, 1.0, 1.0) for each in KINKED[name]]
    for order in ("first", "second"):
        assert found[order] == pytest.approx(expected[order], rel=TOLERANCE)


@contextmanager
def flushed_subnormals() -> Iterator[None]:
    """This thread takes subnormal numbers for 0, as the threads of XLA do and whatever loads -ffast-math."""
    llvm = pytest.importorskip("llvmlite.binding")
    instruction = "void @llvm.x86.sse.ldmxcsr(ptr"
    text = f"declare {instruction})\ndefine void @set(ptr %p) {{ call {instruction} %p) ret void }}"
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine)
    load = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_uint32))(engine.get_function_address("set"))
    load(ctypes.c_uint32(0x9FC0))  # the default, 0x1F80, with "flush to zero" and "denormals are zero"
    try:
        yield
    finally:
        load(ctypes.c_uint32(0x1F80))


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the register is one of x86")
@pytest.mark.parametrize("backend", ["auto", "python", "numpy"])
def test_no_slope_rests_on_a_subnormal_number(backend):
    x, y = cg.variables("x y")
    length = cg.hypot(x, y)
    cg.compile(cg.Graph([x], {"y": x}), backend)  # LLVM is there
    with flushed_subnormals():
        assert 5e-324 + x.op.arity == 0.0
        assert derivatives(cg.hypot, 0.0, 0.0)["first"] == [0.0] * 3
        force = cg.compile(cg.Graph([x, y], {"fx": -length * x, "fy": -length * y}), backend)
        assert (force.jacobian([0.0, 0.0]) == 0.0).all()
        assert (force.jacobian([[0.0, 0.0]]) == 0.0).all()
    assert (force.jacobian([0.0, 0.0]) == 0.0).all()


def test_a_length_times_its_slope_is_smooth_at_the_origin():
    """Second slopes of half a square, written in several ways; those of other functions are not finite."""
    x, y = cg.variables("x y")
    h = cg.hypot(x, y)
    for square in (0.5 * h**2, h * h / 2, h**2 * 0.25 + h * h * 0.25, 0.5 * (h * h)):
        found = cg.hessian(cg.Graph([x, y], {"f": square})).evaluate({"x": 0.0, "y": 0.0})
        assert list(found.values()) == [1.0, 0.0, 0.0, 1.0]
    assert not math.isfinite(cg.hessian(cg.Graph([x, y], {"f": cg.cos(h)})).evaluate({"x": 0.0, "y": 0.0})["d2f/dxdx"])


def test_atan2_at_the_origin_has_no_derivative():
    assert all(map(math.isnan, derivatives(cg.atan2, 0.0, 0.0)["first"]))


def test_the_mixed_second_derivative_of_a_power_at_zero_is_finite():
    x, y = cg.variables("x y")
    hessian = cg.hessian(cg.Graph([x, y], {"f": x**y})).evaluate({"x": 0.0, "y": 3.0})
    assert hessian == {"d2f/dxdx": 0.0, "d2f/dxdy": 0.0, "d2f/dydx": 0.0, "d2f/dydy": 0.0}


@each_row("exponent", [2.0, 3.0, -1.0, 5.0])
def test_integer_powers_of_negative_numbers_have_derivatives(exponent):
    for base in (-2.0, -0.5):
        found = derivatives(lambda x: x**exponent, base)
        for order, name in enumerate(("first", "second"), 1):
            expected = float(high_precision.partial(lambda x: x ** int(exponent), [base], [order]))
            assert found[name] == pytest.approx([expected] * len(found[name]), rel=TOLERANCE)
