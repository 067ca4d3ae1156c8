"""Integrators: methods for xdot = f(x, t), as programs over the graphs of a model."""

from functools import partial

from .dop853 import DOP853
from .explicit import explicit
from .method import Method
from .momentum_graphs import Mechanics, mechanics
from .problem import Problem, derive, force, quantity, quantity_inputs, state_jacobian, time_derivative, total_energy
from .radau import ORDER as RADAU_ORDER, radau
from .rosenbrock import RODAS5P, rosenbrock
from .step_control import embedded
from .symplectic import PARTITIONED, Partitioned, partitioned
from .tableau import TABLEAUS, Tableau


def runge_kutta(tableau: Tableau) -> Method:
    """An explicit Runge-Kutta method: equal steps, or steps by error where the tableau has weights of an estimate."""
    if tableau.error:
        return Method(tableau.order, partial(embedded, tableau), adaptive=True, degree=len(tableau.interpolant[0]))
    return Method(tableau.order, lambda problem, _: explicit(tableau, problem), adaptive=False)


def _symplectic(method: Partitioned) -> Method:
    return Method(method.order, lambda problem, _: partitioned(method, problem), adaptive=False)


METHODS: dict[str, Method] = {
    **{name: runge_kutta(tableau) for name, tableau in TABLEAUS.items()},
    "dop853": runge_kutta(DOP853),
    "rodas": Method(RODAS5P.order, partial(rosenbrock, RODAS5P), adaptive=True, degree=len(RODAS5P.dense) + 1),
    "radau": Method(RADAU_ORDER, radau, adaptive=True, degree=3),
    **{name: _symplectic(method) for name, method in PARTITIONED.items()},
}

__all__ = [
    "METHODS",
    "Mechanics",
    "Method",
    "Problem",
    "Tableau",
    "derive",
    "force",
    "mechanics",
    "quantity",
    "quantity_inputs",
    "runge_kutta",
    "state_jacobian",
    "time_derivative",
    "total_energy",
]
