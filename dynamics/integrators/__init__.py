"""Integrators: methods for xdot = f(x, t), as programs over the graphs of a model."""

import math
from collections.abc import Callable
from functools import partial
from importlib import import_module

from cgraph._shared import doors, memo

from .dop853 import DOP853
from .explicit import explicit_step
from .method import Method
from .momenta import Mechanics, in_form, mechanics, momentum_form
from .problem import (
    Problem,
    derive,
    force,
    quantity,
    quantity_inputs,
    state_arguments,
    state_jacobian,
    time_derivative,
    total_energy,
)
from .statements import call, each, total
from .step import Step
from .step_control import measured
from .symplectic_tableaus import COMPOSITIONS, PARTITIONED, Composition, Partitioned, gauss
from .tableau import TABLEAUS, Tableau

TYPE_CHECKING = False  # as a checker knows it

if TYPE_CHECKING:
    from .jacobian_statements import jacobian_statements

__getattr__, __dir__ = doors(__name__, __file__)
TAYLOR_ORDER, LEAST_ORDER = 22, 4  # of a tolerance of 2^-52, and of large ones
MOST_STAGES = 12  # of Gauss's methods: order 24, beyond which float64 gains nothing


def runge_kutta(tableau: Tableau) -> Method:
    """An explicit Runge-Kutta method: equal steps, or steps by error where the tableau has weights of an estimate."""
    step = partial(explicit_step, tableau)
    if tableau.error:
        return Method(tableau.order, step, adaptive=True, degree=len(tableau.interpolant[0]))
    return Method(tableau.order, step)


def _later(file: str, name: str, *given: object, **usual: int) -> Callable[..., Step]:
    """The step of a method, whose file is loaded when a problem first takes it.  usual: unless others are chosen."""

    def step(problem: Problem, **chosen: int) -> Step:
        made: Step = getattr(import_module(f"{__name__}.{file}"), name)(*given, problem, **usual | chosen)
        return made

    return step


def _symplectic(method: Partitioned | Composition, step: str = "partitioned_step") -> Method:
    return Method(method.order, _later("symplectic", step, method))


class Methods(dict[str, Method]):
    """Methods by name: those that are listed, and "gauss<2 s>" for any number s of stages up to `MOST_STAGES`."""

    def __missing__(self, name: str) -> Method:
        if not _names_gauss(name):
            raise KeyError(name)
        return _gauss(int(name.removeprefix("gauss")) // 2)

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and _names_gauss(name))


@memo(MOST_STAGES)
def _gauss(stages: int) -> Method:
    return _symplectic(gauss(stages))


def _names_gauss(name: str) -> bool:
    return name in [f"gauss{2 * stages}" for stages in range(1, MOST_STAGES + 1)]


def _taylor_order(rtol: float) -> int:
    """Jorba and Zou's for a relative tolerance, and two more; the highest where it asks for nothing.

    Theirs is the best where a step costs what its coefficients do. Of small systems the rest costs as much.
    """
    wanted = 3.0 - 0.5 * math.log(rtol) if 0.0 < rtol < 1.0 else math.inf
    return math.ceil(min(max(wanted, LEAST_ORDER), TAYLOR_ORDER))


METHODS: dict[str, Method] = Methods(
    {
        **{name: runge_kutta(tableau) for name, tableau in TABLEAUS.items()},
        "dop853": runge_kutta(DOP853),
        "rodas": Method(5, _later("rosenbrock", "rodas_step"), adaptive=True, degree=4),
        "radau": Method(5, _later("radau", "radau_step"), adaptive=True, degree=3),
        "taylor": Method(
            TAYLOR_ORDER,
            _later("taylor", "taylor_step", order=TAYLOR_ORDER),
            adaptive=True,
            degree=TAYLOR_ORDER,
            finest=2.0**-52,
            starts=True,
            order_at=_taylor_order,
        ),
        **{name: _symplectic(method) for name, method in PARTITIONED.items()},
        **{
            name: Method(each.order, _later("symplectic", "composed_step", each)) for name, each in COMPOSITIONS.items()
        },
    }
)

__all__ = [
    "METHODS",
    "TABLEAUS",
    "Mechanics",
    "Method",
    "Problem",
    "Step",
    "Tableau",
    "call",
    "derive",
    "each",
    "force",
    "in_form",
    "jacobian_statements",
    "measured",
    "mechanics",
    "momentum_form",
    "quantity",
    "quantity_inputs",
    "runge_kutta",
    "state_arguments",
    "state_jacobian",
    "time_derivative",
    "total",
    "total_energy",
]
