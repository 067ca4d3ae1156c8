"""A case: a task that is hard for arithmetic or for an integrator, what to measure on the way, and bounds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cgraph as cg
from cgraph import Graph, Node

from ....equations.energies import energy
from ....systems.model import Model, as_ode, as_system
from ...accuracy_task import AccuracyTask

RTOL = 1e-9  # the relative tolerance that the bounds are for
ATOL = 1e-3 * RTOL  # the absolute one, in the SI unit of each state
SLACK = 1e3  # steps add their errors up, and a tolerance is met to a factor only

GROWN = "an error made on the way grows as the flow makes a small error of the start grow"


@dataclass(frozen=True)
class Criterion:
    """A quantity of a run and the bound to meet.

    quantity: "error", the deviation from the case's solution at t_end, each state relative to `StabilityCase.size`;
        "error 0", "error 0 1", .., the same of those states alone; or the name of an invariant of the case: its largest
        change during the run, relative to `scale`.
    """

    quantity: str
    bound: float
    why: str
    scale: float = 1.0  # the natural size of an invariant, in its unit


@dataclass(frozen=True)
class StabilityCase(AccuracyTask):
    """One row of the stability table; `about` says what is hard here. `exact` may be of a limit of the motion.

    atol: absolute tolerance, where that of one in a thousand of RTOL in SI units is too much or too little; for all
    states, or for each.
    growth: what the flow makes of a small relative error of the start by t_end (the largest of all states, each
    relative to its size); the tests measure it. None where there is no solution to compare with. Where no criterion is
    of the error, `error_criterion(growth)` is the last.
    invariants(model): a graph over the state (and t, parameters) whose outputs do not change along the motion.
    """

    digits: int = 20  # four more than float64 can tell
    criteria: tuple[Criterion, ...] = ()
    atol: float | tuple[float, ...] = ATOL
    growth: float | None = None
    invariants: Callable[[Model], Graph] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.growth is not None and not any([each.quantity.startswith("error") for each in self.criteria]):
            object.__setattr__(self, "criteria", (*self.criteria, error_criterion(self.growth)))


def error_criterion(growth: float, why: str = GROWN, quantity: str = "error") -> Criterion:
    """The bound of a well-behaved method: local errors of RTOL, grown as the flow grows them."""
    return Criterion(quantity, SLACK * RTOL * max(growth, 1.0), why)


def energy_criterion(scale: float, why: str = "nothing takes energy in or out") -> Criterion:
    """Energy kept to a thousand times the tolerance. scale: the energy that the motion turns over [J]."""
    return Criterion("energy", SLACK * RTOL, why, scale)


def conserved(**others: Callable[..., Node]) -> Callable[[Model], Graph]:
    """The energy of a mechanical model, and others: functions of (q, qd) that give a node."""

    def graph(model: Model) -> Graph:
        system = as_system(model)
        of_energy = energy(system)
        outputs = {"energy": of_energy.outputs["E"]}
        outputs |= {name: function(system.q, system.qd) for name, function in others.items()}
        return cg.simplify(Graph(of_energy.inputs, outputs))

    return graph


def conserved_states(**functions: Callable[..., Node]) -> Callable[[Model], Graph]:
    """Functions of the states of an OdeSystem that do not change."""

    def graph(model: Model) -> Graph:
        ode = as_ode(model)
        assert ode is not None
        return Graph([*ode.x, *ode.extra_inputs], {name: function(ode.x) for name, function in functions.items()})

    return graph
