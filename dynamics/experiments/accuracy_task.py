"""AccuracyTask: a scene with its exact motion; and StabilityCase, one hard for arithmetic, with bounds to meet."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, real_array

from ..equations.equations_of_motion import energy
from ..equations.state_equation import state_inputs
from ..multiprecision.reference import Reference, from_text, reference, scale
from ..scenes import Scene
from ..systems.model import Model, as_ode, as_system

INTERVALS = 64  # between the times at which errors are taken
KEPT_ENDS = Path(__file__).parent / "stability" / "solutions.json"  # of the stability cases, by name


@dataclass(frozen=True)
class AccuracyTask(Scene):
    """A scene and its exact motion.  q, qd: of an OdeSystem the states, and nothing.

    size: a natural size of each state, which errors are relative to; empty for the largest values of the motion.
    series: whether `reference` gets to t_end in a minute or so.  digits: of the reference.
    ends: a JSON file of exact ends, some of motions that take longer.
    """

    size: tuple[float, ...] = ()
    stiff: bool = False  # an explicit method needs steps far below what the motion asks for
    series: bool = True
    digits: int = 30
    ends: Path | None = None

    @property
    def start(self) -> tuple[float, ...]:
        """q and then qd, or the states of an OdeSystem."""
        return (*self.q, *self.qd)

    @property
    def identity(self) -> dict[str, Any]:
        """Start and end to the last bit, by which a motion that is kept is known."""
        return {"start": [float(each).hex() for each in self.start], "t": self.t_end.hex()}

    def kept(self, file: Path, key: str) -> dict[str, Any] | None:
        """The entry of this motion in a JSON file of entries; None where there is none, or one of another motion."""
        entry: dict[str, Any] | None = json.loads(file.read_text(encoding="utf-8")).get(key) if file.exists() else None
        return entry if entry is not None and entry.items() >= self.identity.items() else None

    @property
    def times(self) -> list[float]:
        """When errors are taken [s]; the last is t_end, and without a series the only one but 0."""
        if not self.series:
            return [0.0, self.t_end]
        return [self.t_end * k / INTERVALS for k in range(INTERVALS + 1)]

    def solution(
        self, times: Sequence[float] | None = None, folder: str | Path | None = None, digits: int | None = None
    ) -> Reference | None:
        """The motion at `times` (default: t_end): its end where it is kept, else computed; None where neither can be.

        folder: as of `reference`. Raises ImportError without mpmath, and what `reference` raises.
        """
        at = [self.t_end] if times is None else real_array("times", times).ravel().tolist()
        if self.ends is not None and (kept := self.kept(self.ends, self.name)) is not None:
            known = {0.0: [str(Decimal(x)) for x in self.start], self.t_end: kept["x"]}
            if known.keys() >= set(at):
                return from_text(at, [known[t] for t in at], kept["error"], kept["how"])
        if not self.series:
            return None
        asked = self.digits if digits is None else digits
        return reference(self.model, self.q, self.qd or None, at, digits=asked, folder=folder)

    @property
    def mechanical(self) -> bool:
        """Whether the model has coordinates and velocities."""
        return as_ode(self.model) is None

    @property
    def conservative(self) -> bool:
        """Energy stays: no damping, no forces, and nothing that depends on time."""
        if not self.mechanical or state_inputs(self.model).timed:
            return False
        system = as_system(self.model)
        return all(each == 0.0 for each in system.damping) and all(force.value == 0.0 for force in system.forces)

    def sizes(self, solution: Reference | None) -> tuple[float, ...]:
        """A size for each state: `size`, or the larger of the values at the start and at t_end, or 1 for zeros."""
        if self.size:
            return self.size
        end = [0.0] * len(self.start) if solution is None else solution.x[-1].tolist()
        return tuple([max(abs(a), abs(b)) or 1.0 for a, b in zip(self.start, end, strict=True)])

    def scales(self, exact: Reference) -> Array:
        """Scale of the errors at all times, (T, m)."""
        return np.broadcast_to(self.size or scale(exact.x), exact.x.shape)


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
    """One row of the stability table; `about` says what is hard here.

    atol: absolute tolerance, for all states or for each; default a thousandth of RTOL in SI units.
    growth: the largest relative change by t_end for a small relative change of the start; None without a solution.
    invariants(model): a graph over the state (and t, parameters) whose outputs do not change along the motion; by
    default the energy, where there is a criterion of it.
    """

    digits: int = 20  # four more than float64 can tell
    ends: Path | None = KEPT_ENDS
    criteria: tuple[Criterion, ...] = ()
    atol: float | tuple[float, ...] = ATOL
    growth: float | None = None
    invariants: Callable[[Model], Graph] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.growth is not None and not any([each.quantity.startswith("error") for each in self.criteria]):
            object.__setattr__(self, "criteria", (*self.criteria, error_criterion(self.growth)))
        if self.invariants is None and any([each.quantity == "energy" for each in self.criteria]):
            object.__setattr__(self, "invariants", conserved())


def case(
    name: str, about: str, model: Model, start: tuple[float, ...], t_end: float, *criteria: Criterion, **more: Any
) -> StabilityCase:
    """A case from its states, q and then qd, or those of an OdeSystem.  more: the fields that go on from there."""
    nq = len(model.coordinates)
    return StabilityCase(name, about, model, start[:nq], start[nq:], t_end, criteria=criteria, **more)


def error_criterion(growth: float, why: str = GROWN) -> Criterion:
    """The bound of a well-behaved method: local errors of RTOL, grown as the flow grows them."""
    return Criterion("error", SLACK * RTOL * max(growth, 1.0), why)


def energy_criterion(scale: float, why: str = "nothing takes energy in or out") -> Criterion:
    """Energy kept to a thousand times the tolerance. scale: the energy that the motion turns over [J]."""
    return Criterion("energy", SLACK * RTOL, why, scale)


def conserved(**functions: Callable[..., Node]) -> Callable[[Model], Graph]:
    """Functions of the state of an OdeSystem, or of (q, qd) of a mechanical model, whose energy goes with them."""

    def graph(model: Model) -> Graph:
        if (ode := as_ode(model)) is not None:
            return Graph([*ode.x, *ode.extra_inputs], {name: function(ode.x) for name, function in functions.items()})
        system = as_system(model)
        of_energy = energy(system)
        others = {name: function(system.q, system.qd) for name, function in functions.items()}
        return cg.simplify(Graph(of_energy.inputs, {"energy": of_energy.outputs["E"]} | others))

    return graph
