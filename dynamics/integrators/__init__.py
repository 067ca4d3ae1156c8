"""Integrators: methods for xdot = f(x, t), as programs over the graphs of a model."""

import math
from collections.abc import Callable
from functools import partial
from importlib import import_module

from cgraph._shared import doors, memo

from .explicit import explicit_step
from .problem import (
    Problem as Problem,
    derive as derive,
    force as force,
    in_form as in_form,
    quantity as quantity,
    quantity_inputs as quantity_inputs,
    state_arguments as state_arguments,
    time_derivative as time_derivative,
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
    gauss,
)

TYPE_CHECKING = False  # as a checker knows it

if TYPE_CHECKING:
    from .symplectic import mechanics as mechanics

__getattr__, __dir__ = doors(__name__, __file__)
TAYLOR_ORDER, LEAST_ORDER = 22, 4  # of a tolerance of 2^-52, and of large ones
MOST_STAGES = 12  # of Gauss's methods: order 24, beyond which float64 gains nothing


def runge_kutta(tableau: Tableau) -> Method:
    """An explicit Runge-Kutta method: equal steps, or steps by error where the tableau has weights of an estimate."""
    step, degree = partial(explicit_step, tableau), len(tableau.interpolant[0])
    return Method(tableau.order, step, adaptive=bool(tableau.error), degree=degree)


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
        return _gauss(GAUSS[name])

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in GAUSS


GAUSS = {f"gauss{2 * stages}": stages for stages in range(1, MOST_STAGES + 1)}


@memo(MOST_STAGES)
def _gauss(stages: int) -> Method:
    return _symplectic(gauss(stages))


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
        **{name: _symplectic(method, "composed_step") for name, method in COMPOSITIONS.items()},
    }
)
