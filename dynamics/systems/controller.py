"""Controllers in closed form: a system with the forces of a function of its state, as nodes, added to its forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import is_function, memo, or_nearest
from cgraph.extend import topological

from .arguments import Parameters, parameters_of
from .model import Equations, Model, as_equations
from .system import System, generalized_forces

SYSTEMS_KEPT = 16  # systems that stay for another run


Controlled = tuple[System, tuple[Node, ...]]  # a system with a controller, and the controller's forces alone, n nodes


def with_controller(
    model: Model, controller: Callable[..., Sequence[Node | float]], parameters: Mapping[str, float] | None = None
) -> System:
    """The system with a controller in closed form: its forces act beside those of the model.

    It is a system like any other: its state equation, Jacobian and C code contain the controller. `simulate(tau=...)`
    takes the function itself.

    Parameters
    ----------
    model : System, Mechanism or Scene
        What is controlled.
    controller : callable
        (q, qd, t) or (q, qd, t, p) to one generalized force for each velocity, node or number [N m or N]. It is called
        once, with q (nq) and qd (n) as lists of nodes, t a node, p {parameter name: node}.
    parameters : mapping of str to float, optional
        Parameters of the controller, such as gains, beside the model's own; each is an input of the graphs.

    Returns
    -------
    System
        With the model's coordinates, Lagrangian, damping and parameters.

    Raises
    ------
    TypeError, ValueError
        For what is no such function, for another number of forces, and for parameters that the controller does not use.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> held = dyn.with_controller(arm, lambda q, qd, t, p: [p["kp"] * (0.5 - q[0]) - 3.0 * qd[0]], {"kp": 20.0})
    >>> held
    <System of 1 coordinate(s) joint 1, parameters kp>
    >>> A, B = dyn.linearize(held, [0.2], [0.0])  # of the closed loop
    >>> A.round(3).tolist()
    [[0.0, 1.0], [-74.422, -9.0]]
    """
    return controlled(as_equations(model), controller, parameters)[0]


def controlled(
    model: Equations,
    controller: Callable[..., Sequence[Node | float]],
    parameters: Mapping[str, float] | None = None,
) -> Controlled:
    """Result of `with_controller`. For a controller with the same graph as one of the last few, the same nodes."""
    system = model.system
    if system is None:
        raise TypeError("a controller gives forces, and none act on a system of first order: write it into the rate")
    gains = parameters_of(parameters)
    if shared := [name for name in gains if name in system.parameters]:
        raise ValueError(f"{shared[0]!r} is a parameter of the model; choose another name for that of the controller")
    names = (*system.parameters, *gains)
    p = Parameters(names)
    with cg.tag("controller"):
        forces = generalized_forces("the controller", controller, system, p)
    system.require_known("the controller", forces, p)
    used = {node.name for node in topological(forces)}
    if unused := [name for name in gains if name not in used]:
        known = or_nearest(unused[0], list(system.parameters))
        raise ValueError(f"neither the system nor the controller has a parameter {unused[0]!r}; of the system, {known}")
    graph = Graph([*system.q, *system.qd, system.t, *p.values()], {f"force{k}": node for k, node in enumerate(forces)})
    return _controlled(_Request(system, cg.structure_hash(graph), tuple(gains.items()), tuple(forces)))


@dataclass(frozen=True)
class _Request:
    system: System
    structure: str
    gains: tuple[tuple[str, float], ...]
    forces: tuple[Node, ...] = field(compare=False)


@memo(SYSTEMS_KEPT)
def _controlled(request: _Request) -> Controlled:
    system, forces = request.system, request.forces
    pairs = zip(system.forces, forces, strict=True)
    both = tuple([more if own.value == 0.0 else own + more for own, more in pairs])
    return system.changed(parameters=system.parameters | dict(request.gains), forces=both), forces


def with_closed_form(model: Equations, tau: Any, parameters: object) -> tuple[Equations, Any, Sequence[Node] | None]:
    """Moving system, the constant force on it, and the whole applied force as nodes; of a first-order model None.

    tau: a controller in closed form, or the constant force.  parameters: of the run, {name: value}; those that the
    model does not have are the controller's.
    """
    if not is_function(tau):
        return model, tau, None if model.system is None else model.system.tau
    given = parameters if isinstance(parameters, Mapping) else {}
    closed, forces = controlled(model, tau, {name: 0.0 for name in given if name not in model.parameters})
    return closed, 0.0, forces
