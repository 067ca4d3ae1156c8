"""Vector functions as LLVM text: sine, cosine, exp and log by polynomials, every other function of libm lane by lane.

Strict arithmetic calls libm for all, so that a batch has the bits of a single call. Each polynomial serves where its
range reduction is exact enough, with an error below 2 ulp. Lanes outside (too large, NaN, infinite, for a logarithm not
positive) have their value from libm, so that none depends on its neighbours. Other functions have no polynomial:
equations of motion take sines and cosines of joint angles and hardly anything else.
"""

from collections.abc import Iterable, Mapping, Sequence

from .function_writer import Arithmetic, FunctionWriter

MAGIC = 6755399441055744.0  # 1.5 * 2**52: added to a small number, it leaves the nearest integer in the low bits
LARGEST_ANGLE = 1e6

# Polynomials and splittings of constants: fdlibm (k_sin.c, k_cos.c, e_rem_pio2.c, e_log.c; Sun Microsystems, 1993).
SIN: tuple[float, ...] = (-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04)
SIN += (2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10)
COS: tuple[float, ...] = (4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05)
COS += (-2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11)
LOG: tuple[float, ...] = (6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01)
LOG += (2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01)
HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)  # 33 bits, 33 bits, rest
LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
# exp(r) = 1 + r + r**2 * (1/2! + r/3! + ... + r**11/13!), with |r| <= ln(2) / 2
EXP = tuple(1.0 / f for f in (2, 6, 24, 120, 720, 5040, 40320, 362880, 3628800, 39916800, 479001600, 6227020800))


class _Vectors(FunctionWriter):
    """Instructions on vectors. An argument is a value's name or a number for all lanes."""

    f = FunctionWriter.apply

    def n(self, op: str, a: str, b: str | int) -> str:
        """Arithmetic on integers, with a constant or another value."""
        return self.value(f"{op} <{self.lanes} x i64> {a}, {b if isinstance(b, str) else f'splat (i64 {b})'}")

    def cast(self, a: str, back: bool = False) -> str:
        """The bits of doubles, as integers; or the doubles of bits."""
        kinds = (f"<{self.lanes} x i64>", self.type) if back else (self.type, f"<{self.lanes} x i64>")
        return self.value(f"bitcast {kinds[0]} {a} to {kinds[1]}")

    def polynomial(self, x: str, coefficients: Sequence[float]) -> str:
        """c0 + c1 x + c2 x**2 + ..., by Estrin's scheme: (c0 + c1 x) + (c2 + c3 x) x**2 + ..., few steps deep."""
        terms: list[str | float] = list(coefficients)
        while len(terms) > 1:
            pairs = zip(terms[::2], terms[1::2], strict=False)
            last = terms[-1:] if len(terms) % 2 else []
            terms = [*[self.f("fadd", self.f("fmul", b, x), a) for a, b in pairs], *last]
            x = self.f("fmul", x, x) if len(terms) > 1 else x
        assert isinstance(terms[0], str)
        return terms[0]

    def between(self, x: str, low: float, high: float) -> str:
        """Lanes that lie in [low, high]; a NaN does not."""
        return self.value(f"and {self.bits} {self.compare('oge', x, low)}, {self.compare('ole', x, high)}")


POLYNOMIAL = ("sin", "cos", "exp", "log")
INTERVALS = {  # of the arguments that the polynomials serve
    "sin": (-LARGEST_ANGLE, LARGEST_ANGLE),
    "cos": (-LARGEST_ANGLE, LARGEST_ANGLE),
    "exp": (-708.0, 709.0),
    "log": (2.0**-1022, 1.7976931348623157e308),
}
JOINED = {"sincos": ("sin", "cos")}  # a function that gives the results of two


