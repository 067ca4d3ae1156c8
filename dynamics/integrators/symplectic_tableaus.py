"""The numbers of symplectic methods: partitioned tableaus, those of Gauss of any number of stages, and compositions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

Fractions = tuple[Fraction, ...]

DIGITS = 50  # of the numbers of Gauss's methods
NEWTON = 8  # steps that make 50 digits of a guess that has two or three
_0, _1 = Fraction(0), Fraction(1)


@dataclass(frozen=True)
class Partitioned:
    """The numbers: q's a_ij, p's b_ij, weights w_i, and the times c_i of the stages. The same a and b: Gauss."""

    order: int
    a: tuple[Fractions, ...]
    b: tuple[Fractions, ...]
    w: Fractions
    c: Fractions


def gauss(stages: int) -> Partitioned:
    """Gauss's method of s stages, of order 2 s: collocation at the roots x of Legendre's polynomial P_s.

    With c = (1 + x) / 2 and w = 1 / ((1 - x^2) P_s'(x)^2), a_ij, the integral of Lagrange's polynomial j to c_i, is
    w_j (c_i + sum over 0 < k < s of P_k(x_j) (P_k+1(x_i) - P_k-1(x_i)) / 2)  (Hairer and Wanner II, section IV.5).
    """
    roots = [_root(stages, i) for i in reversed(range(stages))]
    p = [_legendre(stages, x) for x in roots]
    w = [_rounded(1 / ((1 - x * x) * _slope(values, x) ** 2)) for x, values in zip(roots, p, strict=True)]
    a = []
    for x, here in zip(roots, p, strict=True):
        rises = [(here[k + 1] - here[k - 1]) / 2 for k in range(1, stages)]
        total = [(1 + x) / 2 + sum([u * v for u, v in zip(there[1:], rises, strict=False)], _0) for there in p]
        a.append(tuple([_rounded(weight * each) for weight, each in zip(w, total, strict=True)]))
    rows = tuple(a)
    return Partitioned(2 * stages, rows, rows, tuple(w), tuple([sum(row, _0) for row in rows]))


def _legendre(degree: int, x: Fraction) -> list[Fraction]:
    """P_0(x) .. P_degree(x)."""
    p = [_1, x]
    for k in range(1, degree):
        p.append(_rounded(((2 * k + 1) * x * p[k] - k * p[k - 1]) / (k + 1)))
    return p


def _slope(p: list[Fraction], x: Fraction) -> Fraction:
    """P_s'(x) of P_0(x) .. P_s(x)."""
    s = len(p) - 1
    return s * (x * p[s] - p[s - 1]) / (x * x - 1)


def _root(degree: int, i: int) -> Fraction:
    """Root i of Legendre's polynomial, from the largest down, by Newton's method."""
    x = _rounded(Fraction(math.cos(math.pi * (i + 0.75) / (degree + 0.5))))
    for _ in range(NEWTON):
        p = _legendre(degree, x)
        x = _rounded(x - p[degree] / _slope(p, x))
    return x


def _rounded(x: Fraction) -> Fraction:
    return Fraction(round(x * 10**DIGITS), 10**DIGITS)


def over(denominator: int, *numerators: int) -> Fractions:
    """The numerators, each over the denominator."""
    return tuple([Fraction(numerator, denominator) for numerator in numerators])


SYMPLECTIC_EULER = Partitioned(1, a=((_0,),), b=((_1,),), w=(_1,), c=(_0,))
VERLET = Partitioned(2, a=(over(2, 0, 0), over(2, 1, 1)), b=(over(2, 1, 0),) * 2, w=over(2, 1, 1), c=(_0, _1))
MIDPOINT = gauss(1)
PARTITIONED = {
    "symplectic_euler": SYMPLECTIC_EULER,
    "verlet": VERLET,
    "midpoint": MIDPOINT,
    "gauss4": gauss(2),
    "gauss6": gauss(3),
}


@dataclass(frozen=True)
class Composition:
    """A method of higher order: steps of a symmetric one of order two, of gamma_1 h, gamma_2 h, .., in turn.

    The base is `verlet` where it is explicit (kinetic energy of the velocities alone, forces of the coordinates), and
    else `midpoint`, which takes any Lagrangian and systems of first order. A palindrome of numbers makes a symmetric
    method, and steps of symplectic maps are symplectic.
    half: gamma_1 .. up to the middle one, which is last; the rest mirrors them.
    """

    order: int
    half: tuple[float, ...]

    @property
    def steps(self) -> tuple[float, ...]:
        """gamma_1, gamma_2, .., which add up to 1."""
        return (*self.half, *reversed(self.half[:-1]))


def _closed(order: int, *half: float) -> Composition:
    """Numbers with the middle one that makes their sum 1."""
    return Composition(order, (*half, 1.0 - 2.0 * sum(half)))


# Yoshida, Phys. Lett. A 150 (1990) 262: the triple jump, solution A of order 6, solution D of order 8.
# McLachlan, SIAM J. Sci. Comput. 16 (1995) 151, table 2: 5 steps of order 4, 9 of order 6.
# Kahan and Li, Math. Comp. 66 (1997) 1089: 9 steps of order 6, 17 of order 8.
# fmt: off
COMPOSITIONS = {  # a new row here is a new method of `simulate`
    "yoshida4": _closed(4, 1.0 / (2.0 - 2.0 ** (1 / 3))),
    "yoshida6": _closed(6, 0.78451361047755726382, 0.23557321335935813368, -1.17767998417887100695),
    "yoshida8": _closed(8, 0.91484424622979156675, 0.25369333656621135415, -1.44485223686060515770,
                        -0.15824063536805017520, 1.93813913762252598658, -1.96061023297531080761,
                        0.10279984939179640644),
    "mclachlan4": _closed(4, 0.28, 0.62546642846767004501),
    "mclachlan6": _closed(6, 0.1867, 0.55549702371247839916, 0.12946694891347535806, -0.84326562338773460855),
    "kahan_li6": _closed(6, 0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
                         0.08221359629355080023),
    "kahan_li8": _closed(8, 0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641,
                         0.15884190655515560090, -0.39590389413323757734, 0.18453964097831570709,
                         0.25837438768632204729, 0.29501172360931029887),
}
# fmt: on
