"""The operation table: one row for each operation, read by evaluation, AD, bounds, code generation, pages and tests."""

from __future__ import annotations

import math
import operator

import numpy as np

from . import (
    op_double_double as dd,
    op_folding as folding,
    op_intervals as bounds,
    op_series as series,
    op_texts as texts,
    op_values as values,
)
from .function_factory import Function, function
from .node import (
    OPS as OPS,  # noqa: PLC0414 (who needs the table imports it from here, filled)
    Node,
)
from .op_values import ieee
from .operation import FUNCTION, LEAF, PRODUCT, RELATION, SUM, MathML, Op, register


# Conventions where there is no derivative: abs'(0) = 0; a tie of minimum or maximum gives one half to each argument;
# sqrt'(0) = +inf, its limit; hypot'(0, 0) = 0; d(x**y)/dy at x = y = 0 is 0; atan2 at the origin is NaN.
def _pow_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    jump = equal(a, 0.0) * equal(b, 0.0)  # 0**b falls from 1 to 0 at b = 0
    power = y - jump
    return zero_safe_mul(b, a ** (b - 1.0)), where(power, power * log(a), power)


def _atan2_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    h = hypot(a, b)  # dividing twice by h neither overflows nor underflows where b / (a*a + b*b) would
    return b / h / h, -(a / h / h)


def _hypot_partials(y: Node, a: Node, b: Node) -> tuple[Node, Node]:
    length = y + _LEAST  # what it is, but for 0, and for the last bit of a subnormal number
    return a / length, b / length


def _tanh_partials(y: Node, a: Node) -> tuple[Node]:
    sech = 1.0 / cosh(a)  # 0 where cosh(a) is infinite, and then so are its derivatives, which would be 0 * inf
    return (zero_safe_mul(sech, sech),)


def _less_partials(y: Node, a: Node, b: Node, above: Node, below: Node) -> tuple[Node, Node]:
    return where(above, 1.0, where(below, 0.0, 0.5)), where(below, 1.0, where(above, 0.0, 0.5))


def _flat(y: Node, *args: Node) -> tuple[float, ...]:
    return (0.0,) * len(args)


def _relation(symbol: str) -> MathML:
    return MathML(f"{{0}}<mo>{symbol}</mo>{{1}}", (SUM, SUM), RELATION)


_REAL = (-8.0, 8.0)
_POSITIVE = (0.4, 2.5)
_UNIT = (-0.8, 0.8)
_INF = math.inf
_LEAST = math.ulp(0.0)

