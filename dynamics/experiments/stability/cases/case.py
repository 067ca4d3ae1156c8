"""A case: a model, its start, how long it runs, what to watch on the way, and the solution to compare with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cgraph as cg
from cgraph import Graph, Node

from ....equations.equations_of_motion import energy
from ....reference import Reference, reference
from ....systems.model import Model, as_ode, as_system

RTOL = 1e-9  # the relative tolerance that the bounds are for
ATOL = 1e-3 * RTOL  # the absolute one, in the SI unit of each state
SLACK = 1e3  # steps add their errors up, and a tolerance is met to a factor only
DIGITS = 20  # of a reference: four more than float64 can tell

GROWN = "an error made on the way grows as the flow makes a small error of the start grow"

Exact = Callable[[Sequence[float]], Reference]


@dataclass(frozen=True)
class Watch:
    """A quantity of a run and the bound to meet.

    quantity: "error", the deviation from the case's solution at t_end, each state relative to `Case.size`;
        "error 0", "error 0 1", .., the same of those states alone; or the name of an invariant of the case: its largest
        change during the run, relative to `scale`.
    """

    quantity: str
    bound: float
    why: str
    scale: float = 1.0  # the natural size of an invariant, in its unit


@dataclass(frozen=True)
class Case:
    """One row of the stability table.

    start: q and then qd, or the states of an OdeSystem.  size: a natural size of each state; empty for the larger of
    its values at the start and at t_end.
    atol: absolute tolerance, where that of one in a thousand of RTOL in SI units is too much or too little; for all
    states, or for each.
    growth: what the flow makes of a small relative error of the start by t_end (the largest of all states, each
    relative to its size); `sensitivity.growth` measures it. None where there is no solution to compare with.
    invariants(model): a graph over the state (and t, parameters) whose outputs do not change along the motion.
    """

    name: str
    about: str  # one line: what is hard here
    build: Callable[[], Any]  # the model: a System, OdeSystem or Mechanism
    start: tuple[float, ...]
    t_end: float  # s
    watch: tuple[Watch, ...]
    stiff: bool = False  # whether an explicit method needs steps far below what the motion asks for
    size: tuple[float, ...] = ()
    atol: float | tuple[float, ...] = ATOL
    growth: float | None = None
    invariants: Callable[[Any], Graph] | None = None
    exact: Exact | None = None  # a closed form of the motion, or of a limit of it that the watch then names
    method: str | None = None  # of `multiprecision.reference`, where it carries the model to t_end in a minute or so

    def solution(self, times: Sequence[float] | None = None, folder: str | Path | None = None) -> Reference | None:
        """The motion at `times` (default: t_end), from the closed form or else computed; None when there is neither.

        folder: as of `multiprecision.reference`. Raises ImportError without python-flint or mpmath.
        """
        at = [self.t_end] if times is None else [float(t) for t in times]
        if self.exact is not None:
            return self.exact(at)
        if self.method is None:
            return None
        return reference(self.build(), self.start, at, digits=DIGITS, method=self.method, folder=folder)

    def sizes(self, folder: str | Path | None = None) -> tuple[float, ...]:
        """A size for each state: `size`, or the larger of the values at the start and at t_end, or 1 for zeros."""
        if self.size:
            return self.size
        solution = self.solution(folder=folder)
        end = [0.0] * len(self.start) if solution is None else solution.x[-1].tolist()
        return tuple([max(abs(a), abs(b)) or 1.0 for a, b in zip(self.start, end, strict=True)])


def error_watch(growth: float, why: str, quantity: str = "error") -> Watch:
    """The bound of a well-behaved method: local errors of RTOL, grown as the flow grows them."""
    return Watch(quantity, SLACK * RTOL * max(growth, 1.0), why)


def energy_watch(scale: float, why: str = "nothing takes energy in or out") -> Watch:
    """Energy kept to a thousand times the tolerance. scale: the energy that the motion turns over [J]."""
    return Watch("energy", SLACK * RTOL, why, scale)


def conserved(**others: Callable[..., Node]) -> Callable[[Any], Graph]:
    """The energy of a mechanical model, and others: functions of (q, qd) that give a node."""

    def graph(model: Model) -> Graph:
        system = as_system(model)
        found = energy(system)
        outputs = {"energy": found.outputs["E"]}
        outputs |= {name: function(system.q, system.qd) for name, function in others.items()}
        return cg.simplify(Graph(found.inputs, outputs))

    return graph


def conserved_states(**functions: Callable[..., Node]) -> Callable[[Any], Graph]:
    """Functions of the states of an OdeSystem that do not change."""

    def graph(model: Model) -> Graph:
        ode = as_ode(model)
        assert ode is not None
        return Graph([*ode.x, *ode.extra_inputs], {name: function(ode.x) for name, function in functions.items()})

    return graph
