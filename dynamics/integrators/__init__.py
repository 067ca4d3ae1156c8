"""Integrators: methods for xdot = f(x, t), as programs over the graphs of a model."""

import math
from collections.abc import Callable
from functools import partial
from importlib import import_module

from .explicit import explicit_step
from .problem import (
    Problem as Problem,
    derive as derive,
    force as force,
    in_form as in_form,
    quantity as quantity,
    quantity_inputs as quantity_inputs,
    state_arguments as state_arguments,
    total_energy as total_energy,
)
from .step import (
    Step as Step,
    call as call,
    each as each,
    jacobian_statements as jacobian_statements,
    total as total,
)
from .step_control import Method as Method, measured as measured
from .tableau import (
    COMPOSITIONS,
    DOP853,
    PARTITIONED,
    TABLEAUS as TABLEAUS,
    Composition,
    Partitioned,
    Tableau as Tableau,
)

TAYLOR_ORDER, LEAST_ORDER = 22, 4  # of a tolerance of 2^-52, and of large ones


def runge_kutta(tableau: Tableau) -> Method:
    """An explicit Runge-Kutta method: equal steps, or steps by error where the tableau has weights of an estimate."""
    return Method(tableau.order, partial(explicit_step, tableau), adaptive=bool(tableau.error), by_rows=True)


def _later(file: str, name: str, *given: object, **usual: int) -> Callable[..., Step]:
    """The step of a method, whose file is loaded when a problem first takes it.  usual: unless others are chosen."""

    def step(problem: Problem, **chosen: int) -> Step:
        made: Step = getattr(import_module(f"{__name__}.{file}"), name)(*given, problem, **usual | chosen)
        return made

    return step


def _symplectic(method: Partitioned | Composition, step: str = "partitioned_step") -> Method:
    return Method(method.order, _later("symplectic", step, method))


def _taylor_order(rtol: float) -> int:
    """The order of Jorba and Zou for a relative tolerance, and two more, which small systems repay."""
    wanted = 3.0 - 0.5 * math.log(rtol) if 0.0 < rtol < 1.0 else math.inf
    return math.ceil(min(max(wanted, LEAST_ORDER), TAYLOR_ORDER))


_taylor = _later("taylor", "taylor_step", order=TAYLOR_ORDER)
METHODS: dict[str, Method] = {
    **{name: runge_kutta(tableau) for name, tableau in TABLEAUS.items()},
    "dop853": runge_kutta(DOP853),
    "rodas": Method(5, _later("rosenbrock", "rodas_step"), adaptive=True),
    "radau": Method(5, _later("radau", "radau_step"), adaptive=True),
    "taylor": Method(TAYLOR_ORDER, _taylor, adaptive=True, finest=2.0**-52, starts=True, order_at=_taylor_order),
    **{name: _symplectic(method) for name, method in PARTITIONED.items()},
    **{name: _symplectic(method, "composed_step") for name, method in COMPOSITIONS.items()},
}
