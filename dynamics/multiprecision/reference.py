"""Reference solutions of any model: two unlike runs, whose difference is the error; kept in a folder."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

from numpy.typing import ArrayLike

from cgraph import Graph, Node
from cgraph._shared import atomic_write, require_path

from ..equations.state_equation import state_equation, state_inputs
from ..equations.states.initial_value import other_inputs, start_state, times_to_record
from ..systems.controller import with_closed_form
from ..systems.model import Model, as_equations
from .decimal_numbers import working
from .solution import Reference, from_text
from .taylor_integrator import ReferenceFailedError, taylor

FEWEST, STEP, MOST_DIGITS = 8, 6, 400  # digits of the tolerance: at least, more in each run, and at most
SPARE = 6  # digits written beyond those asked for


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


FORMAT = 2  # part of the name: count it up when the method changes so that old solutions are not what would be computed


def key(
    graph: Graph,
    states: Sequence[str],
    start: Sequence[float],
    times: Sequence[float],
    values: Mapping[str, float],
    digits: int,
) -> str:
    """The name of a solution: a hash of the equations by structure, numbers by their bits."""
    number = {node: i for i, node in enumerate(graph.nodes)}
    nodes = [
        (
            node.op.name,
            [number[arg] for arg in node.args],
            None if node.value is None else node.value.hex(),
            node.name if node.op.name == "variable" else None,
        )
        for node in graph.nodes
    ]
    rates = [number[node] for node in graph.outputs.values()]
    numbers = [[float(value).hex() for value in row] for row in (start, times, values.values())]
    content = [FORMAT, nodes, rates, list(states), list(values), numbers, digits]
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
