"""Applied: the force tau of a run, constant, by a controller in closed form, or held by one over periods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import kept_by_first

from ..equations.state_equation import state_inputs
from ..integrators import Problem, quantity_inputs
from ..systems.controller import with_closed_form
from ..systems.model import Equations, Model, as_equations
from .run_options import RunOptions
from .sampled_controller import Hold, SampledController

Constant: TypeAlias = float | Sequence[float]
Tau: TypeAlias = Constant | Callable[..., Sequence[Node | float]] | SampledController


@dataclass(frozen=True)
class Applied:
    """The applied force of a run of a model, which has the forces of a controller in closed form.

    constant: force besides.  nodes: tau, of the state, t, tau0, .. and parameters; None of a first-order system.
    controller: a sampled one.
    """

    model: Equations
    constant: Any
    nodes: Sequence[Node] | None
    controller: SampledController | None = None

    def bound(self, numbers: Mapping[str, float]) -> dict[str, float]:
        """The inputs of the state equation that are built into a run; of a sampled controller without tau0, .."""
        varied = () if self.controller is None else state_inputs(self.model).applied
        return {name: value for name, value in numbers.items() if name not in varied}

    def hold(self, options: RunOptions, problem: Problem) -> Hold | None:
        """The forces that a sampled controller is to hold along steps of a problem.

        Raises ValueError for a run that it cannot control.
        """
        if self.controller is None:
            return None
        if options.scipy_solver is not None:
            raise ValueError(f"method {options.method!r} does not end its steps with periods: take one of dyn.METHODS")
        if options.direction < 0.0:
            raise ValueError("a SampledController holds what it has seen, so that t_end has to be later than t0")
        observed = None if problem.velocities is None else _compiled(problem.velocities, options.backend)
        return Hold(self.controller, self.model.velocities, problem.nq, options.t0, observed)

    def graph(self, problem: Problem) -> Graph:
        """tau as a graph over the states, t and parameters of a problem of the model."""
        assert self.nodes is not None
        outputs = {f"tau{k}": node for k, node in enumerate(self.nodes)}
        return problem.bind(problem.states, Graph(quantity_inputs(problem), outputs))


@kept_by_first
def _compiled(velocities: Graph, backend: str) -> cg.Compiled:
    """The velocities of momenta, for a controller."""
    return cg.compile(velocities, backend)


def with_applied(model: Model, tau: Any, parameters: Mapping[str, Any] | None) -> tuple[Equations, Applied]:
    """The system that moves, with a controller in closed form, and what is applied to it.

    parameters: of the run; those that the model does not have are the controller's.
    """
    moving = as_equations(model)
    if isinstance(tau, SampledController):
        if moving.system is None:
            raise TypeError("a controller gives forces, and none act on a system of first order")
        return moving, Applied(moving, 0.0, moving.system.tau, tau)
    moving, constant, forces = with_closed_form(moving, tau, parameters)
    return moving, Applied(moving, constant, forces)
