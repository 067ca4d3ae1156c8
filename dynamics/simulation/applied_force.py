"""Applied forces of runs: numbers, a controller in closed form, or a sampled one, and what it has held in a run."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array, HoldsNodes, is_function, real_array, real_number

from ..systems.controller import with_closed_form
from ..systems.model import Equations, Model, as_equations
from .steps.equal_steps import SAME_INSTANT


@dataclass(frozen=True)
class SampledController(HoldsNodes):
    """A controller as a computer runs it: called at the start of every period, its forces held until the next.

    Steps end where periods do. A reset by an event leaves the forces and the periods as they are. The function may
    remember what it has seen: it is called once a period, in the order of time. What it raises ends the run, with the
    time as a note. The error of equal steps is not estimated: run again with half of dt and compare.

    Parameters
    ----------
    function : callable
        (q, qd, t) to the force for each velocity, (n,) [N m or N]; q (nq,) and qd (n,) are arrays [rad or m, per
        second], t a number [s].
    period : float
        Of control [s].

    Raises
    ------
    TypeError, ValueError
        For what is no function, and for a period that is not positive and finite.

    Examples
    --------
    >>> import dynamics as dyn
    >>> hold = dyn.SampledController(lambda q, qd, t: 30.0 * (0.5 - q) - 6.0 * qd, period=0.01)
    >>> run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.0], [0.0], t_end=2.0, tau=hold, t_eval=[0.0, 1.0, 2.0])
    >>> run.q[:, 0].round(3).tolist(), run.tau[:, 0].round(3).tolist()
    ([0.0, 0.432, 0.432], [15.0, 2.054, 2.052])
    """

    function: Callable[[Array, Array, float], ArrayLike]
    period: float

    def __post_init__(self) -> None:
        if not is_function(self.function):
            raise TypeError(f"a controller must be a function of (q, qd, t), got {self.function!r:.60}")
        if not 0.0 < real_number("period", self.period) < math.inf:
            raise ValueError(f"the period of a controller must be positive and finite, got {self.period!r} s")


class HeldForces(NamedTuple):
    """Forces that a SampledController gave in a run, a row for each period.

    Parameters
    ----------
    t : ndarray
        The starts of the periods, (k,) [s].
    tau : ndarray
        The forces held from there on, (k, n) [N m or N].

    Examples
    --------
    >>> import dynamics as dyn
    >>> hold = dyn.SampledController(lambda q, qd, t: -q, period=0.25)
    >>> dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.5], [0.0], t_end=1.0, tau=hold).held.t
    array([0.  , 0.25, 0.5 , 0.75])
    """

    t: Array
    tau: Array

    def at(self, t: ArrayLike) -> Array:
        """The forces at times (T,), (T, n); at the end of a period those of the next, NaN before the first."""
        times = real_array("t", t)
        none = np.full((1, self.tau.shape[1]), np.nan)
        return np.asarray(np.concatenate([none, self.tau])[np.searchsorted(self.t, times + _rounding(times), "right")])


Constant: TypeAlias = float | Sequence[float]
Tau: TypeAlias = Constant | Callable[..., Sequence[Node | float]] | SampledController


class Applied(NamedTuple):
    """A model with the forces of a controller in closed form, and what is applied to it besides."""

    model: Equations
    constant: Any  # numbers
    nodes: Sequence[Node] | None  # tau, of the state, t, tau0, .. and parameters; None of a first-order system
    controller: SampledController | None = None


def with_applied(model: Model, tau: Any, parameters: Mapping[str, Any] | None) -> Applied:
    """The system that moves and its applied force; parameters that the model does not have are the controller's."""
    moving = as_equations(model)
    if isinstance(tau, SampledController):
        if moving.system is None:
            raise TypeError("a controller gives forces, and none act on a system of first order")
        return Applied(moving, 0.0, moving.system.tau, tau)
    return Applied(*with_closed_form(moving, tau, parameters))


@dataclass(eq=False)
class Hold:
    """The forces of a controller along a run; observed: qd of a state (q, p), t and forces, where states have p."""

    controller: SampledController
    velocities: Sequence[str]
    nq: int
    t0: float
    observed: Callable[[Array], Array] | None = None
    times: list[float] = field(default_factory=list)
    forces: list[list[float]] = field(default_factory=list)

    def at(self, t: float, x: Array) -> list[float]:
        """The forces from t on, (n,); x: the state, (m,)."""
        if t >= self.t0 + len(self.times) * self.controller.period - _rounding(t):
            self.forces.append(self._called(t, x))
            self.times.append(t)
        return self.forces[-1]

    def ends(self, t: float, t_end: float) -> Iterator[float]:
        """The ends of periods from t on, without those at t and t_end but for rounding; then t_end."""
        for number in itertools.count(max(0, math.floor((t - self.t0) / self.controller.period) - 1)):
            end = self.t0 + number * self.controller.period
            if end >= t_end - _rounding(t_end):
                break
            if end > t + _rounding(t):
                yield end
        yield t_end

    def instants(self, instants: Sequence[float]) -> list[float]:
        """The instants that equal steps have to meet, with the ends of periods between them."""
        return [instants[0], *[end for pair in itertools.pairwise(instants) for end in self.ends(*pair)]]

    @property
    def held(self) -> HeldForces:
        """The forces so far."""
        return HeldForces(np.array(self.times), np.array(self.forces).reshape(-1, len(self.velocities)))

    def _called(self, t: float, x: Array) -> list[float]:
        names, qd, what = self.velocities, x[self.nq :], "the controller's forces"
        try:
            if self.observed is not None:
                qd = self.observed(np.concatenate([x, [t], np.zeros(len(qd))]))  # they do not depend on the forces
            with np.errstate(all="warn"):
                forces = real_array(what, self.controller.function(x[: self.nq].copy(), qd.copy(), t))
            if forces.shape != (len(names),):
                needed = f"({len(names)},), one for each of {', '.join(names)}"
                raise ValueError(f"{what} must have shape {needed}; got {forces.shape}")
            if not (good := np.isfinite(forces)).all():
                name = names[int(np.argmin(good))]
                raise ValueError(f"{what} must be finite, got {forces.tolist()}: that of {name!r}")
        except Exception as error:
            error.add_note(f"in the controller at t = {t:.6g} s")
            raise
        return list(forces.tolist())


def _rounding(t: float | Array) -> float | Array:
    """Largest difference of two times that are meant to be the same [s]."""
    return SAME_INSTANT * np.spacing(np.abs(t))