# By place: name, arity, value on floats, value on arrays, partials of (output y, arguments), samples. The rest by name.
# A table is read by columns, so the formatter leaves it alone.
# fmt: off
_ROWS = (
    Op("add", 2, operator.add, np.add, lambda y, a, b: (1.0, 1.0), ((0.3, -0.7),), about="The sum a + b.",
       symbol="+", infix=("+", SUM), mathml=MathML("{0}<mo>+</mo>{1}", (SUM, PRODUCT), SUM), commutative=True, signs=(1, 1),
       fold=folding.add, double_double=dd.add, series=series.add, operator=operator.add, domain=(_REAL, _REAL),
       interval=bounds.add, interval_of_same=lambda a: bounds.mul((2.0, 2.0), a), rounding=1.0,
       python="{} + {}", numpy="{} + {}", llvm=texts.llvm_arithmetic("fadd"), c="{0} + {1}", javascript="(a, b) => a + b"),
    Op("sub", 2, operator.sub, np.subtract, lambda y, a, b: (1.0, -1.0), ((0.3, -0.7),), about="The difference a - b.",
       symbol="−", infix=("-", SUM), mathml=MathML("{0}<mo>−</mo>{1}", (SUM, PRODUCT), SUM), signs=(1, -1),
       fold=folding.sub, double_double=dd.sub, series=series.sub, operator=operator.sub, domain=(_REAL, _REAL),
       interval=bounds.sub, interval_of_same=bounds.always(0.0), rounding=1.0,
       python="{} - {}", numpy="{} - {}", llvm=texts.llvm_arithmetic("fsub"), c="{0} - {1}", javascript="(a, b) => a - b"),
    Op("mul", 2, operator.mul, np.multiply, lambda y, a, b: (b, a), ((0.3, -0.7), (0.0, 2.0)), about="The product a * b.",
       symbol="×", infix=("*", PRODUCT), mathml=MathML("{0}<mo>·</mo>{1}", (PRODUCT, PRODUCT), PRODUCT), commutative=True,
       fold=folding.mul, double_double=dd.mul, series=series.mul, operator=operator.mul, domain=(_REAL, _REAL),
       interval=bounds.mul, interval_of_same=bounds.square, rounding=1.0,
       python="{} * {}", numpy="{} * {}", llvm=texts.llvm_arithmetic("fmul"), c="{0} * {1}", javascript="(a, b) => a * b"),
    # A product in which an exact zero wins over infinity and NaN: what the chain rule needs behind a branch not taken.
    Op("zero_safe_mul", 2, lambda a, b: a * b if a and b else 0.0, values.zero_safe_mul_arrays, lambda y, a, b: (b, a),
       ((0.3, -0.7), (2.0, 1.5)), about="The product a * b, and 0 where a or b is 0, even if the other is infinite or NaN.",
       symbol="⊗", infix=("*", PRODUCT), mathml=MathML("{0}<mo>·</mo>{1}", (PRODUCT, PRODUCT), PRODUCT),
       commutative=True, selects=True, fold=folding.zero_safe_mul, double_double=dd.zero_safe_mul,
       series=series.zero_safe_mul, precise=lambda a, b: a if a == 0 else b if b == 0 else a * b, domain=(_REAL, _REAL),
       interval=bounds.mul, interval_of_same=bounds.square, rounding=1.0,
       python="({0} * {1} if {0} and {1} else 0.0)", numpy="np.where(({0} == 0) | ({1} == 0), 0.0, {0} * {1})",
       llvm=texts.LLVM_ZERO_SAFE_MUL, c="({0} != 0.0 && {1} != 0.0) ? {0} * {1} : 0.0",
       javascript="(a, b) => (a !== 0 && b !== 0 ? a * b : 0)"),
    Op("div", 2, ieee(operator.truediv, np.divide), np.divide, lambda y, a, b: (1.0 / b, -(y / b)), ((0.3, -0.7),),
       about="The quotient a / b.", symbol="÷", infix=("/", PRODUCT), mathml=MathML("<mfrac>{0}{1}</mfrac>", (0, 0), PRODUCT),
       fold=folding.div, double_double=dd.div, series=series.div, operator=operator.truediv, domain=(_REAL, _POSITIVE),
       interval=bounds.div, singular=bounds.divisor, rounding=1.0,
       python="{} / {}", numpy="{} / {}", llvm=texts.llvm_arithmetic("fdiv"), c="{0} / {1}", javascript="(a, b) => a / b"),
    Op("neg", 1, operator.neg, np.negative, lambda y, a: (-1.0,), ((0.3,),), about="-x.",
       symbol="−", mathml=MathML("<mo>−</mo>{0}", (PRODUCT,), SUM), signs=(-1,), fold=folding.neg, double_double=dd.neg,
       series=series.neg, operator=operator.neg, domain=(_REAL,), interval=bounds.neg, rounding=0.0,
       python="-{}", numpy="-{}", llvm=("{r} = fneg {t} {0}",), c="-{0}", javascript="(a) => -a"),
    Op("pow", 2, math.pow, values.power_arrays, _pow_partials, ((0.6, -0.7), (1.7, 2.5)), arguments="base exponent", ufunc=np.power,
       about="base ** exponent.", symbol="xʸ", mathml=MathML("<msup><mrow>{0}</mrow>{1}</msup>", (LEAF, 0), PRODUCT),
       fold=folding.pow, double_double=dd.pow, rewrite=series.power, operator=operator.pow, domain=(_POSITIVE, (-3.0, 3.0)),
       interval=bounds.pow, singular=bounds.power, c="{name}_pow({0}, {1})", c_helper=texts.C_POWER,
       # as in C: 1 to any power and anything to the power 0 are 1, NaN or not
       javascript="(a, b) => (a === 1 || b === 0 || (a === -1 && (b === Infinity || b === -Infinity)) ? 1 : a ** b)"),
    Op("sqrt", 1, math.sqrt, np.sqrt, lambda y, a: (0.5 / y,), ((0.6,),), about="The square root of x >= 0.",
       symbol="√", mathml=MathML("<msqrt>{0}</msqrt>", (0,), FUNCTION), double_double=dd.sqrt, domain=(_POSITIVE,),
       interval=bounds.rising("sqrt", (0.0, _INF), (0.0, _INF), ulps=1), singular=bounds.below(0.0, "the slope is infinite"),
       rounding=1.0, llvm=texts.llvm_intrinsic("sqrt")),
    Op("exp", 1, math.exp, np.exp, lambda y, a: (y,), ((0.3,),), about="e to the power x.", domain=((-2.0, 2.0),),
       interval=bounds.rising("exp", bounds=(0.0, _INF)), vector="exp"),
    Op("expm1", 1, math.expm1, np.expm1, lambda y, a: (exp(a),), ((0.3,),), about="exp(x) - 1, exact for small x too.",
       domain=((-2.0, 2.0),), interval=bounds.rising("expm1", bounds=(-1.0, _INF))),
    Op("log", 1, math.log, np.log, lambda y, a: (1.0 / a,), ((0.6,),), about="The natural logarithm of x > 0.",
       domain=(_POSITIVE,), interval=bounds.rising("log", (0.0, _INF)),
       singular=bounds.below(0.0, "value and slope are infinite"), vector="log"),
    Op("log1p", 1, math.log1p, np.log1p, lambda y, a: (1.0 / (1.0 + a),), ((0.3,),), domain=(_UNIT,),
       about="log(1 + x) for x > -1, exact for small x too.", interval=bounds.rising("log1p", (-1.0, _INF)),
       singular=bounds.below(-1.0, "value and slope are infinite")),
    Op("sin", 1, math.sin, np.sin, lambda y, a: (cos(a),), ((0.3,), (-2.0,)), about="The sine of x, in radians.",
       domain=(_REAL,), interval=bounds.wave("sin", math.pi / 2), vector="angle",
       fold=lambda a: -sin(a.args[0]) if a.op.name == "neg" else None),
    Op("cos", 1, math.cos, np.cos, lambda y, a: (-sin(a),), ((0.3,), (-2.0,)), about="The cosine of x, in radians.",
       domain=(_REAL,), interval=bounds.wave("cos", 0.0), vector="angle",
       fold=lambda a: cos(a.args[0]) if a.op.name == "neg" else None),
    Op("tan", 1, math.tan, np.tan, lambda y, a: (1.0 + y * y,), ((0.3,),), about="The tangent of x, in radians.",
       domain=((-1.2, 1.2),), interval=bounds.tan, singular=bounds.no_tangent),
    Op("asin", 1, math.asin, np.arcsin, lambda y, a: (1.0 / sqrt((1.0 - a) * (1.0 + a)),), ((0.3,),), domain=(_UNIT,),
       about="The angle between -pi/2 and pi/2 whose sine is x, in radians.",
       interval=bounds.rising("asin", (-1.0, 1.0)), singular=bounds.arc),
    Op("acos", 1, math.acos, np.arccos, lambda y, a: (-1.0 / sqrt((1.0 - a) * (1.0 + a)),), ((0.3,),), domain=(_UNIT,),
       about="The angle between 0 and pi whose cosine is x, in radians.",
       interval=bounds.rising("acos", (-1.0, 1.0), (0.0, _INF), falling=True), singular=bounds.arc),
    Op("atan", 1, math.atan, np.arctan, lambda y, a: (1.0 / hypot(1.0, a) / hypot(1.0, a),), ((0.3,),), domain=(_REAL,),
       about="The angle between -pi/2 and pi/2 whose tangent is x, in radians.", interval=bounds.rising("atan")),
    Op("atan2", 2, math.atan2, np.arctan2, _atan2_partials, ((0.3, -0.7), (-0.4, 0.2)), arguments="y x",
       about="The angle of the point (x, y) from the x axis, between -pi and pi, in radians.", domain=(_REAL, _POSITIVE),
       interval=bounds.atan2, singular=bounds.origin("the slope is unbounded where both arguments are 0")),
    Op("hypot", 2, values.hypot, np.hypot, _hypot_partials, ((0.3, -0.7),),
       arguments="x y", about="The length sqrt(x * x + y * y), without overflow on the way.", commutative=True,
       domain=(_REAL, _POSITIVE), interval=bounds.hypot, singular=bounds.origin("there is no slope where both arguments are 0"),
       precise=lambda a, b: (a * a + b * b) ** 0.5),
    Op("sinh", 1, math.sinh, np.sinh, lambda y, a: (cosh(a),), ((0.3,),), about="The hyperbolic sine of x.",
       domain=((-2.0, 2.0),), interval=bounds.rising("sinh")),
    Op("cosh", 1, math.cosh, np.cosh, lambda y, a: (sinh(a),), ((0.3,),), about="The hyperbolic cosine of x.",
       domain=((-2.0, 2.0),), interval=bounds.cosh),
    Op("tanh", 1, math.tanh, np.tanh, _tanh_partials, ((0.3,),),
       about="The hyperbolic tangent of x.", domain=((-2.0, 2.0),), interval=bounds.rising("tanh", bounds=(-1.0, 1.0))),
    Op("abs", 1, abs, np.absolute, lambda y, a: (sign(a),), ((0.3,), (-0.7,)), about="The size of x, without its sign.",
       symbol="|x|", mathml=MathML("<mo>|</mo>{0}<mo>|</mo>", (0,), FUNCTION), domain=(_REAL,), double_double=dd.size,
       fold=lambda a: abs(a.args[0]) if a.op.name == "neg" else None, piece=lambda side: (0, -1 if side < 0 else 1),
       interval=bounds.magnitude, rounding=0.0, llvm=texts.llvm_intrinsic("fabs"), c="fabs({0})"),
    Op("sign", 1, values.sign, np.sign, _flat, ((0.3,), (-0.7,)), about="-1, 0 or 1: the sign of x.", domain=(_REAL,),
       double_double=dd.sign, piece=lambda side: (None, side), interval=bounds.rising("sign", bounds=(-1.0, 1.0), ulps=0),
       rounding=0.0, llvm=texts.LLVM_SIGN, c="{0} > 0.0 ? 1.0 : ({0} < 0.0 ? -1.0 : ({0} != {0} ? {0} : 0.0))",
       javascript="(a) => (a !== a ? a : (a > 0) - (a < 0))"),
    Op("minimum", 2, lambda a, b: a if a <= b or a != a else b, np.minimum,
       lambda y, a, b: _less_partials(y, a, b, a < b, b < a), ((0.3, -0.7), (-0.7, 0.3)), about="The smaller of a and b.",
       symbol="min", commutative=True, selects=True, fold=folding.same, double_double=dd.extreme("minimum"),
       piece=lambda side: (int(side > 0), 1), domain=(_REAL, _REAL), interval=bounds.minimum, rounding=0.0,
       llvm=texts.LLVM_MINIMUM, c="({0} <= {1} || {0} != {0}) ? {0} : {1}",
       javascript="(a, b) => (a <= b || a !== a ? a : b)"),
    Op("maximum", 2, lambda a, b: a if a >= b or a != a else b, np.maximum,
       lambda y, a, b: _less_partials(y, a, b, b < a, a < b), ((0.3, -0.7), (-0.7, 0.3)), about="The larger of a and b.",
       symbol="max", commutative=True, selects=True, fold=folding.same, double_double=dd.extreme("maximum"),
       piece=lambda side: (int(side < 0), 1), domain=(_REAL, _REAL), interval=bounds.maximum, rounding=0.0,
       llvm=texts.LLVM_MAXIMUM, c="({0} >= {1} || {0} != {0}) ? {0} : {1}",
       javascript="(a, b) => (a >= b || a !== a ? a : b)"),
    Op("less", 2, lambda a, b: float(a < b), values.flag(np.less), _flat, ((0.3, -0.7), (-0.7, 0.3)),
       about="1.0 where a < b, else 0.0.", symbol="<", ufunc=np.less, infix=("<", RELATION), mathml=_relation("&lt;"),
       double_double=dd.compared("less"), piece=lambda side: (None, int(side < 0)), domain=(_REAL, _REAL),
       interval=bounds.less, interval_of_same=bounds.always(0.0), rounding=0.0,
       python="float({} < {})", numpy="({} < {}) * 1.0", llvm=texts.llvm_comparison("olt"), c="{0} < {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a < b)"),
    Op("less_equal", 2, lambda a, b: float(a <= b), values.flag(np.less_equal), _flat, ((0.3, -0.7), (-0.7, 0.3)),
       about="1.0 where a <= b, else 0.0.", symbol="≤", ufunc=np.less_equal, infix=("<=", RELATION), mathml=_relation("≤"),
       double_double=dd.compared("less_equal"), piece=lambda side: (None, int(side <= 0)), domain=(_REAL, _REAL),
       interval=bounds.less_equal, interval_of_same=bounds.always(1.0), rounding=0.0,
       python="float({} <= {})", numpy="({} <= {}) * 1.0", llvm=texts.llvm_comparison("ole"), c="{0} <= {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a <= b)"),
    Op("equal", 2, lambda a, b: float(a == b), values.flag(np.equal), _flat, ((0.3, -0.7),),
       about="1.0 where a and b have the same value, else 0.0.", symbol="=", infix=("==", RELATION), mathml=_relation("="),
       commutative=True, double_double=dd.compared("equal"), piece=lambda side: (None, int(side == 0)), domain=(_REAL, _REAL),
       interval=bounds.equal, interval_of_same=bounds.always(1.0), rounding=0.0,
       python="float({} == {})", numpy="({} == {}) * 1.0", llvm=texts.llvm_comparison("oeq"), c="{0} == {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a === b)"),
    Op("not_equal", 2, lambda a, b: float(a != b), values.flag(np.not_equal), _flat, ((0.3, -0.7),),
       about="1.0 where a and b differ, else 0.0.", symbol="≠", infix=("!=", RELATION), mathml=_relation("≠"),
       commutative=True, double_double=dd.compared("not_equal"), piece=lambda side: (None, int(side != 0)),
       domain=(_REAL, _REAL), interval=bounds.not_equal, interval_of_same=bounds.always(0.0), rounding=0.0,
       python="float({} != {})", numpy="({} != {}) * 1.0", llvm=texts.llvm_comparison("une"), c="{0} != {1} ? 1.0 : 0.0",
       javascript="(a, b) => +(a !== b)"),
    Op("where", 3, lambda c, a, b: a if c != 0 else b, lambda c, a, b: np.where(c != 0, a, b),
       lambda y, c, a, b: (0.0, where(c, 1.0, 0.0), where(c, 0.0, 1.0)), ((1.0, 0.3, -0.7), (0.0, 0.3, -0.7)),
       arguments="condition if_true if_false", about="if_true where the condition is not 0, else if_false.",
       selects=True, fold=folding.where, double_double=dd.choose, piece=lambda side: (1 if side else 2, 1),
       domain=((0.0, 1.0), _REAL, _REAL), interval=bounds.where, rounding=0.0,
       python="({1} if {0} else {2})", numpy="np.where({0} != 0, {1}, {2})", llvm=texts.LLVM_WHERE,
       c="{0} != 0.0 ? {1} : {2}", javascript="(c, a, b) => (c !== 0 ? a : b)"),
)
# fmt: on

