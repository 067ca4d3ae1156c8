"""The operation table: one row for each operation, read by evaluation, AD, bounds, code generation, pages and tests."""

from __future__ import annotations

import math
import operator

import numpy as np

from ..core.node import Node, constant
from . import bounds, folding, series, texts, values
from .operation import FUNCTION, OPS as OPS, PRODUCT, RELATION, SUM, Function, MathML, Op, enter, function  # noqa: PLC0414
from .values import ieee


# Conventions where there is no derivative: abs, minimum and maximum have the slope of one branch, for an average does not
# compose (abs(x)**2 has the second slope 2), and that of one side all over a graph, see `_above`: abs'(0) = 1;
# sqrt'(0) = cbrt'(0) = +inf, their limit; hypot'(0, 0) = 0; d(x**y)/dy at x = y = 0 is 0; atan2 at the origin is NaN;
# floor, ceil, round and fmod have where they jump the slope that they have beside it.
def _pow_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    jump = equal(a, 0.0) * equal(b, 0.0)  # 0**b falls from 1 to 0 at b = 0
    power = y - jump
    return zero_safe_mul(b, a ** (b - 1.0)), where(power, power * log(a), power)


def _pow_quotient(y: Node, a: Node, b: Node) -> tuple[Node | float, tuple[Node | float, ...]] | None:
    power = b.value
    if power is None or not math.isfinite(power) or 0.0 < power < 1.0:
        return None
    return (a, (b * y, 0.0)) if power < 0.0 else (1.0, (zero_safe_mul(b, a ** (b - 1.0)), 0.0))


def _atan2_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    h = hypot(a, b)  # dividing twice by h neither overflows nor underflows where b / (a*a + b*b) would
    return b / h / h, -(a / h / h)


def _hypot_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    length = y + where(y, 0.0, _SMALLEST_NORMAL)
    unit = where(y, 1.0, 8.0)  # second slopes at the origin are infinite
    return a * unit / length, b * unit / length


def _tanh_partials(y: Node, a: Node) -> tuple[Node]:
    sech = 1.0 / cosh(a)  # 0 where cosh(a) is infinite, and then so are its derivatives, which would be 0 * inf
    return (zero_safe_mul(sech, sech),)


def _above(a: Node, b: Node) -> Node:
    """Whether a > b; where they are equal, whether it is so with large numbers for what they are made of.

    What was made later has the larger number. So all kinks see one side: those of x - y and y - x, of 2 x and x / -3.
    """
    parts, values = [a, b], dict[Node, float]()
    for node in parts:  # which grow in number
        parts += node.args if node.op.name in _WRITTEN_OUT and len(parts) < _MOST_PARTS else ()
    for node in sorted({*parts}, key=lambda x: (bool(x.args), x.serial)):  # variables first: copies are made after them
        if node.op.name in _WRITTEN_OUT and values.keys() >= {*node.args}:
            values[node] = node.op.scalar(*[values[arg] for arg in node.args])
        else:
            values[node] = 1e15 * 1e3 ** len(values) if node.value is None else node.value
    return less_equal(b, a) if values[a] > values[b] else less(b, a)


def _flat(y: Node, *args: Node) -> tuple[float, ...]:
    return (0.0,) * len(args)


_LEAST_EXPONENT = 800.0  # exp(-800) is 0; no larger square, whose slope could be infinite


def _bell(a: Node) -> Node:
    """2 / sqrt(pi) exp(-a**2), with a factor that is exact in numbers of any precision."""
    return 2.0 / sqrt(acos(-1.0)) * exp(-minimum(a * a, _LEAST_EXPONENT))


def _whole(a: Node) -> Node | None:
    return a if a.op.name in ("floor", "ceil", "round") else None


def _relation(symbol: str) -> MathML:
    return MathML(f"{{0}}<mo>{symbol}</mo>{{1}}", (SUM, SUM), RELATION)


