"""RunOptions: how a simulation is run, which method, steps, errors and rows, checked in one place."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, nearest, or_nearest, real_array, real_number, require_flag

from ..equations.states.initial_value import times_to_record
from ..integrators import METHODS, Method
from ..integrators.step_control import RESOLUTION
from .steps.equal_steps import step_count

METHOD = "dop853"  # unless another is asked for
RTOL, ATOL = 1e-9, 1e-10  # of chosen steps
STEP = 1e-3  # s, of methods of equal steps
ERROR_BOUND = 1e-3  # of the estimated error of equal steps, relative
TABLES = 3  # that the rows are in at most at once, while they are put together
SMALL_MEMORY = 2.0**24  # bytes, below which nobody asks how many are free
MEMORY_SHARE = 0.9  # of the free memory


class Options(TypedDict, total=False):
    """Keywords by which a run is made, of `simulate`, `prepare`, `simulate_many`, `gradient` and their kin.

    Parameters
    ----------
    t0 : float
        Where the run starts [s], 0 by default.
    t_span : array_like
        (t0, t_end), as in SciPy, in place of the two.
    dt : float
        The largest of equal steps [s], 1e-3 by default: the steps between two recorded times are equal, so that the
        last row is at t_end exactly.
    max_step : float
        The longest of chosen steps [s]; no limit by default.
    rtol, atol : float, float or array_like
        The error of a chosen step, relative to each component of the state, and absolute: one number for all, or (m,),
        one for each of q and then qd. By default 1e-9, and for atol rtol times the largest value that the
        component has had so far, or a ten-thousandth of the largest coordinate or velocity, in whatever unit: of a
        mechanism an angle counts as the way that it moves its bodies by. All entries of a quaternion are as large as 1.
        A jump of a force in time is passed then, as well as a hundredth of the longest of the last steps allows. Of
        equal steps the estimated error that is no cause of a warning, relative to the largest of a component over the
        run; 1e-3 and 0 by default.
    first_step : float
        In place of the first step that the method chooses [s].
    max_steps : float
        Trials of steps, rejected ones too, after which the run stops.
    estimate_error : bool
        Of equal steps, whether runs beside, of steps two and four times as long, estimate their error
        (`Stats.error`), which takes three quarters as long again; by default they do. The rows are the same without.
    dense_output : bool
        Whether to keep what lies between the rows, for `Trajectory.solution(t)`: some numbers a step for every one of
        the state.
    form : {"velocity", "momentum"}
        What the steps are of: q and qd, or q and the momenta p = dL/dqd by Hamilton's equations, on which symplectic
        methods then act as they are written. Events, controllers, rows and dense output are in q and qd all the same,
        and the rows have p besides; `atol` of (m,) is for q and then p. Not with constraints.
    backend : {"auto", "llvm", "python"}
        "llvm", "python", or "auto" for machine code where llvmlite is installed; the steps are the same.
    fma : bool
        Whether the steps may fuse a product and a sum where the processor can, as in `cgraph.compile`. Without they
        have the bits that they have in Python, in C and on any other machine with the same C library.
    progress : bool
        A progress line on standard error; by default on a terminal, for runs over a second.

    Examples
    --------
    >>> import dynamics as dyn
    >>> fine: dyn.Options = {"rtol": 1e-12, "t_span": (0.0, 2.0)}
    >>> dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], **fine).q[-1].round(6)
    array([0.01857])
    """

    t0: float
    t_span: ArrayLike | None
    dt: float | None
    max_step: float | None
    rtol: float | None
    atol: ArrayLike | None
    first_step: float | None
    max_steps: float
    estimate_error: bool | None
    dense_output: bool
    form: str
    backend: str
    fma: bool
    progress: bool | None


TAKEN = Options.__annotations__.keys() - {"t0", "t_span", "dense_output", "form"}  # by `RunOptions`


@dataclass(frozen=True)
class RunOptions:
    """The options that `simulate`, `simulate_many` and gradients share, checked when they are put together.

    Parameters
    ----------
    t_end, method, dt, max_step, rtol, atol, t_eval, first_step, max_steps, backend, progress, t0, estimate_error, fma
        As for `simulate`.

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
    estimate_error: bool | None = None
    fma: bool = True

    def __post_init__(self) -> None:
        check_method(self.method)
        if not isinstance(self.backend, str):
            raise TypeError(f"backend must be a string, got {type(self.backend).__name__}: {self.backend!r:.40}")
        for what, value in (("dt", self.dt), ("max_step", self.max_step), ("first_step", self.first_step)):
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
        self._check_estimate()
        require_flag("fma", self.fma)
        most = real_number("max_steps", self.max_steps)
        if not (most >= 1.0 and (most == math.inf or most == int(most))):
            raise ValueError(f"max_steps must be a whole number, at least 1, or infinite, got {self.max_steps!r}")
        self.__dict__.update(span(self.t0, self.t_end, self.t_eval), max_steps=most)

    @classmethod
    def of(
        cls,
        method: str,
        options: Mapping[str, Any],
        t0: float = 0.0,
        t_end: float = 1.0,
        t_eval: ArrayLike | None = None,
        without: Sequence[str] = (),
    ) -> RunOptions:
        """Those of a method and keywords of `Options`, but some.  Raises TypeError for a keyword that there is not."""
        if unknown := [name for name in options if name not in TAKEN or name in without]:
            known = [name for name in Options.__annotations__ if name not in without]
            raise TypeError(f"there is no option {unknown[0]!r:.60} here; {or_nearest(unknown[0], known)}")
        return cls(t_end, method, t0=t0, t_eval=t_eval, **options)

    def over(self, t0: float, t_end: float, t_eval: ArrayLike | None) -> RunOptions:
        """Options of another run. Raises as a run does for its times."""
        other = object.__new__(RunOptions)
        other.__dict__.update(self.__dict__, **span(t0, t_end, t_eval))
        return other

    def spans(self, t0: float, t_end: float) -> bool:
        """Whether a run may go from t0 to t_end."""
        moves = self.adaptive or self.step >= RESOLUTION * max(abs(t0), abs(t_end))
        return moves and t0 != t_end and math.isfinite(t_end - t0)

    def _check_tolerances(self) -> None:
        rtol, atol = real_number("rtol", self.relative), np.asarray(self.absolute)
        if not (rtol >= 0.0 and np.all((atol >= 0.0) & (atol + rtol > 0.0) & (atol + rtol < math.inf))):
            raise ValueError(
                f"rtol and atol must be finite, not negative and not both 0, got {rtol!r} and {self.absolute!r}"
            )

    def _check_estimate(self) -> None:
        for name, value in (("estimate_error", self.estimate_error), ("progress", self.progress)):
            if value is not None and not isinstance(value, bool):
                raise TypeError(f"{name} must be True, False or None, got {value!r:.40}")
        if self.adaptive and self.estimate_error:
            raise ValueError(
                f"method {self.method!r} keeps the error of its steps within rtol and atol: "
                "estimate_error is for equal steps, such as those of method='rk4'"
            )
        if not self.adaptive and self.estimate_error is False:
            for what in ("rtol", "atol"):
                if getattr(self, what) is not None:
                    raise ValueError(f"{what} is a bound of the estimated error, which estimate_error=False leaves out")

    @property
    def estimated(self) -> bool:
        """Whether runs beside the main one estimate the error."""
        return not self.adaptive and self.estimate_error is not False

    @cached_property
    def adaptive(self) -> bool:
        """Whether the method chooses its steps."""
        return METHODS[self.method].adaptive

    @property
    def integrator(self) -> Method:
        """The method, of `METHODS`, for this tolerance."""
        return METHODS[self.method].at(self.relative)

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
        return (RTOL if self.adaptive else ERROR_BOUND) if self.rtol is None else self.rtol

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
    def between(self) -> bool:
        """Whether times to record lie between the ends of a run."""
        return self.times is not None and not {*self.times.tolist()} <= {self.t0, self.t_end}

    @property
    def direction(self) -> float:
        """1.0, or -1.0 for a run back in time."""
        return math.copysign(1.0, self.t_end - self.t0)

    @property
    def length(self) -> float:
        """Length of the run [s]."""
        return abs(self.t_end - self.t0)

    @property
    def row_times(self) -> Array:
        """Times of the rows of equal steps, t_eval or every step, (T,)."""
        if self.times is not None:
            return self.times
        steps = step_count(self.length, self.step)
        return np.append(self.t0 + (self.t_end - self.t0) / steps * np.arange(steps), self.t_end)

    @property
    def instants(self) -> list[float]:
        """Instants that equal steps have to meet [s]: t0, t_eval and t_end."""
        times: list[float] = [] if self.times is None else self.times.tolist()
        first = [] if times[:1] == [self.t0] else [self.t0]
        last = [] if times[-1:] == [self.t_end] else [self.t_end]
        return [*first, *times, *last]

    def check(self, states: tuple[str, ...]) -> None:
        """Raises ValueError where atol has not one number for each state, or equal steps would not move the time."""
        m, shape = len(states), np.shape(self.absolute)
        if shape not in ((), (m,)):
            raise ValueError(
                f"atol must be one number, or have shape ({m},), one for each of {', '.join(states)}; got {shape}"
            )
        name, latest = ("t0", self.t0) if abs(self.t0) > abs(self.t_end) else ("t_end", self.t_end)
        if not self.adaptive and self.step < RESOLUTION * abs(latest):
            raise ValueError(f"dt = {self.step:g} s is below the resolution of the time at {name} = {latest:g} s")

    def check_room(self, m: int) -> None:
        """Raises MemoryError where every equal step as a row of m numbers would not fit."""
        if self.adaptive or self.t_eval is not None:
            return
        steps = step_count(self.t_end - self.t0, self.step)
        require_room(8 * TABLES * steps * m, f"{steps} steps of {m} numbers", "record fewer times (t_eval)")


