"""Texts of operations in LLVM's language and in C that are too long for a row.

LLVM: {r} result, {0} {1} {2} arguments, {t} type, {b} type of a comparison, {f} flags, {s} suffix of an intrinsic,
{zero} {one} {minus} constants. C: {name} the function being written.
"""

from __future__ import annotations

LLVM_SIGN = (
    "{r}.above = fcmp ogt {t} {0}, {zero}",
    "{r}.below = fcmp olt {t} {0}, {zero}",
    "{r}.nan = fcmp uno {t} {0}, {zero}",
    "{r}.up = select {b} {r}.above, {t} {one}, {t} {zero}",
    "{r}.down = select {b} {r}.below, {t} {minus}, {t} {r}.up",
    "{r} = select {b} {r}.nan, {t} {0}, {t} {r}.down",
)
LLVM_MINIMUM = (
    "{r}.nan = fcmp uno {t} {0}, {zero}",
    "{r}.less = fcmp ole {t} {0}, {1}",
    "{r}.first = or {b} {r}.nan, {r}.less",
    "{r} = select {b} {r}.first, {t} {0}, {t} {1}",
)
LLVM_MAXIMUM = (
    "{r}.nan = fcmp uno {t} {0}, {zero}",
    "{r}.more = fcmp oge {t} {0}, {1}",
    "{r}.first = or {b} {r}.nan, {r}.more",
    "{r} = select {b} {r}.first, {t} {0}, {t} {1}",
)
LLVM_ZERO_SAFE_MUL = (
    "{r}.a = fcmp une {t} {0}, {zero}",
    "{r}.b = fcmp une {t} {1}, {zero}",
    "{r}.both = and {b} {r}.a, {r}.b",
    "{r}.product = fmul {f}{t} {0}, {1}",
    "{r} = select {b} {r}.both, {t} {r}.product, {t} {zero}",
)
LLVM_WHERE = ("{r}.is = fcmp une {t} {0}, {zero}", "{r} = select {b} {r}.is, {t} {1}, {t} {2}")


def llvm_arithmetic(instruction: str) -> tuple[str, ...]:
    """One of fadd, fsub, fmul and fdiv."""
    return (f"{{r}} = {instruction} {{f}}{{t}} {{0}}, {{1}}",)


def llvm_intrinsic(name: str) -> tuple[str, ...]:
    """A function that the processor has."""
    return (f"{{r}} = call {{t}} @llvm.{name}.{{s}}({{t}} {{0}})",)


def llvm_comparison(condition: str) -> tuple[str, ...]:
    """1.0 where the condition of fcmp holds, else 0.0."""
    return (f"{{r}}.is = fcmp {condition} {{t}} {{0}}, {{1}}", "{r} = select {b} {r}.is, {t} {one}, {t} {zero}")


C_POWER = """\
/* Through volatile: compilers make pow(a, 2.0) into a * a and pow(2.0, b) into exp2(b), of another last bit. */
static double {name}_pow(double a, double b)
{{
    const volatile double base = a, exponent = b;
    return pow(base, exponent);
}}
"""