def helpers(functions: Mapping[str, int], lanes: int, flags: str, *, polynomials: bool) -> list[str]:
    """Definitions of `lanesN.name`, N lanes wide, for each function that is named, with its number of arguments.

    They are functions of the C library and, with polynomials alone, "sincos", which gives {sine, cosine}.
    """
    of_libm = {part: arity for name, arity in functions.items() for part in JOINED.get(name, (name,))}
    text: list[str] = []
    for name, arity in of_libm.items():
        prefix = "each" if polynomials and name in POLYNOMIAL else "lanes"
        text += _lane_by_lane(f"{prefix}{lanes}.{name}", name, arity, lanes)
    for name in functions if polynomials else ():
        parts = JOINED.get(name, (name,))
        if parts[0] in POLYNOMIAL:
            text += _guarded(parts, lanes, flags)
    return text


def _lane_by_lane(inner: str, name: str, arity: int, lanes: int) -> list[str]:
    """The function of libm, called for each lane."""
    ir, result = FunctionWriter(Arithmetic(lanes=lanes)), "poison"
    for lane in range(lanes):
        numbers = [ir.value(f"extractelement {ir.type} %a{k}, i32 {lane}") for k in range(arity)]
        number = ir.value(f"call double @{name}({', '.join([f'double {each}' for each in numbers])})")
        result = ir.value(f"insertelement {ir.type} {result}, double {number}, i32 {lane}")
    arguments = ", ".join([f"{ir.type} %a{k}" for k in range(arity)])
    return ir.function(f"internal {ir.type} @{inner}({arguments}) nounwind noinline", f"{ir.type} {result}")


def _guarded(names: Sequence[str], lanes: int, flags: str) -> list[str]:
    """The polynomial in the lanes that lie in the interval, libm in the others. Two names give both results."""
    to = _Vectors(Arithmetic(flags, lanes))
    inside = to.between("%x", *INTERVALS[names[0]])
    if names[0] in ("sin", "cos"):
        results = _sine_cosine(to, "%x", names)
    else:
        results = [(_exp if names[0] == "exp" else _log)(to, "%x")]
    kind = to.type if len(names) == 1 else f"{{{to.type}, {to.type}}}"
    everywhere = to.value(f"call i1 @llvm.vector.reduce.and.v{lanes}i1({to.bits} {inside})")
    to.fork(everywhere, "fast", "slow")
    to.block("fast")
    to.line(f"ret {kind} {_together(to, results)}")
    to.block("slow")
    mixed = []
    for name, result in zip(names, results, strict=True):
        of_libm = to.value(f"call {to.type} @each{lanes}.{name}({to.type} %x)")
        mixed.append(to.choose(inside, result, of_libm))
    head = f"internal {kind} @lanes{lanes}.{''.join(names)}({to.type} %x) nounwind noinline"
    return to.function(head, f"{kind} {_together(to, mixed)}")


def _together(to: _Vectors, results: Sequence[str]) -> str:
    """One result, or two as a pair."""
    if len(results) == 1:
        return results[0]
    pair = f"{{{to.type}, {to.type}}}"
    first = to.value(f"insertvalue {pair} poison, {to.type} {results[0]}, 0")
    return to.value(f"insertvalue {pair} {first}, {to.type} {results[1]}, 1")


