"""Reference solutions of any model: two unlike runs, whose difference is the error; kept in a folder."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, atomic_write, real_array, require_path

from ..equations.state_equation import state_equation, state_inputs
from ..equations.states.initial_value import other_inputs, start_state, times_to_record
from ..systems.controller import with_closed_form
from ..systems.model import Model, as_equations
from .decimal_numbers import working
from .taylor_integrator import ReferenceFailedError, taylor

FEWEST, STEP, MOST_DIGITS = 8, 6, 400  # digits of the tolerance: at least, more in each run, and at most
SPARE = 6  # digits written beyond those asked for


@dataclass(frozen=True)
class Reference:
    """States at some times, in decimal, as `reference` gives them.

    Parameters
    ----------
    t : tuple of float
        The times, (T,) [s].
    decimal : tuple of tuple of str
        States in decimal, (T, m): q and then qd [rad or m, per second], or the states of an OdeSystem.
    error : float
        Error bound of `decimal`, relative to the largest value of the same state.
    how : str
        The method, and how the error was estimated.

    Examples
    --------
    >>> exact = Reference((1.0,), (("0.33333333333333333333",),), 1e-20, "by hand")
    >>> print(exact.deviation([[1.0 / 3.0]]))
    [[-1.85003837e-17]]
    """

    t: tuple[float, ...]
    decimal: tuple[tuple[str, ...], ...]
    error: float
    how: str

    @cached_property
    def x(self) -> Array:
        """The states rounded to float64, (T, m)."""
        return np.array([[float(text) for text in row] for row in self.decimal]).reshape(len(self.t), -1)

    @cached_property
    def _rest(self) -> Array:
        """Remainder that the rounding of `x` left out."""
        rest = [[float(Fraction(text) - Fraction(float(text))) for text in row] for row in self.decimal]
        return np.array(rest).reshape(self.x.shape)

    def deviation(self, x: ArrayLike) -> Array:
        """x - reference, (T, m), exact to the last bits of x, where `x - self.x` would end at an ulp of it."""
        values = real_array("the states", x)
        if values.shape != self.x.shape:
            raise ValueError(f"the states must have the reference's shape {self.x.shape}, got {values.shape}")
        return (values - self.x) - self._rest

    def relative_error(self, x: ArrayLike) -> float:
        """The largest deviation relative to the largest value of its state; a state that is zero counts as is."""
        return float(np.max(np.abs(self.deviation(x)) / scale(self.x), initial=0.0))


def scale(x: Array) -> Array:
    """The largest value of each state over the times, (m,); 1 where it is zero throughout."""
    largest: Array = np.max(np.abs(x), axis=0, initial=0.0)
    return np.where(largest > 0.0, largest, 1.0)


def from_text(t: Sequence[float], rows: Sequence[Sequence[str]], error: float, how: str) -> Reference:
    """A Reference of plain sequences."""
    return Reference(tuple(map(float, t)), tuple([tuple(row) for row in rows]), float(error), how)


def reference(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_eval: ArrayLike,
    *,
    digits: int = 30,
    tau: float | Sequence[float] | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, float] | None = None,
    folder: str | Path | None = None,
) -> Reference:
    """The motion of a model from (q, qd) at t = 0, to so many digits, by Taylor series.

    The error stated is the difference between the solution and another run with fewer digits, another order and other
    steps, so it is that of the worse one. Digits are added until it is at most 10^-digits. The problem solved is the
    graph as it stands, with its constants and the start taken as exact. Steps end where a piecewise operation switches.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The start, (nq,) and (n,) [rad or m, per second], as in `simulate`; of an OdeSystem q is the state, (m,), and qd
        None. The length of a quaternion stays what its float64 make it, 1 to rounding.
    t_eval : array_like
        Increasing times from 0 on, (T,) [s].
    digits : int
        Decimal digits of the result, 1 to 200, relative to the largest value of the same state.
    tau : float, sequence or callable
        Constant applied force [N m or N], for all velocities or for each, (n,); or a controller in closed form, see
        `with_controller`.
    parameters : mapping, optional
        {name: value} in place of the model's own, and of those of a controller.
    folder : path, optional
        Where solutions are kept and read again; one that cannot be read is computed anew.

    Returns
    -------
    Reference
        States at t_eval in decimal, with their error.

    Raises
    ------
    TypeError, ValueError
        For arguments of another type, shape or range, each by name.
    NotImplementedError
        For an operation whose row has no multiprecision value, or that jumps where its argument moves.
    ReferenceFailedError
        At a singularity, for a stiff motion of more than a million steps, or when 400 digits are not enough.
    ImportError
        Without mpmath.

    Examples
    --------
    >>> import dynamics as dyn
    >>> decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    >>> print(dyn.reference(decay, [1.0], None, [1.0], digits=30).decimal[0][0][:32])
    0.367879441171442321595523770161
    """
    if folder is not None:
        folder = require_path("folder", folder)
    if isinstance(digits, bool) or not (isinstance(digits, int) and 1 <= digits <= MOST_DIGITS // 2):
        raise ValueError(f"digits must be a whole number from 1 to {MOST_DIGITS // 2}, got {digits!r}")
    model, constant, _ = with_closed_form(as_equations(model), tau, parameters)
    bound, inputs = other_inputs(model, constant, parameters), state_inputs(model)
    x, times = start_state(model, q, qd, bound).tolist(), times_to_record(t_eval).tolist()
    values = {name: bound[name] for name in (*inputs.parameters, *inputs.applied)}
    graph = state_equation(model)

    path = None if folder is None else folder / f"{key(graph, inputs.states, x, times, values, digits)}.json"
    if path is not None and (kept := _read(path, times, len(x))) is not None:
        return kept

    def run(wanted: int) -> tuple[list[list[Decimal]], str]:
        return taylor(graph, inputs.states, x, times, values, wanted)

    solution = _converged(run, times, digits, inputs.states)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        atomic_write(path, json.dumps(_signed(solution)))  # a reader sees all of it or nothing; several may write
    return solution


def _converged(
    run: Callable[[int], tuple[list[list[Decimal]], str]],
    times: Sequence[float],
    digits: int,
    states: Sequence[str],
) -> Reference:
    wanted = max(digits + 2, FEWEST)
    before, _ = run(wanted)
    step = STEP
    while (wanted := wanted + step) <= MOST_DIGITS:
        rows, how = run(wanted)
        with working(FEWEST):
            error, state = max(zip(_differences(before, rows), states, strict=True))
        if error <= 10.0**-digits:
            how = f"{how}; error: its difference from a run with 10^{step} times the tolerance"
            written = digits + SPARE
            error = max(error, 10.0 ** (1 - written))  # the text is rounded
            return from_text(times, [[f"{value:.{written}g}" for value in row] for row in rows], error, how)
        missing = digits + math.log10(error) if error < math.inf else digits
        before, step = rows, max(STEP, math.ceil(missing))
    raise ReferenceFailedError(
        f"{MOST_DIGITS} digits are not enough for {digits} digits at t = {times[-1]:.6g}: the last two runs differ by "
        f"{error:.0e} of the largest value of {state}, so that it is zero but for rounding, or the start does "
        "not decide it, as beyond a configuration where a linkage can go on in two ways"
    )


def _differences(a: list[list[Decimal]], b: list[list[Decimal]]) -> list[float]:
    """Largest difference of each state, relative to its largest value in b."""
    result = []
    for first, second in zip(zip(*a, strict=True), zip(*b, strict=True), strict=True):
        largest = max([abs(value) for value in second])
        difference = max([abs(p - q) for p, q in zip(first, second, strict=True)])
        relative = float(difference / largest) if largest != 0 else float(difference)
        result.append(relative)
    return result


FORMAT = 3  # part of the name: count it up when the method changes so that old solutions are not what would be computed


def key(
    graph: Graph,
    states: Sequence[str],
    start: Sequence[float],
    times: Sequence[float],
    values: Mapping[str, float],
    digits: int,
) -> str:
    """The name of a solution: a hash of the equations by structure, numbers by their bits."""
    numbers = [[float(value).hex() for value in row] for row in (start, times, values.values())]
    content = [FORMAT, cg.structure_hash(graph), list(states), list(values), numbers, digits]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def _signed(solution: Reference) -> dict[str, object]:
    content = {
        "t": [t.hex() for t in solution.t],
        "x": [list(row) for row in solution.decimal],
        "error": solution.error.hex(),
        "how": solution.how,
    }
    return content | {"sum": _sum(content)}


def _sum(content: Mapping[str, object]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _read(path: Path, times: Sequence[float], width: int) -> Reference | None:
    """The solution in a file, or None when there is none or it is not what was written."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.pop("sum") != _sum(content):
            return None
        t = [float.fromhex(text) for text in content["t"]]
        if t != list(times) or {len(row) for row in content["x"]} != {width}:
            return None
        return from_text(t, content["x"], float.fromhex(content["error"]), content["how"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
