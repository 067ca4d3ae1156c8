"""RunOptions: how a simulation is run, which method, steps, errors and rows, checked in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, real_array, real_number

from ..equations.initial_value import increasing_times
from ..integrators import METHODS
from ..integrators.step_control import RESOLUTION
from .free_memory import room

METHOD = "dop853"  # unless another is asked for
RTOL, ATOL = 1e-9, 1e-10  # of chosen steps
STEP = 1e-3  # s, of methods of equal steps
BOUND = 1e-3  # of the estimated error of equal steps, relative
TABLES = 3  # that the rows are in at most at once, while they are put together
SCIPY = "scipy:"
SCIPY_SOLVERS = ("Radau", "BDF", "LSODA", "DOP853", "RK45")


@dataclass(frozen=True)
class RunOptions:
    """The options that `simulate` and `simulate_many` share, checked when they are put together.

    Parameters
    ----------
    t_end : float
        Where the run ends [s]; it starts at 0.
    method : str
        A name of `dyn.METHODS`, or one of SciPy's solvers, "scipy:Radau", "scipy:BDF", "scipy:LSODA",
        "scipy:DOP853", "scipy:RK45".
    dt : float, optional
        The step of methods of equal steps [s], 1e-3 by default. The steps between two recorded times are equal and at
        most dt, so that the last row is at t_end exactly.
    max_step : float, optional
        The longest step of methods that choose their steps [s]; no limit by default.
    rtol, atol : float, float or array_like, optional
        The error of a chosen step, relative to each component of the state, and absolute: one number for all, or (m,),
        one for each of q and then qd; 1e-9 and 1e-10 by default.
    t_eval : array_like, optional
        Increasing times in [0, t_end] to record, (T,) [s]; by default every step. Chosen steps are not changed by it.
    first_step : float, optional
        The first chosen step [s], in place of one chosen by trial.
    max_steps : float
        Steps, rejected ones included, after which the run stops.
    backend : str
        "llvm", "python", or "auto" for machine code where llvmlite is installed; the steps are the same.
    progress : bool, optional
        A progress line on standard error; None shows it on a terminal, for runs over a second.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, what was needed and what it is.

    Examples
    --------
    >>> from dynamics.simulation.run_options import RunOptions
    >>> RunOptions(2.0, "rk4").step
    0.001
    >>> RunOptions(2.0, "dopri5", dt=0.1)
    Traceback (most recent call last):
    ValueError: method 'dopri5' chooses its steps: max_step limits them; equal steps of dt = 0.1 s need method='rk4'
    """

    t_end: float
    method: str = METHOD
    dt: float | None = None
    max_step: float | None = None
    rtol: float | None = None
    atol: ArrayLike | None = None
    t_eval: ArrayLike | None = None
    first_step: float | None = None
    max_steps: float = math.inf
    backend: str = "auto"
    progress: bool | None = None
    t0: float = 0.0

    def __post_init__(self) -> None:
        check_method(self.method)
        for what in ("t_end", "dt", "max_step", "first_step"):
            value = getattr(self, what)
            if value is not None and not (math.isfinite(real_number(what, value)) and value > 0.0):
                raise ValueError(f"{what} must be positive and finite, got {value!r} s")
        if self.adaptive and self.dt is not None:
            raise ValueError(
                f"method {self.method!r} chooses its steps: max_step limits them; "
                f"equal steps of dt = {self.dt:g} s need method='rk4'"
            )
        for what in () if self.adaptive else ("max_step", "first_step"):
            if (value := getattr(self, what)) is not None:
                raise ValueError(
                    f"method {self.method!r} makes equal steps: set them by dt, not by {what} "
                    f"(got {what} = {value:g} s)"
                )
        self._check_tolerances()
        most = real_number("max_steps", self.max_steps)
        if not (most >= 1.0 and (most == math.inf or most == int(most))):
            raise ValueError(f"max_steps must be a whole number, at least 1, or infinite, got {self.max_steps!r}")
        normalized: dict[str, Any] = {"t_end": float(self.t_end), "max_steps": most}
        if self.t_eval is not None:
            normalized["t_eval"] = increasing_times(self.t_eval, self.t_end)
        for name, value in normalized.items():
            object.__setattr__(self, name, value)

    def _check_tolerances(self) -> None:
        rtol, atol = real_number("rtol", self.relative), np.asarray(self.absolute)
        if not (rtol >= 0.0 and np.all((atol >= 0.0) & (atol + rtol > 0.0) & (atol + rtol < math.inf))):
            raise ValueError(
                f"rtol and atol must be finite, not negative and not both 0, got {rtol!r} and {self.absolute!r}"
            )

    @property
    def scipy_solver(self) -> str | None:
        """The name of SciPy's solver; None for a method of `METHODS`."""
        return self.method.removeprefix(SCIPY) if self.method.startswith(SCIPY) else None

    @property
    def adaptive(self) -> bool:
        """Whether the method chooses its steps."""
        return self.scipy_solver is not None or METHODS[self.method].adaptive

    @property
    def step(self) -> float:
        """The largest of equal steps [s]."""
        return STEP if self.dt is None else float(self.dt)

    @property
    def longest_step(self) -> float:
        """The longest of chosen steps [s]; infinite without a limit."""
        return math.inf if self.max_step is None else float(self.max_step)

    @property
    def relative(self) -> float:
        """rtol, or what it is by default."""
        return (RTOL if self.adaptive else BOUND) if self.rtol is None else self.rtol

    @property
    def absolute(self) -> float | Array:
        """atol, a number or (m,), or what it is by default."""
        if self.atol is None:
            return ATOL if self.adaptive else 0.0
        atol = real_array("atol", self.atol)
        return atol if atol.ndim else float(atol)

    @property
    def times(self) -> Array | None:
        """t_eval, (T,) [s]; None for every step."""
        return None if self.t_eval is None else np.asarray(self.t_eval)

    @property
    def instants(self) -> list[float]:
        """What equal steps have to meet [s]: 0, and t_eval or t_end."""
        times: list[float] = [self.t_end] if self.times is None else self.times.tolist()
        return times if times[0] == 0.0 else [0.0, *times]

    def check(self, states: tuple[str, ...]) -> None:
        """Raises ValueError where atol has not one number for each state, or equal steps would not move the time."""
        m, shape = len(states), np.shape(self.absolute)
        if shape not in ((), (m,)):
            raise ValueError(
                f"atol must be one number, or have shape ({m},), one for each of {', '.join(states)}; got {shape}"
            )
        if not self.adaptive and self.step < RESOLUTION * self.t_end:
            raise ValueError(f"dt = {self.step:g} s is below the resolution of the time at t_end = {self.t_end:g} s")

    def check_room(self, m: int) -> None:
        """Raises MemoryError where every equal step as a row of m numbers would not fit."""
        if self.adaptive or self.t_eval is not None:
            return
        steps, free = step_count(self.t_end, self.step), room()
        size = 8 * TABLES * steps * m
        if size > free:
            raise MemoryError(
                f"{steps} steps of {m} numbers take {size / 2**30:.3g} GiB, and {free / 2**30:.3g} GiB are "
                "free: record fewer times (t_eval)"
            )


def check_method(method: str) -> None:
    """Raises TypeError or ValueError for what is no method."""
    if not isinstance(method, str):
        raise TypeError(f"method must be one of {', '.join(METHODS)} or scipy:..., got {method!r:.60}")
    if method.startswith(SCIPY):
        if method.removeprefix(SCIPY) not in SCIPY_SOLVERS:
            raise ValueError(f"SciPy's methods are {', '.join(SCIPY + name for name in SCIPY_SOLVERS)}, got {method!r}")
    elif method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)} or scipy:..., got {method!r}")


def step_count(length: float, dt: float) -> int:
    """The fewest equal steps of at most dt; a dt too short by rounding is long enough."""
    return max(1, math.ceil(length / dt * (1.0 - 1e-12)))
