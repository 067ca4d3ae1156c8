"""Tableaus: the numbers of explicit Runge-Kutta methods."""

from __future__ import annotations

from dataclasses import dataclass

Row = tuple[float, ...]


@dataclass(frozen=True)
class Tableau:
    """Stage k is taken at t + c_k h and x + h sum_j a_kj slope_j; the step adds h sum_k b_k slope_k.

    Of an embedded method, besides: `error`, weights of h slope_k in its estimates of the error of a step (two in
    DOP853, which combines them), with the slope at the end of the step as one more; `estimate`, the order of the
    step's size in the estimate; `dense`, row k the weights of slope k in the coefficients of the dense output.
    `extra`: stages (c_k, a_k) that only the dense output needs.
    """

    order: int
    c: Row
    a: tuple[Row, ...]
    b: Row
    error: tuple[Row, ...] = ()
    estimate: int = 0
    dense: tuple[Row, ...] = ()
    extra: tuple[tuple[float, Row], ...] = ()


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

TABLEAUS = {"euler": EULER, "rk4": RK4, "dopri5": DOPRI5}  # a new row here is a new method of `simulate`