def _sine_cosine(to: _Vectors, x: str, names: Iterable[str]) -> list[str]:
    """For |x| <= 1e6: x = k pi/2 + r. The products of k (20 bits) with the first two parts of pi/2 are exact."""
    shifted = to.f("fadd", to.f("fmul", x, 0.63661977236758134308, exact=True), MAGIC, exact=True)
    k = to.f("fsub", shifted, MAGIC, exact=True)
    quadrant = to.cast(shifted)
    first = to.f("fsub", x, to.f("fmul", k, HALF_PI[0], exact=True), exact=True)
    taken = to.f("fmul", k, HALF_PI[1], exact=True)
    second = to.f("fsub", first, taken, exact=True)
    lost = to.f("fsub", to.f("fsub", first, second, exact=True), taken, exact=True)
    rest = to.f("fsub", lost, to.f("fmul", k, HALF_PI[2], exact=True), exact=True)
    r = to.f("fadd", second, rest, exact=True)
    z = to.f("fmul", r, r, exact=True)

    sine = to.f("fadd", to.f("fmul", to.f("fmul", r, z), to.polynomial(z, SIN)), r)
    half = to.f("fmul", z, 0.5, exact=True)
    most = to.f("fsub", 1.0, half, exact=True)
    missing = to.f("fsub", to.f("fsub", 1.0, most, exact=True), half, exact=True)
    tail = to.f("fadd", to.f("fmul", to.f("fmul", z, z), to.polynomial(z, COS)), missing)
    cosine = to.f("fadd", most, tail, exact=True)

    odd = to.value(f"trunc <{to.lanes} x i64> {quadrant} to {to.bits}")
    results = []
    for name in names:
        one, other = (sine, cosine) if name == "sin" else (cosine, sine)
        value = to.choose(odd, other, one)
        turns = quadrant if name == "sin" else to.n("add", quadrant, 1)
        sign = to.n("and", to.n("shl", turns, 62), -(2**63))
        value = to.cast(to.n("xor", to.cast(value), sign), back=True)
        if name == "sin":  # of -0.0 it is -0.0
            value = to.choose(to.compare("oeq", x, 0.0), x, value)
        results.append(value)
    return results


def _exp(to: _Vectors, x: str) -> str:
    """Exponential for -708 <= x <= 709: x = k ln 2 + r."""
    shifted = to.f("fadd", to.f("fmul", x, 1.44269504088896338700, exact=True), MAGIC, exact=True)
    k = to.f("fsub", shifted, MAGIC, exact=True)
    high = to.f("fsub", x, to.f("fmul", k, LN2[0], exact=True), exact=True)
    low = to.f("fmul", k, LN2[1], exact=True)
    r = to.f("fsub", high, low, exact=True)
    lost = to.f("fsub", to.f("fsub", high, r, exact=True), low, exact=True)
    more = to.f("fadd", to.f("fmul", to.f("fmul", r, r), to.polynomial(r, EXP)), lost)
    value = to.f("fadd", to.f("fadd", more, r, exact=True), 1.0, exact=True)
    half = to.n("ashr", to.n("shl", to.cast(shifted), 32), 33)  # k / 2, rounded down; twice, as 2**1024 is no double
    whole = to.n("ashr", to.n("shl", to.cast(shifted), 32), 32)
    for power in (half, to.n("sub", whole, half)):
        value = to.f("fmul", value, to.cast(to.n("shl", to.n("add", power, 1023), 52), back=True), exact=True)
    return value


def _log(to: _Vectors, x: str) -> str:
    """Logarithm of positive normal numbers: x = 2**k (1 + f), sqrt(1/2) <= 1 + f < sqrt(2), and s = f / (2 + f)."""
    bits = to.cast(x)
    root_half = 0x3FE6A09E667F3BCD
    exponent = to.n("ashr", to.n("sub", bits, root_half), 52)
    one_plus = to.cast(to.n("sub", bits, to.n("shl", exponent, 52)), back=True)
    k = to.f("fsub", to.cast(to.n("add", exponent, 0x4338000000000000), back=True), MAGIC, exact=True)
    f = to.f("fsub", one_plus, 1.0, exact=True)
    s = to.f("fdiv", f, to.f("fadd", f, 2.0, exact=True), exact=True)
    z = to.f("fmul", s, s)
    remainder = to.f("fmul", to.polynomial(z, LOG), z)
    half = to.f("fmul", to.f("fmul", f, 0.5, exact=True), f, exact=True)
    small = to.f("fadd", to.f("fmul", s, to.f("fadd", half, remainder)), to.f("fmul", k, LN2[1]))
    inner = to.f("fsub", to.f("fsub", half, small), f)
    return to.f("fsub", to.f("fmul", k, LN2[0], exact=True), inner, exact=True)
