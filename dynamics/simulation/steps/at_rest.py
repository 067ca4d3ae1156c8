"""At rest: the tolerance of velocities that are rounding alone, as statements of a program, see `first_step`."""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Call, Map, Statement

from ..estimates.state_sizes import StateKinds

STILL = 2.0**-54  # of a coordinate, a quarter of its last digit: a step that moves it by less does not move it


def at_rest_registers(kinds: StateKinds) -> dict[str, int]:
    """Registers of the statements; `rest.atol` is 0 when a run begins."""
    m = len(kinds.moved)
    return {"rest.moved": m, "rest.atol": m, "rest.mean": 1} if any(kinds.moved) else {}


def at_rest(kinds: StateKinds) -> list[Statement]:
    """Raise `start.tolerance` of velocities that, in a mean step of the run so far, do not move any coordinate.

    Of a body that rests in contact, velocities are what the rounding of large forces leaves, and no accuracy can be
    asked of them: steps by their sizes would have to be ever shorter. A velocity that is off by rtol times the
    coordinate over the length of the run moves it by no more than its tolerance.
    """
    if not any(kinds.moved):
        return []
    t, t0, trials = cg.variables("t t0 trials")
    atol, kind, mean, moved, relative, length, tolerance = cg.variables(
        "atol kind mean moved relative length tolerance"
    )
    still = (kind > 0.0) * (mean > 0.0) * (kind * mean <= STILL * moved)
    raised = cg.maximum(atol, cg.where(still, relative * moved / length, 0.0))
    states = ("rest.atol", "start.kind", "rest.mean", "rest.moved", "start.relative", "start.length")
    return [
        Call(kinds.coordinate, ("start.size",), ("rest.moved",)),
        Call(Graph([t, t0, trials], {"mean": abs(t - t0) / trials}), ("t", "start.t0", "trials"), ("rest.mean",)),
        Map(Graph([atol, kind, mean, moved, relative, length], {"atol": raised}), states, ("rest.atol",)),
        Map(
            Graph([tolerance, atol], {"tolerance": cg.maximum(tolerance, atol)}),
            ("start.tolerance", "rest.atol"),
            ("start.tolerance",),
        ),
    ]