for _row in _ROWS:
    register(_row)

sqrt: Function = function(OPS["sqrt"])
exp: Function = function(OPS["exp"])
expm1: Function = function(OPS["expm1"])
log: Function = function(OPS["log"])
log1p: Function = function(OPS["log1p"])
sin: Function = function(OPS["sin"])
cos: Function = function(OPS["cos"])
tan: Function = function(OPS["tan"])
asin: Function = function(OPS["asin"])
acos: Function = function(OPS["acos"])
atan: Function = function(OPS["atan"])
sinh: Function = function(OPS["sinh"])
cosh: Function = function(OPS["cosh"])
tanh: Function = function(OPS["tanh"])
abs_: Function = function(OPS["abs"])
sign: Function = function(OPS["sign"])
pow: Function = function(OPS["pow"])
atan2: Function = function(OPS["atan2"])
hypot: Function = function(OPS["hypot"])
minimum: Function = function(OPS["minimum"])
maximum: Function = function(OPS["maximum"])
less: Function = function(OPS["less"])
less_equal: Function = function(OPS["less_equal"])
equal: Function = function(OPS["equal"])
not_equal: Function = function(OPS["not_equal"])
where: Function = function(OPS["where"])
zero_safe_mul: Function = function(OPS["zero_safe_mul"])
