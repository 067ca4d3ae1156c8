"""Integrators: methods for xdot = f(x, t), as programs over the graphs of a model."""

from functools import partial

from .dop853 import DOP853
from .explicit import explicit
from .method import Method
from .problem import Problem, problem_of
from .radau import ORDER as RADAU_ORDER, radau
from .rosenbrock import RODAS5P, rosenbrock
from .step_control import embedded
from .symplectic import GAUSS4, GAUSS6, MIDPOINT, SYMPLECTIC_EULER, VERLET, Partitioned, partitioned
from .tableau import DOPRI5, EULER, RK4, Tableau


def _explicit(tableau: Tableau) -> Method:
    return Method(tableau.order, lambda problem, _: explicit(tableau, problem), adaptive=False)


def _embedded(tableau: Tableau) -> Method:
    return Method(tableau.order, partial(embedded, tableau), adaptive=True, degree=len(tableau.dense[0]))


def _partitioned(method: Partitioned) -> Method:
    return Method(method.order, lambda problem, _: partitioned(method, problem), adaptive=False)


METHODS: dict[str, Method] = {
    "euler": _explicit(EULER),
    "rk4": _explicit(RK4),
    "dopri5": _embedded(DOPRI5),
    "dop853": _embedded(DOP853),
    "rodas": Method(RODAS5P.order, partial(rosenbrock, RODAS5P), adaptive=True, degree=len(RODAS5P.dense) + 1),
    "radau": Method(RADAU_ORDER, radau, adaptive=True, degree=3),
    "symplectic_euler": _partitioned(SYMPLECTIC_EULER),
    "verlet": _partitioned(VERLET),
    "midpoint": _partitioned(MIDPOINT),
    "gauss4": _partitioned(GAUSS4),
    "gauss6": _partitioned(GAUSS6),
}

__all__ = ["METHODS", "Method", "Problem", "problem_of"]
