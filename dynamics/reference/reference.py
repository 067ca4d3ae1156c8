"""Reference solutions of any model: two runs of different order and precision, whose difference is the stated error."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..equations.state_equation import state_equation, state_inputs
from ..systems.model import Model
from ..systems.system import parameter_value, per_coordinate
from .collocation import collocation
from .disk_store import Store, key
from .flint_numbers import Number, text
from .solution import Reference, from_text
from .taylor_integrator import ReferenceFailedError, taylor

METHODS: dict[str, Callable[..., tuple[list[list[Number]], str]]] = {"taylor": taylor, "radau": collocation}
FEWEST, STEP, MOST = 8, 6, 400  # digits of the tolerance: the least at first, more in each run, and where it ends
# Digits of the first run. Collocation has at the ends of steps about twice the digits that it has within.
FIRST: dict[str, Callable[[int], int]] = {"taylor": lambda digits: digits + 2, "radau": lambda digits: digits // 2 + 4}
SPARE = 6  # digits written beyond those asked for


def reference(
    model: Model,
    start: ArrayLike,
    times: Sequence[float] | ArrayLike,
    parameters: Mapping[str, float] | None = None,
    digits: int = 30,
    *,
    method: str = "taylor",
    tau: float | Sequence[float] = 0.0,
    folder: str | Path | None = None,
) -> Reference:
    """The motion of a model from `start` at t = 0, to so many digits at `times`.

    start: (m,), q and then qd, or the states of an OdeSystem.  times: increasing, from 0 on [s].
    parameters: values in place of the model's own.  tau: constant applied force, for all coordinates or for each.
    method: "taylor", Taylor series, whose steps end where a piecewise operation switches; "radau", implicit
        collocation, for what is stiff and smooth.
    folder: where solutions are kept and found again; one that cannot be read is computed anew.

    The error stated is the difference between the solution and another run with fewer digits, another order and other
    steps, so it is that of the worse one. Digits are added until it is at most 10^-digits. The problem solved is the
    graph as it stands, with its constants and the start taken as exact.

    Raises ValueError for arguments out of range, ReferenceFailedError at a singularity or when 400 digits are not
    enough, ImportError without python-flint.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    if not (isinstance(digits, int) and 1 <= digits <= MOST // 2):
        raise ValueError(f"digits must be a whole number from 1 to {MOST // 2}, got {digits!r}")
    inputs = state_inputs(model)
    x0, at = _row("start", start), _row("times", times)
    if len(x0) != len(inputs.states):
        raise ValueError(f"start must have {len(inputs.states)} values ({', '.join(inputs.states[:8])}), got {len(x0)}")
    if not at or at[0] < 0.0 or any(a >= b for a, b in itertools.pairwise(at)):
        raise ValueError("times must be increasing, from 0 s on, and at least one")
    if unknown := [name for name in parameters or {} if name not in inputs.parameters]:
        raise ValueError(f"the model has no parameter {unknown[0]!r} (it has {', '.join(inputs.parameters) or 'none'})")
    given = inputs.parameters | {name: parameter_value(name, value) for name, value in (parameters or {}).items()}
    if inputs.applied:
        given |= dict(zip(inputs.applied, per_coordinate("tau", tau, model.coordinates), strict=True))
    graph = state_equation(model)

    def solve() -> Reference:
        return _converged(
            lambda d: METHODS[method](graph, inputs.states, x0, at, given, d), at, digits, FIRST[method](digits)
        )

    if folder is None:
        return solve()
    return Store(Path(folder)).get(key(graph, inputs.states, x0, at, given, method, digits), at, len(x0), solve)


def _row(what: str, values: Any) -> list[float]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or not np.isfinite(array).all():
        raise ValueError(f"{what} must be a sequence of finite numbers, got {values!r:.60}")
    row: list[float] = array.tolist()
    return row


def _converged(
    run: Callable[[int], tuple[list[list[Number]], str]], times: Sequence[float], digits: int, first: int
) -> Reference:
    wanted = max(first, FEWEST)
    before, _ = run(wanted)
    step = STEP
    while (wanted := wanted + step) <= MOST:
        rows, how = run(wanted)
        error = _difference(before, rows)
        if error <= 10.0**-digits:
            how = f"{how}; error: its difference from a run with 10^{step} times the tolerance"
            written = digits + SPARE
            error = max(error, 10.0 ** (1 - written))  # the text is rounded
            return from_text(times, [[text(each, written) for each in row] for row in rows], error, how)
        lost = digits + math.log10(error) if error < math.inf else digits
        before, step = rows, max(STEP, math.ceil(lost))
    raise ReferenceFailedError(f"{MOST} digits are not enough for {digits} digits at t = {times[-1]:.6g}")


def _difference(a: list[list[Number]], b: list[list[Number]]) -> float:
    """The largest difference, relative to the largest value of the same state in b."""
    worst = 0.0
    for first, second in zip(zip(*a, strict=True), zip(*b, strict=True), strict=True):
        largest = max([abs(each) for each in second])
        difference = max([abs(p - q) for p, q in zip(first, second, strict=True)])
        relative = float(difference / largest) if largest != 0 else float(difference)
        worst = max(worst, relative) if relative == relative else math.inf
    return worst
