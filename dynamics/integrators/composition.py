"""Compositions: methods of higher order, as steps of a symmetric method of order two, one after another.

A step of h is steps of gamma_1 h, gamma_2 h, .. The base is `verlet` where it is explicit (kinetic energy of the
velocities alone, forces of the coordinates), and else `midpoint`, which takes any Lagrangian and systems of first
order. A palindrome of numbers makes a symmetric method, and steps of symplectic maps are symplectic.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Composition:
    """The numbers: gamma_1 .. up to the middle one, which is last; the rest mirrors them."""

    order: int
    half: tuple[float, ...]

    @property
    def steps(self) -> tuple[float, ...]:
        """gamma_1, gamma_2, .., which add up to 1."""
        return (*self.half, *reversed(self.half[:-1]))


def _closed(order: int, *half: float) -> Composition:
    """With the middle number that makes their sum 1."""
    return Composition(order, (*half, 1.0 - 2.0 * sum(half)))


# Yoshida, Phys. Lett. A 150 (1990) 262: the triple jump, solution A of order 6, solution D of order 8.
# McLachlan, SIAM J. Sci. Comput. 16 (1995) 151, table 2: 5 steps of order 4, 9 of order 6.
# Kahan and Li, Math. Comp. 66 (1997) 1089: 9 steps of order 6, 17 of order 8.
COMPOSITIONS = {  # a new row here is a new method of `simulate`
    "yoshida4": _closed(4, 1.0 / (2.0 - 2.0 ** (1 / 3))),
    "yoshida6": _closed(6, 0.78451361047755726382, 0.23557321335935813368, -1.17767998417887100695),
    "yoshida8": _closed(
        8,
        0.91484424622979156675,
        0.25369333656621135415,
        -1.44485223686060515770,
        -0.15824063536805017520,
        1.93813913762252598658,
        -1.96061023297531080761,
        0.10279984939179640644,
    ),
    "mclachlan4": _closed(4, 0.28, 0.62546642846767004501),
    "mclachlan6": _closed(6, 0.1867, 0.55549702371247839916, 0.12946694891347535806, -0.84326562338773460855),
    "kahan_li6": _closed(
        6, 0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023
    ),
    "kahan_li8": _closed(
        8,
        0.13020248308889008088,
        0.56116298177510838456,
        -0.38947496264484728641,
        0.15884190655515560090,
        -0.39590389413323757734,
        0.18453964097831570709,
        0.25837438768632204729,
        0.29501172360931029887,
    ),
}
