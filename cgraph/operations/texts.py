"""Texts of operations in LLVM's language and in C that are too long for a row.

LLVM: {r} result, {0} {1} {2} arguments, {t} type, {b} type of a comparison, {f} flags, {s} suffix of an intrinsic,
{zero} {one} {minus} constants, {call} the row's function of the C library. C: {name} the function being written.
"""

LLVM_SIGN = (
    "{r}.above = fcmp ogt {t} {0}, {zero}",
    "{r}.below = fcmp olt {t} {0}, {zero}",
    "{r}.nan = fcmp uno {t} {0}, {zero}",
    "{r}.up = select {b} {r}.above, {t} {one}, {t} {zero}",
    "{r}.down = select {b} {r}.below, {t} {minus}, {t} {r}.up",
    "{r} = select {b} {r}.nan, {t} {0}, {t} {r}.down",
)
LLVM_MINIMUM = (  # the first two lines are one instruction, which has the first argument of equal ones, and beside NaN
    "{r}.second = fcmp olt {t} {1}, {0}",
    "{r}.chosen = select {b} {r}.second, {t} {1}, {t} {0}",
    "{r}.nan = fcmp uno {t} {1}, {zero}",
    "{r} = select {b} {r}.nan, {t} {1}, {t} {r}.chosen",
)
LLVM_MAXIMUM = ("{r}.second = fcmp ogt {t} {1}, {0}", *LLVM_MINIMUM[1:])
LLVM_ZERO_SAFE_MUL = (
    "{r}.a = fcmp une {t} {0}, {zero}",
    "{r}.b = fcmp une {t} {1}, {zero}",
    "{r}.both = and {b} {r}.a, {r}.b",
    "{r}.product = fmul {f}{t} {0}, {1}",
    "{r} = select {b} {r}.both, {t} {r}.product, {t} {zero}",
)
LLVM_LOGISTIC = (
    "{r}.size = call {t} @llvm.fabs.{s}({t} {0})",
    "{r}.minus = fneg {t} {r}.size",
    "{r}.exp = call {t} {call}({t} {r}.minus)",
    "{r}.below = fcmp olt {t} {0}, {zero}",
    "{r}.top = select {b} {r}.below, {t} {r}.exp, {t} {one}",
    "{r}.bottom = fadd {f}{t} {r}.exp, {one}",
    "{r} = fdiv {f}{t} {r}.top, {r}.bottom",
)
LLVM_ONE_OR_ZERO = "{r} = select {b} {r}.is, {t} {one}, {t} {zero}"
LLVM_WHERE = ("{r}.is = fcmp une {t} {0}, {zero}", "{r} = select {b} {r}.is, {t} {1}, {t} {2}")


def llvm_arithmetic(instruction: str) -> tuple[str, ...]:
    """One of fadd, fsub, fmul and fdiv."""
    return (f"{{r}} = {instruction} {{f}}{{t}} {{0}}, {{1}}",)


def llvm_intrinsic(name: str) -> tuple[str, ...]:
    """A function that the processor has."""
    return (f"{{r}} = call {{t}} @llvm.{name}.{{s}}({{t}} {{0}})",)


def llvm_comparison(condition: str) -> tuple[str, ...]:
    """1.0 where the condition of fcmp holds, else 0.0."""
    return (f"{{r}}.is = fcmp {condition} {{t}} {{0}}, {{1}}", LLVM_ONE_OR_ZERO)


C_POWER = """\
/* Through volatile: compilers make pow(a, 2.0) into a * a and pow(2.0, b) into exp2(b), of another last bit. */
static double {name}_pow(double a, double b)
{{
    const volatile double base = a, exponent = b;
    return pow(base, exponent);
}}
"""
C_LOGISTIC = """\
static double {name}_logistic(double a)
{{
    const double e = exp(-fabs(a));
    return (a < 0.0 ? e : 1.0) / (1.0 + e);
}}
"""
MATHML_LOGARITHM = "<msub><mi>log</mi><mn>{}</mn></msub><mrow><mo>(</mo>{{0}}<mo>)</mo></mrow>"

# A browser has neither rounding to even nor error functions.
JAVASCRIPT_ROUND = """\
(a) => {
    const up = Math.round(a);
    return Math.abs(a % 1) === 0.5 && up % 2 !== 0 ? up - 1 : up;
  }"""
# erf a = 2 / sqrt(pi) exp(-a**2) (a + 2 a**3 / 3 + 2**2 a**5 / (3 5) + ...); for a >= 1 the continued fraction
# erfc a = exp(-a**2) / sqrt(pi) / (a + 1/2 / (a + 1 / (a + 3/2 / (a + ...)))), a**2 in two parts.
_JAVASCRIPT_ERROR = """\
(a) => {
    const series = () => {
      let term = a, sum = a;
      for (let k = 1; k < 40; k++) sum += term *= (2 * a * a) / (2 * k + 1);
      return ((2 * Math.exp(-a * a)) / Math.sqrt(Math.PI)) * sum;
    };
    const tail = (x) => {
      if (x > 28) return 0;
      const high = Math.fround(x);
      let bottom = x;
      for (let k = 200; k > 0; k--) bottom = x + k / 2 / bottom;
      return (Math.exp(-high * high) * Math.exp((high - x) * (high + x))) / (Math.sqrt(Math.PI) * bottom);
    };
    if (!(Math.abs(a) > 1)) return INNER;
    return OUTER;
  }"""
JAVASCRIPT_ERF = _JAVASCRIPT_ERROR.replace("INNER", "series()").replace("OUTER", "a > 0 ? 1 - tail(a) : tail(-a) - 1")
JAVASCRIPT_ERFC = _JAVASCRIPT_ERROR.replace("INNER", "1 - series()").replace("OUTER", "a > 0 ? tail(a) : 2 - tail(-a)")
