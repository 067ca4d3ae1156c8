"""Options of a run: how it steps, and when it is, checked in one place."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, nearest, or_nearest, real_array, real_number, require_choice, require_flag

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
        The largest of equal steps [s], 1e-3 by default: the steps between two recorded times are equal.
    max_step : float
        The longest of chosen steps [s]; no limit by default.
    rtol, atol : float, float or array_like
        The error of a chosen step, relative to each component of the state, and absolute: one number for all, or (m,),
        one for each of q and then qd. By default 1e-9, and for atol rtol times the largest value that the component has
        had so far, or a ten-thousandth of the largest coordinate or velocity. Of equal steps the estimated error that
        is no cause of a warning, relative to the largest of a component over the run; 1e-3 and 0 by default.
    first_step : float
        In place of the first step that the method chooses [s].
    max_steps : float
        Trials of steps, rejected ones too, after which the run stops.
    estimate_error : bool
        Of equal steps, whether runs of steps two and four times as long estimate their error (`Stats.error`), which
        takes three quarters as long again; by default they do, but never with a `SampledController`
        or events that reset the state; the run says "error not estimated" then.
    dense_output : bool
        Whether to keep what lies between the rows, for `Trajectory.solution(t)`.
    form : {"velocity", "momentum"}
        What the steps are of: q and qd, or q and the momenta p = dL/dqd by Hamilton's equations, on which symplectic
        methods then act as they are written. All else is in q and qd, but `atol` of (m,) is for q and then p; the rows
        have p besides. Not with constraints.
    backend : {"auto", "llvm", "python"}
        Machine code or Python; "auto" is machine code where llvmlite is installed. The steps are the same.
    fma : bool
        Whether products and sums may be fused, as in `cgraph.compile`; without, bits are the same on any machine.
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


TAKEN = Options.__annotations__.keys() - {"t0", "t_span", "dense_output", "form"}  # by `Steps`


@dataclass(frozen=True)
class Steps:
    """How a run steps, as `Options` say it; checked once, when it is made."""

    method: str = METHOD
    dt: float | None = None
    max_step: float | None = None
    rtol: float | None = None
    atol: ArrayLike | None = None
    first_step: float | None = None
    max_steps: float = math.inf
    backend: str = "auto"
    fma: bool = True
    estimate_error: bool | None = None
    progress: bool | None = None
    adaptive: bool = field(init=False)  # whether the method chooses its steps
    estimated: bool = field(init=False)  # whether runs beside the main one estimate the error
    step: float = field(init=False)  # the largest of equal steps [s]
    longest_step: float = field(init=False)  # of chosen steps [s]
    relative: float = field(init=False)  # rtol, or what it is by default
    absolute: float | Array = field(init=False)  # atol, a number or (m,), or what it is by default

    def __post_init__(self) -> None:
        if not isinstance(self.method, str):
            raise TypeError(f"method must be one of {', '.join(METHODS)}, got {self.method!r:.60}")
        if self.method not in METHODS:
            near = " or ".join(map(repr, nearest(self.method, METHODS)))
            hint = f"did you mean {near}?" if near else f"there are {', '.join(METHODS)}"
            raise ValueError(f"there is no method {self.method!r:.60}; {hint}")
        adaptive, who = METHODS[self.method].adaptive, f"method {self.method!r}"
        require_choice("backend", self.backend, ("auto", "llvm", "python"))
        require_flag("fma", self.fma)
        for what in ("dt", "max_step", "first_step"):
            if (value := getattr(self, what)) is None:
                continue
            if not (math.isfinite(real_number(what, value)) and value > 0.0):
                raise ValueError(f"{what} must be positive and finite, got {value!r} s")
            if adaptive and what == "dt":
                other = f"equal steps of dt = {value:g} s need method='rk4'"
                raise ValueError(f"{who} chooses its steps: max_step limits them; {other}")
            if not adaptive and what != "dt":
                raise ValueError(f"{who} makes equal steps: set them by dt, not by {what} (got {what} = {value:g} s)")
        rtol, atol = (RTOL, ATOL) if adaptive else (ERROR_BOUND, 0.0)
        rtol = rtol if self.rtol is None else real_number("rtol", self.rtol)
        absolute = np.asarray(atol if self.atol is None else real_array("atol", self.atol))
        if not (rtol >= 0.0 and np.all((absolute >= 0.0) & (absolute + rtol > 0.0) & (absolute + rtol < math.inf))):
            given = f"got {rtol!r} and {absolute.tolist()!r}"
            raise ValueError(f"rtol and atol must be finite, not negative and not both 0, {given}")
        for name in ("estimate_error", "progress"):
            if not isinstance(value := getattr(self, name), bool | None):
                raise TypeError(f"{name} must be True, False or None, got {value!r:.40}")
        if adaptive and self.estimate_error:
            raise ValueError(f"{who} keeps the error of its steps within rtol: estimate_error is for equal steps")
        for what in ("rtol", "atol") if not adaptive and self.estimate_error is False else ():
            if getattr(self, what) is not None:
                raise ValueError(f"{what} is a bound of the estimated error, which estimate_error=False leaves out")
        most = real_number("max_steps", self.max_steps)
        if not (most >= 1.0 and (most == math.inf or most == int(most))):
            raise ValueError(f"max_steps must be a whole number, at least 1, or infinite, got {self.max_steps!r}")
        vars(self).update(
            max_steps=most,
            adaptive=adaptive,
            estimated=not adaptive and self.estimate_error is not False,
            step=STEP if self.dt is None else float(self.dt),
            longest_step=math.inf if self.max_step is None else float(self.max_step),
            relative=rtol,
            absolute=absolute if absolute.ndim else float(absolute),
        )

    @property
    def integrator(self) -> Method:
        """The method for this tolerance."""
        return METHODS[self.method].at(self.relative)

    def may_go(self, t0: float, t_end: float) -> bool:
        """Whether a run may go from t0 to t_end."""
        moves = self.adaptive or self.step >= RESOLUTION * max(abs(t0), abs(t_end))
        return moves and t0 != t_end and math.isfinite(t_end - t0)

    def row_times(self, span: Span) -> Array:
        """Times of the rows of equal steps: those of the span, or every step, (T,)."""
        if span.times is not None:
            return span.times
        count = step_count(span.length, self.step)
        return np.append(span.t0 + (span.t_end - span.t0) / count * np.arange(count), span.t_end)

    def check(self, span: Span, states: tuple[str, ...]) -> None:
        """Raises ValueError where atol has not one number for each state, or equal steps would not move the time."""
        m, shape = len(states), np.shape(self.absolute)
        if shape not in ((), (m,)):
            needed = f"or have shape ({m},), one for each of {', '.join(states)}"
            raise ValueError(f"atol must be one number, {needed}; got {shape}")
        name, latest = ("t0", span.t0) if abs(span.t0) > abs(span.t_end) else ("t_end", span.t_end)
        if not self.adaptive and self.step < RESOLUTION * abs(latest):
            raise ValueError(f"dt = {self.step:g} s is below the resolution of the time at {name} = {latest:g} s")


@dataclass(frozen=True)
class Span:
    """When a run is, from t0 to t_end [s], and when its rows are; checked once, when it is made."""

    t_end: float
    _: KW_ONLY
    t0: float = 0.0
    t_eval: ArrayLike | None = None
    times: Array | None = field(init=False)  # t_eval, (T,); None for every step
    has_inner_times: bool = field(init=False)  # whether times lie between the ends
    direction: float = field(init=False)  # 1.0, or -1.0 for a run back in time
    length: float = field(init=False)  # [s]

    def __post_init__(self) -> None:
        t0, t_end = real_number("t0", self.t0), real_number("t_end", self.t_end)
        for name, value in (("t0", t0), ("t_end", t_end)):
            if not math.isfinite(value):
                raise ValueError(f"{name} must be finite, got {value!r} s")
        if t0 == t_end:
            raise ValueError(f"t_end must be another time than t0, got {t_end!r} s for both")
        times = None if self.t_eval is None else times_to_record(self.t_eval, t_end, t0)
        inside = times is not None and not {*times.tolist()} <= {t0, t_end}
        vars(self).update(t0=t0, t_end=t_end, t_eval=times, times=times, has_inner_times=inside)
        vars(self).update(direction=math.copysign(1.0, t_end - t0), length=abs(t_end - t0))

    @property
    def instants(self) -> list[float]:
        """Instants that equal steps have to meet [s]: t0, t_eval and t_end."""
        met = {self.t0, self.t_end, *([] if self.times is None else self.times.tolist())}
        return sorted(met, reverse=self.direction < 0.0)


def known_options(options: Mapping[str, Any], without: Sequence[str] = ()) -> Mapping[str, Any]:
    """The keywords. Raises TypeError for one that there is not."""
    if unknown := [name for name in options if name not in TAKEN or name in without]:
        known = [name for name in Options.__annotations__ if name not in without]
        raise TypeError(f"there is no option {unknown[0]!r:.60} here; {or_nearest(unknown[0], known)}")
    return options


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
    """Bytes that a result may take without swapping; where the system does not say, of all there are, or no limit."""
    with suppress(OSError, StopIteration):  # Linux
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return MEMORY_SHARE * 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    with suppress(OSError, ValueError, AttributeError):  # macOS
        return MEMORY_SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return math.inf