_REAL = (-8.0, 8.0)
_POSITIVE = (0.4, 2.5)
_UNIT = (-0.8, 0.8)
_INF = math.inf
_SMALLEST_NORMAL = 2.0**-1022  # what is smaller counts as 0 in some processes
_WRITTEN_OUT, _MOST_PARTS = ("add", "sub", "neg", "mul", "div", "abs", "minimum", "maximum"), 32


# By place: name, arity, value on floats, value on arrays, partials of (output y, arguments), samples. The rest by name.
# A table is read by columns, so the formatter leaves it alone. In a function, for it names those that are made of it below.
# fmt: off
def _rows() -> tuple[Op, ...]:
    return (
    Op("add", 2, operator.add, np.add, lambda y, a, b: (1.0, 1.0), ((0.3, -0.7),), about="The sum a + b.",
       symbol="+", infix=("+", SUM), mathml=MathML("{0}<mo>+</mo>{1}", (SUM, PRODUCT), SUM), commutative=True, signs=(1, 1),
       fold=folding.add, operator=operator.add, domain=(_REAL, _REAL),
       interval=bounds.add, rounding=1.0,
       python="{} + {}", numpy="{} + {}", llvm=texts.llvm_arithmetic("fadd"), c="{0} + {1}", javascript="(a, b) => a + b"),
    Op("sub", 2, operator.sub, np.subtract, lambda y, a, b: (1.0, -1.0), ((0.3, -0.7),), about="The difference a - b.",
       symbol="−", infix=("-", SUM), mathml=MathML("{0}<mo>−</mo>{1}", (SUM, PRODUCT), SUM), signs=(1, -1),
       fold=folding.sub, operator=operator.sub, domain=(_REAL, _REAL),
       interval=bounds.sub, interval_of_same=bounds.always(0.0), rounding=1.0,
       python="{} - {}", numpy="{} - {}", llvm=texts.llvm_arithmetic("fsub"), c="{0} - {1}", javascript="(a, b) => a - b"),
    Op("mul", 2, operator.mul, np.multiply, lambda y, a, b: (b, a), ((0.3, -0.7), (0.0, 2.0)), about="The product a * b.",
       symbol="×", infix=("*", PRODUCT), mathml=MathML("{0}<mo>·</mo>{1}", (PRODUCT, PRODUCT), PRODUCT), commutative=True,
       fold=folding.mul, series=series.mul, operator=operator.mul, domain=(_REAL, _REAL),
       interval=bounds.mul, interval_of_same=bounds.square, rounding=1.0,
       python="{} * {}", numpy="{} * {}", llvm=texts.llvm_arithmetic("fmul"), c="{0} * {1}", javascript="(a, b) => a * b"),
    # A product in which an exact zero wins over infinity and NaN: what the chain rule needs behind a branch not taken.
    Op("zero_safe_mul", 2, lambda a, b: a * b if a and b else 0.0, lambda a, b: np.where((a == 0) | (b == 0), 0.0, np.multiply(a, b)),
       lambda y, a, b: (b, a), ((0.3, -0.7), (2.0, 1.5)), about="The product a * b, and 0 where a or b is 0, even if the other is infinite or NaN.",
       symbol="⊗", infix=("*", PRODUCT), mathml=MathML("{0}<mo>·</mo>{1}", (PRODUCT, PRODUCT), PRODUCT),
       commutative=True, selects=True, fold=folding.zero_safe_mul,
       series=series.zero_safe_mul, precise=lambda a, b: a if a == 0 else b if b == 0 else a * b, domain=(_REAL, _REAL),
       interval=bounds.mul, interval_of_same=bounds.square, rounding=1.0,
       python="({0} * {1} if {0} and {1} else 0.0)", numpy="np.where(({0} == 0) | ({1} == 0), 0.0, {0} * {1})",
       llvm=texts.LLVM_ZERO_SAFE_MUL, c="({0} != 0.0 && {1} != 0.0) ? {0} * {1} : 0.0",
       javascript="(a, b) => (a !== 0 && b !== 0 ? a * b : 0)"),
    Op("div", 2, ieee(operator.truediv, np.divide), np.divide, lambda y, a, b: (1.0 / b, -(y / b)), ((0.3, -0.7),),
       about="The quotient a / b.", symbol="÷", infix=("/", PRODUCT), mathml=MathML("<mfrac>{0}{1}</mfrac>", (0, 0), PRODUCT),
       fold=folding.div, series=series.div, operator=operator.truediv, domain=(_REAL, _POSITIVE),
       interval=bounds.div, singular=bounds.divisor, quotient=lambda y, a, b: (b, (1.0, -y)), rounding=1.0,
       python="{} / {}", numpy="np.divide({}, {})", llvm=texts.llvm_arithmetic("fdiv"), c="{0} / {1}", javascript="(a, b) => a / b"),
    Op("neg", 1, operator.neg, np.negative, lambda y, a: (-1.0,), ((0.3,),), about="-x.",
       symbol="−", mathml=MathML("<mo>−</mo>{0}", (PRODUCT,), SUM), signs=(-1,), fold=folding.neg,
       operator=operator.neg, domain=(_REAL,), interval=bounds.neg, rounding=0.0,
       python="-{}", numpy="-{}", llvm=("{r} = fneg {t} {0}",), c="-{0}", javascript="(a) => -a"),
    Op("pow", 2, math.pow, values.power_arrays, _pow_partials, ((0.6, -0.7), (1.7, 2.5)), arguments="base exponent", ufunc=np.power,
       about="base ** exponent.", symbol="xʸ", mathml=MathML("<msup><mrow>{0}</mrow>{1}</msup>", (FUNCTION, 0), PRODUCT),
       fold=folding.pow, series=series.pow, operator=operator.pow, domain=(_POSITIVE, (-3.0, 3.0)),
       interval=bounds.pow, singular=bounds.power, quotient=_pow_quotient, c="{name}_pow({0}, {1})", c_helper=texts.C_POWER,
       # as in C: 1 to any power and anything to the power 0 are 1, NaN or not
       javascript="(a, b) => (a === 1 || b === 0 || (a === -1 && (b === Infinity || b === -Infinity)) ? 1 : a ** b)"),
    Op("sqrt", 1, math.sqrt, np.sqrt, lambda y, a: (0.5 / y,), ((0.6,),), about="The square root of x >= 0.",
       symbol="√", mathml=MathML("<msqrt>{0}</msqrt>", (0,), FUNCTION), series=series.sqrt, domain=(_POSITIVE,),
       interval=bounds.rising("sqrt", (0.0, _INF)), singular=bounds.below(0.0, "the slope is infinite"),
       rounding=1.0, llvm=texts.llvm_intrinsic("sqrt")),
    Op("exp", 1, math.exp, np.exp, lambda y, a: (y,), ((0.3,),), about="e to the power x.", domain=((-2.0, 2.0),),
       interval=bounds.rising("exp"), vector="exp"),
    Op("expm1", 1, math.expm1, np.expm1, lambda y, a: (exp(a),), ((0.3,),), about="exp(x) - 1, exact for small x too.",
       domain=((-2.0, 2.0),), interval=bounds.rising("expm1")),
    Op("log", 1, math.log, np.log, lambda y, a: (1.0 / a,), ((0.6,),), about="The natural logarithm of x > 0.",
       domain=(_POSITIVE,), interval=bounds.rising("log", (0.0, _INF)),
       singular=bounds.below(0.0, "value and slope are infinite"), quotient=lambda y, a: (a, (1.0,)), vector="log"),
    Op("log1p", 1, math.log1p, np.log1p, lambda y, a: (1.0 / (1.0 + a),), ((0.3,),), domain=(_UNIT,),
       about="log(1 + x) for x > -1, exact for small x too.", interval=bounds.rising("log1p", (-1.0, _INF)),
       singular=bounds.below(-1.0, "value and slope are infinite"), quotient=lambda y, a: (1.0 + a, (1.0,))),
    Op("sin", 1, math.sin, np.sin, lambda y, a: (cos(a),), ((0.3,), (-2.0,)), about="The sine of x, in radians.",
       domain=(_REAL,), interval=bounds.wave("sin", "cos", 1.0), vector="angle",
       fold=lambda a: -sin(a.args[0]) if a.op.name == "neg" else None),
    Op("cos", 1, math.cos, np.cos, lambda y, a: (-sin(a),), ((0.3,), (-2.0,)), about="The cosine of x, in radians.",
       domain=(_REAL,), interval=bounds.wave("cos", "sin", -1.0), vector="angle",
       fold=lambda a: cos(a.args[0]) if a.op.name == "neg" else None),
    Op("log2", 1, math.log2, np.log2, lambda y, a: (1.0 / log(2.0) / a,), ((0.6,),), about="The logarithm of x > 0 to the base 2.",
       symbol="log₂", mathml=MathML(texts.MATHML_LOGARITHM.format(2), (0,), FUNCTION), domain=(_POSITIVE,),
       interval=bounds.rising("log2", (0.0, _INF)), singular=bounds.below(0.0, "value and slope are infinite"),
       precise=lambda a: a.context.log(a, 2)),
    Op("log10", 1, math.log10, np.log10, lambda y, a: (1.0 / log(10.0) / a,), ((0.6,),), domain=(_POSITIVE,),
       about="The logarithm of x > 0 to the base 10.", symbol="log₁₀", mathml=MathML(texts.MATHML_LOGARITHM.format(10), (0,), FUNCTION),
       interval=bounds.rising("log10", (0.0, _INF)), singular=bounds.below(0.0, "value and slope are infinite")),
    Op("exp2", 1, math.exp2, np.exp2, lambda y, a: (y * log(2.0),), ((0.3,),), about="2 to the power x.", symbol="2ˣ",
       mathml=MathML("<msup><mn>2</mn>{0}</msup>", (0,), FUNCTION), domain=(_REAL,),
       interval=bounds.rising("exp2"), precise=lambda a: 2**a, javascript="(a) => 2 ** a"),
    Op("cbrt", 1, math.cbrt, np.cbrt, lambda y, a: (1.0 / (3.0 * y * y),), ((0.6,), (-2.0,)), about="The real cube root of x.",
       symbol="∛", mathml=MathML("<mroot><mrow>{0}</mrow><mn>3</mn></mroot>", (0,), FUNCTION), domain=(_POSITIVE,),
       fold=lambda a: -cbrt(a.args[0]) if a.op.name == "neg" else None, interval=bounds.rising("cbrt"),
       singular=lambda a: "the slope is infinite at 0" if a[0] <= 0.0 <= a[1] else None, precise=values.precise_cbrt),
    Op("logistic", 1, values.logistic, values.logistic_arrays, lambda y, a: (y * logistic(-a),), ((0.3,), (-1.2,)),
       about="The logistic function 1 / (1 + exp(-x)), without overflow on the way.", ufunc="expit", domain=(_REAL,),
       interval=bounds.rising("logistic"), rounding=4.0,
       precise=lambda a: 1 / (1 + a.context.exp(-a)),
       library="exp", llvm=texts.LLVM_LOGISTIC, c="{name}_logistic({0})", c_helper=texts.C_LOGISTIC,
       javascript="(a) => { const e = Math.exp(-Math.abs(a)); return (a < 0 ? e : 1) / (1 + e); }"),
    Op("erf", 1, math.erf, values.by_element(math.erf), lambda y, a: (_bell(a),), ((0.3,), (-1.2,)), ufunc="erf",
       about="The error function, 2 / sqrt(pi) times the integral of exp(-t**2) from 0 to x.", domain=((-2.5, 2.5),),
       fold=lambda a: -erf(a.args[0]) if a.op.name == "neg" else None, interval=bounds.rising("erf"),
       javascript=texts.JAVASCRIPT_ERF),
    Op("erfc", 1, math.erfc, values.by_element(math.erfc), lambda y, a: (-_bell(a),), ((0.3,), (2.5,)), ufunc="erfc",
       about="1 - erf(x), exact for large x too.", domain=((-2.5, 5.0),),
       interval=bounds.rising("erfc", falling=True), javascript=texts.JAVASCRIPT_ERFC),
    Op("tan", 1, math.tan, np.tan, lambda y, a: (1.0 + y * y,), ((0.3,),), about="The tangent of x, in radians.",
       domain=((-1.2, 1.2),), interval=bounds.tan,
       singular=lambda a: "value and slope are infinite at odd multiples of pi/2" if bounds.tan(a) == bounds.REAL_LINE else None,
       quotient=lambda y, a: (1.0, (1.0 + y * y,))),
    Op("asin", 1, math.asin, np.arcsin, lambda y, a: (1.0 / sqrt((1.0 - a) * (1.0 + a)),), ((0.3,),), domain=(_UNIT,),
       about="The angle between -pi/2 and pi/2 whose sine is x, in radians.",
       interval=bounds.rising("asin", (-1.0, 1.0)), singular=bounds.arc),
    Op("acos", 1, math.acos, np.arccos, lambda y, a: (-1.0 / sqrt((1.0 - a) * (1.0 + a)),), ((0.3,),), domain=(_UNIT,),
       about="The angle between 0 and pi whose cosine is x, in radians.",
       interval=bounds.rising("acos", (-1.0, 1.0), falling=True), singular=bounds.arc),
    Op("atan", 1, math.atan, np.arctan, lambda y, a: (1.0 / hypot(1.0, a) / hypot(1.0, a),), ((0.3,),), domain=(_REAL,),
       about="The angle between -pi/2 and pi/2 whose tangent is x, in radians.", interval=bounds.rising("atan")),
    Op("atan2", 2, math.atan2, np.arctan2, _atan2_partials, ((0.3, -0.7), (-0.4, 0.2)), arguments="y x",
       about="The angle of the point (x, y) from the x axis, between -pi and pi, in radians.", domain=(_REAL, _POSITIVE),
       interval=bounds.atan2, singular=bounds.origin("the slope is unbounded where both arguments are 0")),
    Op("hypot", 2, values.hypot, np.hypot, _hypot_partials, ((0.3, -0.7),),
       arguments="x y", about="The length sqrt(x * x + y * y), without overflow on the way.", commutative=True,
       domain=(_REAL, _POSITIVE), interval=bounds.hypot, singular=bounds.origin("there is no slope where both arguments are 0"),
       series=series.hypot, precise=lambda a, b: (a * a + b * b) ** 0.5),
    Op("sinh", 1, math.sinh, np.sinh, lambda y, a: (cosh(a),), ((0.3,),), about="The hyperbolic sine of x.",
       domain=((-2.0, 2.0),), interval=bounds.rising("sinh")),
    Op("cosh", 1, math.cosh, np.cosh, lambda y, a: (sinh(a),), ((0.3,),), about="The hyperbolic cosine of x.",
       domain=((-2.0, 2.0),), interval=bounds.cosh),
    Op("tanh", 1, math.tanh, np.tanh, _tanh_partials, ((0.3,),),
       about="The hyperbolic tangent of x.", domain=((-2.0, 2.0),), interval=bounds.rising("tanh")),
    Op("abs", 1, abs, np.absolute, lambda y, a: (where(_above(constant(0.0), a), -1.0, 1.0),), ((0.3,), (-0.7,)), about="The size of x, without its sign.",
       symbol="|x|", mathml=MathML("<mo>|</mo>{0}<mo>|</mo>", (0,), FUNCTION), domain=(_REAL,),
       fold=lambda a: abs(a.args[0]) if a.op.name == "neg" else None, piece=lambda side: (0, -1 if side < 0 else 1),
       interval=bounds.magnitude, rounding=0.0, llvm=texts.llvm_intrinsic("fabs"), c="fabs({0})"),
    Op("floor", 1, values.floor, np.floor, _flat, ((0.3,), (-1.7,)), about="The largest whole number that is not above x.",
       symbol="⌊x⌋", mathml=MathML("<mo>⌊</mo>{0}<mo>⌋</mo>", (0,), FUNCTION), fold=_whole,
       jumps=lambda a: a, domain=(_REAL,), interval=bounds.rising("floor"), rounding=0.0,
       llvm=texts.llvm_intrinsic("floor")),
    Op("ceil", 1, values.ceil, np.ceil, _flat, ((0.3,), (-1.7,)), about="The smallest whole number that is not below x.",
       symbol="⌈x⌉", mathml=MathML("<mo>⌈</mo>{0}<mo>⌉</mo>", (0,), FUNCTION), fold=_whole,
       jumps=lambda a: a, domain=(_REAL,), interval=bounds.rising("ceil"), rounding=0.0,
       llvm=texts.llvm_intrinsic("ceil")),
    Op("round", 1, values.round, np.rint, _flat, ((0.3,), (-1.7,)), about="The whole number next to x; of two, the even one.",
       mathml=MathML("<mo>⌊</mo>{0}<mo>⌉</mo>", (0,), FUNCTION), fold=_whole,
       jumps=lambda a: a - 0.5, domain=(_REAL,), interval=bounds.rising("round"), rounding=0.0,
       library="rint", llvm=texts.llvm_intrinsic("rint"), javascript=texts.JAVASCRIPT_ROUND),
    # The slope in b is -trunc(a / b), from what is exact: a / b may round up to a whole number that it is below.
    Op("fmod", 2, math.fmod, np.fmod, lambda y, a, b: (1.0, -round_((a - y) / b)), ((5.3, 2.0), (-5.3, 2.0)),
       about="The remainder of a / b with the sign of a: a - b * trunc(a / b), exactly.", domain=(_REAL, _POSITIVE),
       jumps=lambda a, b: a / b, interval=bounds.fmod, interval_of_same=bounds.always(0.0),
       singular=bounds.divisor, rounding=0.0, javascript="(a, b) => a % b"),
    Op("sign", 1, lambda a: a if a != a else float(a > 0) - float(a < 0), np.sign, _flat, ((0.3,), (-0.7,)), about="-1, 0 or 1: the sign of x.", domain=(_REAL,),
       piece=lambda side: (None, side), interval=bounds.rising("sign"),
       rounding=0.0, llvm=texts.LLVM_SIGN, c="{0} > 0.0 ? 1.0 : ({0} < 0.0 ? -1.0 : ({0} != {0} ? {0} : 0.0))",
       javascript="(a) => (a !== a ? a : (a > 0) - (a < 0))"),
    # Of two zeros the first, where np.minimum and np.maximum take either.
    Op("minimum", 2, lambda a, b: a if a <= b or a != a else b, lambda a, b: np.where((a <= b) | (a != a), a, b),
       lambda y, a, b: ((first := _above(b, a)), where(first, 0.0, 1.0)), ((0.3, -0.7), (-0.7, 0.3)), about="The smaller of a and b.",
       symbol="min", ufunc=np.minimum, commutative=True, selects=True, fold=folding.same,
       piece=lambda side: (int(side > 0), 1), domain=(_REAL, _REAL), interval=bounds.minimum, rounding=0.0,
       llvm=texts.LLVM_MINIMUM, c="({0} <= {1} || {0} != {0}) ? {0} : {1}",
       javascript="(a, b) => (a <= b || a !== a ? a : b)"),
    Op("maximum", 2, lambda a, b: a if a >= b or a != a else b, lambda a, b: np.where((a >= b) | (a != a), a, b),
       lambda y, a, b: ((first := _above(a, b)), where(first, 0.0, 1.0)), ((0.3, -0.7), (-0.7, 0.3)), about="The larger of a and b.",
       symbol="max", ufunc=np.maximum, commutative=True, selects=True, fold=folding.same,
       piece=lambda side: (int(side < 0), 1), domain=(_REAL, _REAL), interval=bounds.maximum, rounding=0.0,
       llvm=texts.LLVM_MAXIMUM, c="({0} >= {1} || {0} != {0}) ? {0} : {1}",
       javascript="(a, b) => (a >= b || a !== a ? a : b)"),
    Op("less", 2, lambda a, b: float(a < b), values.flag(np.less), _flat, ((0.3, -0.7), (-0.7, 0.3)),
       about="1.0 where a < b, else 0.0.", symbol="<", ufunc=np.less, infix=("<", RELATION), mathml=_relation("&lt;"),
       piece=lambda side: (None, int(side < 0)), domain=(_REAL, _REAL),
       interval=bounds.less, interval_of_same=bounds.always(0.0), rounding=0.0,
       python="float({} < {})", numpy="({} < {}) * 1.0", llvm=texts.llvm_comparison("olt"), c="{0} < {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a < b)"),
    Op("less_equal", 2, lambda a, b: float(a <= b), values.flag(np.less_equal), _flat, ((0.3, -0.7), (-0.7, 0.3)),
       about="1.0 where a <= b, else 0.0.", symbol="≤", ufunc=np.less_equal, infix=("<=", RELATION), mathml=_relation("≤"),
       piece=lambda side: (None, int(side <= 0)), domain=(_REAL, _REAL),
       interval=bounds.less_equal, interval_of_same=bounds.always(1.0), rounding=0.0,
       python="float({} <= {})", numpy="({} <= {}) * 1.0", llvm=texts.llvm_comparison("ole"), c="{0} <= {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a <= b)"),
    Op("equal", 2, lambda a, b: float(a == b), values.flag(np.equal), _flat, ((0.3, -0.7),),
       about="1.0 where a and b have the same value, else 0.0.", symbol="=", infix=("==", RELATION), mathml=_relation("="),
       commutative=True, piece=lambda side: (None, int(side == 0)), domain=(_REAL, _REAL),
       interval=bounds.equal, interval_of_same=bounds.always(1.0), rounding=0.0,
       python="float({} == {})", numpy="({} == {}) * 1.0", llvm=texts.llvm_comparison("oeq"), c="{0} == {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a === b)"),
    Op("not_equal", 2, lambda a, b: float(a != b), values.flag(np.not_equal), _flat, ((0.3, -0.7),),
       about="1.0 where a and b differ, else 0.0.", symbol="≠", infix=("!=", RELATION), mathml=_relation("≠"),
       commutative=True, piece=lambda side: (None, int(side != 0)),
       domain=(_REAL, _REAL), interval=bounds.not_equal, interval_of_same=bounds.always(0.0), rounding=0.0,
       python="float({} != {})", numpy="({} != {}) * 1.0", llvm=texts.llvm_comparison("une"), c="{0} != {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a !== b)"),
    Op("where", 3, lambda c, a, b: a if c != 0 else b, lambda c, a, b: np.where(c != 0, a, b),
       lambda y, c, a, b: (0.0, where(c, 1.0, 0.0), where(c, 0.0, 1.0)), ((1.0, 0.3, -0.7), (0.0, 0.3, -0.7)),
       arguments="condition if_true if_false", about="if_true where the condition is not 0, else if_false.",
       selects=True, fold=folding.where, piece=lambda side: (1 if side else 2, 1),
       domain=((0.0, 1.0), _REAL, _REAL), interval=bounds.where, rounding=0.0,
       python="({1} if {0} else {2})", numpy="np.where({0} != 0, {1}, {2})", llvm=texts.LLVM_WHERE,
       c="{0} != 0.0 ? {1} : {2}", javascript="(c, a, b) => (c !== 0 ? a : b)"),
)
# fmt: on

ROWS = _rows()
for _row in ROWS:
    enter(_row)
FLAT = {row.name for row in ROWS if row.partials is _flat}


def _functions(names: str) -> list[Function]:
    """The functions of these rows."""
    return [function(OPS[name]) for name in names.split()]


sqrt, cbrt, pow, hypot, zero_safe_mul = _functions("sqrt cbrt pow hypot zero_safe_mul")
exp, exp2, expm1, log, log2, log10, log1p = _functions("exp exp2 expm1 log log2 log10 log1p")
sin, cos, tan, asin, acos, atan, atan2 = _functions("sin cos tan asin acos atan atan2")
sinh, cosh, tanh, logistic, erf, erfc = _functions("sinh cosh tanh logistic erf erfc")
abs_, sign, floor, ceil, round_, fmod = _functions("abs sign floor ceil round fmod")
minimum, maximum, where = _functions("minimum maximum where")
less, less_equal, equal, not_equal = _functions("less less_equal equal not_equal")
