"""The functions of WebAssembly modules against mpmath: errors in ulp over all of float64."""

import math
import random

import mpmath

import cgraph as cg
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from tests import high_precision
from tests.each_row import each_row
from tests.strategies import examples
from tests.wasm import instance

# Largest errors [ulp]: those of the C library are 0.5 to 2.4 at the same points.
LARGEST = dict.fromkeys("sin cos exp exp2 log log1p log2 log10 pow cbrt hypot atan".split(), 0.8)
LARGEST |= dict.fromkeys("expm1 cosh atan2 acos".split(), 1.4) | dict.fromkeys(
    "tan asin sinh logistic erf".split(), 2.0
)
LARGEST |= {"tanh": 2.5, "erfc": 6.0, "fmod": 0.0}
DIGITS = 60
MORE = {"sin", "cos", "tan", "fmod", "hypot"}  # need all digits of large arguments


def points(op, count):
    """In the domain, of any size with either sign, and of middle sizes."""
    source = random.Random(op.name)
    kinds = (
        lambda low, high: source.uniform(low, high),
        lambda low, high: source.choice((-1, 1)) * 2.0 ** source.uniform(-20, 20),
        lambda low, high: source.choice((-1, 1)) * 2.0 ** source.uniform(-1074, 1023.9),
        lambda low, high: source.uniform(-750.0, 750.0),
    )
    return [tuple(source.choice(kinds)(*interval) for interval in op.domain) for _ in range(count)]


def hard(op):
    """Close to zeros of sines, close to 1, at the ends of the exponent."""
    if op.name in ("sin", "cos", "tan"):
        multiples = [k * mpmath.pi / 2 for k in (1, 2, 3, 15, 1001, 67108865, 2**52 + 1)]
        return [(float(each),) for each in multiples] + [(6381956970095103 * 2.0**797,), (1.7976931348623157e308,)]
    around = [1.0 + sign * 2.0**-k for k in (1, 10, 30, 52) for sign in (1, -1)] + [709.7, -744.9, 1e-308, -1e-320]
    return [(x,) * op.arity for x in around] + ([(1.0 + 2.0**-30, 7e11), (0.5, 1073.5)] if op.name == "pow" else [])


@each_row("name", sorted(LARGEST))
def test_errors_are_below_what_is_said(name):
    op = OPS[name]
    inputs = cg.variables(["a", "b"][: op.arity])
    call = instance(cg.Graph(inputs, {"y": apply(op, *inputs)}))
    worst = 0.0
    with mpmath.workdps(400 if name in MORE else DIGITS):
        for point in points(op, examples(200)) + hard(op):
            near = float(op.scalar(*point))
            (found,) = call(*point)
            if math.isfinite(near) and near != 0.0:
                exact = high_precision.OPERATIONS[name](*map(mpmath.mpf, point))
                worst = max(worst, float(abs(mpmath.mpf(found) - exact) / math.ulp(near)))
            else:
                assert found == near or (found != found and near != near), point
    assert worst <= LARGEST[name]


def test_every_function_of_the_module_is_measured():
    from cgraph.codegen.wasm.functions import HELPERS, library

    assert {*library(0)} - HELPERS - {"sign", "minimum", "maximum"} == {*LARGEST}


def test_odd_functions_are_odd_and_even_ones_even_to_the_last_bit():
    for name in ("sin", "cos", "tan", "atan", "asin", "sinh", "cosh", "tanh", "cbrt", "erf"):
        x = cg.variable("x")
        call = instance(cg.Graph([x], {"y": apply(OPS[name], x), "z": apply(OPS[name], -x)}))
        for point in (1e-300, 0.3, 0.9):
            y, z = call(point)
            assert z == (y if name in ("cos", "cosh") else -y), name
