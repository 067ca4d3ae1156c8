"""Peers and what they are asked: a model with the states of each task, and a task made ready to be timed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, required as extra_module
from cgraph.extend import topological
from dynamics.equations.state_equation import normalization
from dynamics.integrators.tableau import RK4
from dynamics.multibody.trees.mechanism import Mechanism, as_mechanism
from dynamics.systems.arguments import TIME
from dynamics.systems.model import Model, as_system
from dynamics.systems.system import System
from dynamics.verification.residual import UnavailableError

# Each task takes one vector, the blocks end to end. Derivatives are n rows of 3 n columns; those by q are by
# displacements where velocities are no rates of coordinates.
TASKS = {
    "inverse": "inverse dynamics, (q, qd, qdd) -> tau",
    "forward": "forward dynamics, (q, qd, tau) -> qdd",
    "rk4": "one RK4 step, (q, qd) -> (q, qd) after dt, tau = 0",
    "inverse-derivatives": "derivatives of inverse dynamics, (q, qd, qdd) -> dtau/dq, dtau/dqd, M",
    "derivatives": "derivatives of forward dynamics, (q, qd, tau) -> dqdd/dq, dqdd/dqd, M^-1",
    "motion": "1000 RK4 steps, (q, qd, tau of every step) -> (q, qd)",
    "gradient": "gradient of |q|^2 after them, (q, qd, tau of every step) -> its slopes by all of these",
    "inertial-gradient": "the same, and its slopes by ten inertial numbers of every body",
}
MOTIONS = ("motion", "gradient", "inertial-gradient")  # of models whose velocities are rates of coordinates
DERIVATIVES = {"inverse-derivatives": "inverse", "derivatives": "forward"}  # and what they are of
BATCH = 4096  # states
PASSES = 1000  # of a native loop, and steps of a motion
DT = 1e-5  # s, the step of RK4: short, so that a thousand of them do not magnify rounding
NUDGE = 1e-8  # how far a pass moves each block of its input along its result


class PeerModel:
    """A model, its system with its parameters bound, and what goes into each task.

    Raises ValueError for a system that depends on time.
    """

    def __init__(self, name: str, model: Model) -> None:
        mechanism = as_mechanism(model)
        self.name, self.model = name, mechanism.bind() if mechanism else model
        self.system: System = as_system(self.model)
        self.nq, self.n = self.system.nq, self.system.n
        if TIME in [str(node.name) for node in self.system.extra_inputs]:
            raise ValueError(f"{name} depends on time, and the bench compares systems that do not")

    @property
    def bodies(self) -> Mechanism:
        """The bodies of the model. Raises UnavailableError for a bare Lagrangian."""
        mechanism = as_mechanism(self.model)
        if mechanism is None:
            raise UnavailableError("takes rigid bodies, not a Lagrangian")
        return mechanism

    def bound(self, graph: Graph) -> Graph:
        """The graph with its parameters at the system's values."""
        return cg.specialize(graph, dict(self.system.parameters)) if self.system.parameters else graph

    @cached_property
    def order(self) -> list[Node]:
        """The nodes of the Lagrangian and the applied forces, arguments first."""
        return topological([self.system.lagrangian, *self.system.forces])

    def point(self, task: str) -> Array:
        """The input of one call."""
        return self._normalized(np.random.default_rng(0).normal(size=(self.width(task), 1)))[:, 0]

    def points(self, task: str) -> Array:
        """The inputs of a batch, (n_in, BATCH)."""
        return self._normalized(np.random.default_rng(1).normal(size=(self.width(task), BATCH)))

    def inputs(self, task: str, mode: str) -> Array:
        """The inputs of a mode: of a batch its points, else one point."""
        return self.points(task) if mode == "batch" else self.point(task)

    def _normalized(self, x: Array) -> Array:
        graph = normalization(self.model)
        if graph is not None:
            x[: self.nq + self.n] = cg.compile(graph, backend="numpy").batch(x[: self.nq + self.n])
        return x

    def width(self, task: str) -> int:
        """Number of inputs of a task."""
        return self.nq + {"rk4": 1, **dict.fromkeys(MOTIONS, PASSES + 1)}.get(task, 2) * self.n

    def nudges(self, task: str) -> NDArray[np.intp]:
        """Index of the result that moves each input from one pass of a loop to the next."""
        return np.arange(self.width(task)) % self.n


AnyState = TypeVar("AnyState")
Made = TypeVar("Made")


def rk4_step(rate: Callable[[AnyState], AnyState], x: AnyState, dt: float = DT) -> AnyState:
    """The state after one RK4 step of dt [s] from x, where xdot = rate(x); x: anything with sums and multiples."""
    slopes: list[Any] = []
    for weights in (*RK4.a, RK4.b):
        at = x
        for weight, slope in zip(weights, slopes, strict=True):
            if weight:
                at = at + (dt * weight) * slope
        if len(slopes) < len(RK4.b):
            slopes.append(rate(at))
    return at


# How a task is asked for.
MODES = {
    "call": "a call from Python: the call alone, its arguments and its result in the peer's own memory",
    "loop": "an evaluation in a native loop of 1000, each pass on the result of the one before",
    "batch": "a state of a batch of 4096, one core",
}


EVALUATIONS = {"call": 1, "loop": PASSES, "batch": BATCH}  # of the task, in one run


def required(module: str, name: str) -> ModuleType:
    """The module of a package. Raises ImportError naming the extra when it is not installed."""
    return extra_module(module, f"{name} is not installed", "bench")


def made(
    makers: Mapping[str, Callable[[], Made]], absent: dict[str, str], *refusals: type[Exception]
) -> dict[str, Made]:
    """What can be made, by name; to `absent` goes why the others cannot: not installed, or not for this model.

    refusals: other errors by which a maker says so.
    """
    ready = {}
    errors: tuple[type[Exception], ...] = (ImportError, UnavailableError, *refusals)
    for name, make in makers.items():
        try:
            ready[name] = make()
        except errors as error:
            absent[name] = " ".join(str(error).split())[:200]
    return ready


@dataclass(frozen=True)
class TimedTask:
    """A way to do a task.

    run: what is timed, `EVALUATIONS` of the task.  result: what `run` gave -> the values in the order of the task's
    graph: (n_out,) of a call, (n_out, BATCH) of a batch, the carry after the last pass of a loop.
    size: instructions or nodes of one evaluation, where they can be counted.
    """

    run: Callable[[], object]
    result: Callable[[Any], Array]
    size: int | None = None


class Peer(ABC):
    """One piece of software on one case. Making it raises ImportError when the software is not installed."""

    def __init__(self, case: PeerModel) -> None:
        self.case = case

    @abstractmethod
    def prepare(self, task: str, mode: str) -> TimedTask:
        """The task in a mode, compiled. Raises UnavailableError."""
