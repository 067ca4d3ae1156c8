"""Applied forces of runs: numbers, a controller in closed form, or one that is sampled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from cgraph import Node
from cgraph._shared import or_nearest

from ..systems.controller import with_closed_form
from ..systems.model import Equations, Model, as_equations
from .sampled_controller import SampledController

Constant: TypeAlias = float | Sequence[float]
Tau: TypeAlias = Constant | Callable[..., Sequence[Node | float]] | SampledController


class Applied(NamedTuple):
    """A model with the forces of a controller in closed form, and what is applied to it besides.

    constant: numbers.  nodes: tau, of the state, t, tau0, .. and parameters; None of a first-order system.
    controller: a sampled one.
    """

    model: Equations
    constant: Any
    nodes: Sequence[Node] | None
    controller: SampledController | None = None


def with_applied(model: Model, tau: Any, parameters: Mapping[str, Any] | None) -> Applied:
    """The system that moves and its applied force.

    parameters: of the run; those that the model does not have are the controller's.
    """
    moving = as_equations(model)
    if isinstance(tau, SampledController):
        if moving.system is None:
            raise TypeError("a controller gives forces, and none act on a system of first order")
        return Applied(moving, 0.0, moving.system.tau, tau)
    return Applied(*with_closed_form(moving, tau, parameters))


def check_varied(model: Equations, tau: Tau, varied: Sequence[str]) -> None:
    """Raise for parameters that cannot be varied. Those of a controller that is a function are what a run gives it."""
    if varied and isinstance(tau, SampledController):
        raise ValueError(f"varied = {varied} cannot be with a SampledController, which holds its forces")
    if unknown := [name for name in varied if name not in model.parameters and not callable(tau)]:
        known = or_nearest(unknown[0], list(model.parameters))
        raise ValueError(f"varied: the system has no parameter {unknown[0]!r:.80}; {known}")
