"""Tableaus: the numbers of explicit Runge-Kutta methods, of partitioned ones, and of compositions."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from cgraph._shared import kept_by_first

RowOfWeights = tuple[float, ...]
Fractions = tuple[Fraction, ...]


@dataclass(frozen=True)
class Tableau:
    """The numbers of an explicit Runge-Kutta method; with weights of an error estimate it chooses its steps.

    Stage k is taken at t + c_k h and x + h sum_j a_kj slope_j; the step adds h sum_k b_k slope_k.
    """

    order: int
    c: RowOfWeights
    a: tuple[RowOfWeights, ...]
    b: RowOfWeights
    error: tuple[RowOfWeights, ...] = ()  # weights of h slope_k in estimates, the last for the slope at the end
    estimate: int = 0  # q, where the estimate falls as h^q
    dense: tuple[RowOfWeights, ...] = ()  # row k: weights of slope k in the coefficients of s, s^2, ..
    extra: tuple[tuple[float, RowOfWeights], ...] = ()  # stages (c_k, a_k) that only the dense output needs

    def __post_init__(self) -> None:
        s = len(self.b)
        fits = len(self.c) == len(self.a) == s and all(len(row) == k for k, row in enumerate(self.a))
        if not fits or any(not isinstance(row, tuple) or len(row) != s + 1 for row in self.error):
            raise ValueError(
                f"a tableau of {s} weights b needs as many times c, rows a of 0 to {s - 1} weights, and for error rows "
                f"of {s + 1}, got c={self.c}, a={self.a}, error={self.error}"
            )
        if self.error and self.estimate < 1:
            raise ValueError(f"error of a tableau needs estimate, q where it falls as h^q, got {self.estimate!r}")


EULER = Tableau(1, c=(0.0,), a=((),), b=(1.0,))
RK4 = Tableau(4, c=(0, 1 / 2, 1 / 2, 1), a=((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), b=(1 / 6, 1 / 3, 1 / 3, 1 / 6))

# Dormand and Prince, J. Comput. Appl. Math. 6 (1980) 19; dense output: Shampine, Math. Comp. 46 (1986) 135.
DOPRI5 = Tableau(
    5,
    c=(0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1),
    a=(
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    b=(35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    error=((71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),),
    estimate=5,
    dense=(
        (1, -8048581381 / 2820520608, 8663915743 / 2820520608, -12715105075 / 11282082432),
        (0, 0, 0, 0),
        (0, 131558114200 / 32700410799, -68118460800 / 10900136933, 87487479700 / 32700410799),
        (0, -1754552775 / 470086768, 14199869525 / 1410260304, -10690763975 / 1880347072),
        (0, 127303824393 / 49829197408, -318862633887 / 49829197408, 701980252875 / 199316789632),
        (0, -282668133 / 205662961, 2019193451 / 616988883, -1453857185 / 822651844),
        (0, 40617522 / 29380423, -110615467 / 29380423, 69997945 / 29380423),
    ),
)


# DOP853, of order 8 with dense output of order 7, after Dormand and Prince: Hairer, Norsett and Wanner I, second
# edition, section II.10, with the numbers of their program dop853.f. A row is a stage, or weights, {stage: weight}.
_Sparse = dict[int, float]
# fmt: off
_C = (0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25,
      0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0)
_A: tuple[_Sparse, ...] = (
    {},
    {0: 0.05260015195876773},
    {0: 0.0197250569845379, 1: 0.0591751709536137},
    {0: 0.02958758547680685, 2: 0.08876275643042054},
    {0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792},
    {0: 0.037037037037037035, 3: 0.17082860872947386, 4: 0.12546768756682242},
    {0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125},
    {0: 0.03709200011850479, 3: 0.17038392571223998, 4: 0.10726203044637328, 5: -0.015319437748624402,
     6: 0.008273789163814023},
    {0: 0.6241109587160757, 3: -3.3608926294469414, 4: -0.868219346841726, 5: 27.59209969944671,
     6: 20.154067550477894, 7: -43.48988418106996},
    {0: 0.47766253643826434, 3: -2.4881146199716677, 4: -0.590290826836843, 5: 21.230051448181193,
     6: 15.279233632882423, 7: -33.28821096898486, 8: -0.020331201708508627},
    {0: -0.9371424300859873, 3: 5.186372428844064, 4: 1.0914373489967295, 5: -8.149787010746927,
     6: -18.52006565999696, 7: 22.739487099350505, 8: 2.4936055526796523, 9: -3.0467644718982196},
    {0: 2.273310147516538, 3: -10.53449546673725, 4: -2.0008720582248625, 5: -17.9589318631188, 6: 27.94888452941996,
     7: -2.8589982771350235, 8: -8.87285693353063, 9: 12.360567175794303, 10: 0.6433927460157636},
)
_B: _Sparse = {0: 0.054293734116568765, 5: 4.450312892752409, 6: 1.8915178993145003, 7: -5.801203960010585,
               8: 0.3111643669578199, 9: -0.1521609496625161, 10: 0.20136540080403034, 11: 0.04471061572777259}
_ERROR5: _Sparse = {0: 0.01312004499419488, 5: -1.2251564463762044, 6: -0.4957589496572502, 7: 1.6643771824549864,
                    8: -0.35032884874997366, 9: 0.3341791187130175, 10: 0.08192320648511571,
                    11: -0.022355307863886294}
_ERROR3: _Sparse = {0: -0.18980075407240762, 5: 4.450312892752409, 6: 1.8915178993145003, 7: -5.801203960010585,
                    8: -0.4226823213237919, 9: -0.1521609496625161, 10: 0.20136540080403034, 11: 0.02265179219836082}
_EXTRA: tuple[tuple[float, _Sparse], ...] = (
    (0.1, {0: 0.056167502283047954, 6: 0.25350021021662483, 7: -0.2462390374708025, 8: -0.12419142326381637,
           9: 0.15329179827876568, 10: 0.00820105229563469, 11: 0.007567897660545699, 12: -0.008298}),
    (0.2, {0: 0.03183464816350214, 5: 0.028300909672366776, 6: 0.053541988307438566, 7: -0.05492374857139099,
           10: -0.00010834732869724932, 11: 0.0003825710908356584, 12: -0.00034046500868740456,
           13: 0.1413124436746325}),
    (0.7777777777777778, {0: -0.42889630158379194, 5: -4.697621415361164, 6: 7.683421196062599, 7: 4.06898981839711,
                          8: 0.3567271874552811, 12: -0.0013990241651590145, 13: 2.9475147891527724,
                          14: -9.15095847217987}),
)
_D: tuple[_Sparse, ...] = (
    {0: -8.428938276109013, 5: 0.5667149535193777, 6: -3.0689499459498917, 7: 2.38466765651207, 8: 2.117034582445028,
     9: -0.871391583777973, 10: 2.2404374302607883, 11: 0.6315787787694688, 12: -0.08899033645133331,
     13: 18.148505520854727, 14: -9.194632392478356, 15: -4.436036387594894},
    {0: 10.427508642579134, 5: 242.28349177525817, 6: 165.20045171727028, 7: -374.5467547226902,
     8: -22.113666853125306, 9: 7.733432668472264, 10: -30.674084731089398, 11: -9.332130526430229,
     12: 15.697238121770845, 13: -31.139403219565178, 14: -9.35292435884448, 15: 35.81684148639408},
    {0: 19.985053242002433, 5: -387.0373087493518, 6: -189.17813819516758, 7: 527.8081592054236,
     8: -11.57390253995963, 9: 6.8812326946963, 10: -1.0006050966910838, 11: 0.7777137798053443,
     12: -2.778205752353508, 13: -60.19669523126412, 14: 84.32040550667716, 15: 11.99229113618279},
    {0: -25.69393346270375, 5: -154.18974869023643, 6: -231.5293791760455, 7: 357.6391179106141,
     8: 93.40532418362432, 9: -37.45832313645163, 10: 104.0996495089623, 11: 29.8402934266605,
     12: -43.53345659001114, 13: 96.32455395918828, 14: -39.17726167561544, 15: -149.72683625798564},
)
# fmt: on


def _row(weights: _Sparse, length: int) -> RowOfWeights:
    return tuple([weights.get(k, 0.0) for k in range(length)])


def _dense() -> tuple[RowOfWeights, ...]:
    """Weights of the slopes in the powers of s, from the nested form that the program evaluates.

    x + s (F0 + (1 - s) (F1 + s (F2 + (1 - s) (F3 + s (F4 + (1 - s) (F5 + s F6)))))), with F3 to F6 from the table.
    """
    whole, first, last = np.array(_row(_B, 16)), np.eye(16)[0], np.eye(16)[12]
    parts = [whole, first - whole, 2.0 * whole - first - last, *(np.array(_row(weights, 16)) for weights in _D)]
    powers = np.zeros((len(parts) + 1, 16))
    for k, part in reversed(list(enumerate(parts))):
        powers[0] += part
        shifted = np.roll(powers, 1, axis=0)
        powers = shifted if k % 2 == 0 else powers - shifted
    return tuple([tuple(column.tolist()) for column in powers[1:].T])


DOP853 = Tableau(
    8,
    c=_C,
    a=tuple([_row(weights, k) for k, weights in enumerate(_A)]),
    b=_row(_B, 12),
    error=(_row(_ERROR5, 13), _row(_ERROR3, 13)),
    estimate=8,
    dense=_dense(),
    extra=tuple([(c, _row(weights, 13 + k)) for k, (c, weights) in enumerate(_EXTRA)]),
)

TABLEAUS = {"euler": EULER, "rk4": RK4, "dopri5": DOPRI5}  # a new row here is a new method of `simulate`


@kept_by_first
def real_stability(tableau: Tableau) -> float:
    """End of stability on the negative real axis: the smallest z > 0 with |R(-z)| > 1, to a sixty-fourth."""
    for k in itertools.count(1):
        slopes: list[float] = []
        for row in (*tableau.a, tableau.b):
            x = 1.0 + sum(weight * slope for weight, slope in zip(row, slopes, strict=False))
            slopes.append(-k / 64.0 * x)
        if abs(x) > 1.0:
            break
    return (k - 1) / 64.0


DIGITS = 50  # of the numbers of Gauss's methods
_0, HALF, _1 = Fraction(0), Fraction(1, 2), Fraction(1)


@dataclass(frozen=True)
class Partitioned:
    """The numbers: q's a_ij, p's b_ij, weights w_i, and the times c_i of the stages. The same a and b: Gauss."""

    order: int
    a: tuple[Fractions, ...]
    b: tuple[Fractions, ...]
    w: Fractions
    c: Fractions


def _gauss(order: int, a: tuple[Fractions, ...], w: Fractions) -> Partitioned:
    return Partitioned(order, a, a, w, tuple([sum(row, _0) for row in a]))


def _root(n: int) -> Fraction:
    return Fraction(math.isqrt(n * 10 ** (2 * DIGITS)), 10**DIGITS)


_B4, _R4 = Fraction(1, 4), _root(3) / 6
_B6, _C6, _R6 = Fraction(5, 36), Fraction(2, 9), _root(15)
GAUSS4 = _gauss(4, ((_B4, _B4 - _R4), (_B4 + _R4, _B4)), (HALF, HALF))
_A6 = (
    (_B6, _C6 - _R6 / 15, _B6 - _R6 / 30),
    (_B6 + _R6 / 24, _C6, _B6 - _R6 / 24),
    (_B6 + _R6 / 30, _C6 + _R6 / 15, _B6),
)
GAUSS6 = _gauss(6, _A6, (2 * _B6, 2 * _C6, 2 * _B6))
SYMPLECTIC_EULER = Partitioned(1, a=((_0,),), b=((_1,),), w=(_1,), c=(_0,))
VERLET = Partitioned(2, a=((_0, _0), (HALF, HALF)), b=((HALF, _0),) * 2, w=(HALF, HALF), c=(_0, _1))
MIDPOINT = _gauss(2, ((HALF,),), (_1,))
PARTITIONED = {"symplectic_euler": SYMPLECTIC_EULER, "verlet": VERLET, "midpoint": MIDPOINT}
PARTITIONED |= {"gauss4": GAUSS4, "gauss6": GAUSS6}


@dataclass(frozen=True)
class Composition:
    """Steps of a symmetric method of order two, `verlet` or else `midpoint`, of gamma_1 h, gamma_2 h, .., in turn."""

    order: int
    steps: tuple[float, ...]  # gamma_1, gamma_2, .., which add up to 1


def _closed(order: int, *half: float) -> Composition:
    """Numbers up to the middle one, which makes their sum 1; the rest mirrors them."""
    return Composition(order, (*half, 1.0 - 2.0 * sum(half), *reversed(half)))


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