def span(t0: float, t_end: float, t_eval: ArrayLike | None) -> dict[str, Any]:
    """The times of a run, checked."""
    t0, t_end = real_number("t0", t0), real_number("t_end", t_end)
    if not (math.isfinite(t0) and math.isfinite(t_end)):
        name, value = ("t_end", t_end) if math.isfinite(t0) else ("t0", t0)
        raise ValueError(f"{name} must be finite, got {value!r} s")
    if t0 == t_end:
        raise ValueError(f"t_end must be another time than t0, got {t_end!r} s for both")
    return {"t0": t0, "t_end": t_end, "t_eval": None if t_eval is None else times_to_record(t_eval, t_end, t0)}


def check_method(method: str) -> None:
    """Raises TypeError or ValueError for what is no method."""
    if not isinstance(method, str):
        raise TypeError(f"method must be one of {', '.join(METHODS)}, got {method!r:.60}")
    if method not in METHODS:
        near = " or ".join(map(repr, nearest(method, METHODS)))
        hint = f"did you mean {near}?" if near else f"there are {', '.join(METHODS)}"
        raise ValueError(f"there is no method {method!r:.60}; {hint}")


def time_span(t_end: float | None, t0: float, t_span: ArrayLike | None) -> tuple[float, float]:
    """(t0, t_end), given as such or as t_span. Raises ValueError where neither or both are given."""
    if t_span is None:
        if t_end is None:
            raise ValueError("where does the run end: t_end, or t_span = (t0, t_end), must be given")
        return t0, t_end
    if t_end is not None or t0 != 0.0:
        raise ValueError(f"t_span says where the run starts and ends: leave out t0 and t_end, got {t0!r} and {t_end!r}")
    span = real_array("t_span", t_span)
    if span.shape != (2,):
        raise ValueError(f"t_span must be two times, (t0, t_end), got shape {span.shape}")
    return float(span[0]), float(span[1])


def require_room(size: float, what: str, instead: str) -> None:
    """Raises MemoryError where results of so many bytes would not fit, with what to do instead."""
    if size > SMALL_MEMORY and size > (free := room()):
        raise MemoryError(f"{what} take {size / 2**30:.3g} GiB, and {free / 2**30:.3g} GiB are free: {instead}")


def room() -> float:
    """Bytes that a result may take."""
    return MEMORY_SHARE * _free()


def _free() -> float:
    """Bytes that can be taken without swapping; where the system does not say, all there are, or no limit."""
    with suppress(OSError, StopIteration):  # Linux
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    with suppress(OSError, ValueError, AttributeError):  # macOS
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    return math.inf
