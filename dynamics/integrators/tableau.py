"""Tableaus: the numbers of explicit Runge-Kutta methods."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from cgraph._shared import kept_by_first

RowOfWeights = tuple[float, ...]


def _count(row: object) -> int:
    """Numbers of a row, -1 of what is none."""
    return len(row) if isinstance(row, tuple | list) else -1


@dataclass(frozen=True)
class Tableau:
    """The numbers of an explicit Runge-Kutta method of s stages.

    Stage k is taken at t + c_k h and x + h sum_j a_kj slope_j; the step adds h sum_k b_k slope_k. A tableau with
    weights of an error estimate is an embedded method, which chooses its steps.

    Parameters
    ----------
    order : int
        p, where the error of a run falls as h^p.
    c : tuple
        Times of the stages, s numbers, the first 0.
    a : tuple of tuples
        Row k the weights of the slopes before stage k, k numbers.
    b : tuple
        Weights of the slopes in the step, s numbers.
    error : tuple of tuples, optional
        Weights of h slope_k in an estimate of the error of the step, s + 1 numbers, the last for the slope at the end
        of the step. DOP853 has two estimates, which are combined.
    estimate : int, optional
        q, where the estimate falls as h^q; needed with `error`.
    dense : tuple of tuples, optional
        Row k the weights of slope k in the coefficients of s, s^2, .. of the dense output; without them the cubic
        through states and slopes at both ends.
    extra : tuple of (float, tuple), optional
        Stages (c_k, a_k) that only the dense output needs.

    Raises
    ------
    ValueError
        For weights that are not as many as their stages, and for `error` without `estimate`.

    Examples
    --------
    Kutta's 3/8 rule, as a method of `simulate` from here on:

    >>> import dynamics as dyn
    >>> from dynamics.integrators import Tableau, runge_kutta
    >>> a = ((), (1 / 3,), (-1 / 3, 1), (1, -1, 1))
    >>> rule = Tableau(4, c=(0, 1 / 3, 2 / 3, 1), a=a, b=(1 / 8, 3 / 8, 3 / 8, 1 / 8))
    >>> dyn.METHODS["kutta38"] = runge_kutta(rule)
    >>> dyn.METHODS["kutta38"]
    <Method of order 4, equal steps>
    >>> decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    >>> dyn.simulate(decay, [1.0], None, 1.0, "kutta38", dt=0.1).q[-1].round(6)
    array([0.36788])
    >>> del dyn.METHODS["kutta38"]
    """

    order: int
    c: RowOfWeights
    a: tuple[RowOfWeights, ...]
    b: RowOfWeights
    error: tuple[RowOfWeights, ...] = ()
    estimate: int = 0
    dense: tuple[RowOfWeights, ...] = ()
    extra: tuple[tuple[float, RowOfWeights], ...] = ()

    def __post_init__(self) -> None:
        stages = len(self.b)
        if len(self.c) != stages or [_count(row) for row in self.a] != [*range(stages)]:
            raise ValueError(
                f"a tableau of {stages} weights b needs as many times c and rows a of 0 to {stages - 1} numbers, got "
                f"{len(self.c)} times and rows of {', '.join(str(_count(row)) for row in self.a) or 'none'}"
            )
        if wrong := [row for row in self.error if _count(row) != stages + 1]:
            raise ValueError(
                f"error of a tableau is a tuple of rows of {stages + 1} weights, one a stage and one for the slope at "
                f"the end of the step, got {wrong[0]!r:.60} for a row"
            )
        if self.error and self.estimate < 1:
            raise ValueError(f"error of a tableau needs estimate, q where it falls as h^q, got {self.estimate!r}")

    @property
    def interpolant(self) -> tuple[RowOfWeights, ...]:
        """`dense`, or in its place the weights of Hermite's cubic, a row for each slope, that at the end included.

        x + s h f0 + s^2 (3 D - h (2 f0 + f1)) + s^3 (h (f0 + f1) - 2 D), with D = h sum_k b_k slope_k.
        """
        if self.dense:
            return self.dense
        first = [1.0, *[0.0] * len(self.b)]
        step = zip(first, (*self.b, 0.0), reversed(first), strict=True)
        return tuple([(f0, 3.0 * b - 2.0 * f0 - f1, f0 + f1 - 2.0 * b) for f0, b, f1 in step])


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


TABLEAUS = {"euler": EULER, "rk4": RK4, "dopri5": DOPRI5}  # a new row here is a new method of `simulate`
