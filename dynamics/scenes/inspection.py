"""What there is to inspect in a scene: its equations as graphs, their inputs along its motion, its joints' places."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from cgraph import Graph, Node
from cgraph.extend import real_number

from ..equations.equations_of_motion import forward_dynamics
from ..equations.formulations import inverse_dynamics, spurious_nodes
from ..multibody.display_units import display_units
from ..multibody.joint_positions import Skeleton, skeleton
from ..simulation.simulate import simulate
from ..simulation.trajectory import Trajectory
from ..systems.system import System
from .scenes import Scene

Array = np.ndarray[Any, np.dtype[np.float64]]
FORMULATIONS = ("euler_embedded", "kinetic_only", "chain_rule")  # those of the paper, the flawed ones first
FRAMES, RATE = 150, 30.0  # most instants shown, and how many a second
DT = 1e-3  # s, the step that the embedded formulations take


class Equations(NamedTuple):
    """A graph of the equations.  about: what to see.  marked: spurious nodes.  at: {input: (T,) or a number}."""

    name: str
    graph: Graph
    about: str
    marked: frozenset[Node]
    at: Mapping[str, Any]


@dataclass(frozen=True)
class Inspection:
    """versions: the equations.  t: (T,) [s].  skeleton: joints along the motion, None where the model has no places.

    shares: {part: torques (n,) [N m or N] at t = 0}, what each partial Lagrangian takes, and the rest; {} for one part.
    stopped: why the motion ends before its time, empty where it does not.
    units: {name in the graphs: unit}, where they are known.
    """

    versions: tuple[Equations, ...]
    t: Array
    skeleton: Skeleton | None
    shares: Mapping[str, Array]
    stopped: str = ""
    units: Mapping[str, str] = field(default_factory=dict)


def inspection(
    scene: Scene, *, forward: bool = False, t_end: float | None = None, say: Callable[[str], None] = lambda line: None
) -> Inspection:
    """The scene's inverse dynamics by the three formulations, or its forward dynamics, along its free motion.

    say: told of each stage before it begins.

    Raises ValueError for t_end out of range, and as `simulate` does.
    """
    system, end = scene.system, scene.t_end if t_end is None else real_number("t_end", t_end)
    if not 0.0 < end < np.inf:
        raise ValueError(f"t_end must be positive and finite, got {end!r} s")
    frames = int(min(FRAMES, max(2.0, RATE * end))) if np.isfinite(end) else 2
    times = np.linspace(0.0, end, frames) if end > 0.0 else None
    say(f"{scene.name}: deriving the equations of {system.n} coordinates, compiling them, and a motion of {end:g} s")
    run = simulate(system, scene.q, scene.qd, end, "dopri5", rtol=1e-6, t_eval=times)
    say(f"{scene.name}: deriving forward dynamics")
    rate = forward_dynamics(system)
    state = _named(q=run.q, qd=run.qd, tau=np.zeros_like(run.qd)) | system.parameters | {"t": run.t}
    if forward:
        about = "Accelerations from torques: solved joint by joint from the tip to the base, then back out to the tip."
        about += " With them come the forces that hold the constraints." if system.constraints else ""
        versions = [Equations("forward dynamics", rate, about, frozenset(), _needed(rate, state))]
    else:
        found = rate.evaluate(_needed(rate, state))
        qdd = np.stack([np.broadcast_to(found[f"qdd{i}"], len(run.t)) for i in range(system.n)], axis=1)
        old = {"q": run.q - DT * _coordinate_rates(system, run), "qd": run.qd - DT * qdd}
        state |= _named(qdd=qdd) | {"dt": DT}
        state |= {f"{name}{i}_old": column for name, table in old.items() for i, column in enumerate(table.T)}
        versions = []
        for name in FORMULATIONS:
            say(f"{scene.name}: deriving inverse dynamics, {name.replace('_', ' ')}")
            versions.append(_version(system, name, state))
    places = None if scene.mechanism is None else skeleton(scene.mechanism.bind(), run.q)
    stopped = "" if run.stats.success else run.stats.message
    units = {} if scene.mechanism is None else display_units(scene.mechanism.moving)
    return Inspection(tuple(versions), run.t, places, _shares(scene, state), stopped, units | {"t": "s", "dt": "s"})


def _version(system: System, name: str, state: Mapping[str, Any]) -> Equations:
    graph = inverse_dynamics(system, name)
    wrong = spurious_nodes(graph)
    if wrong:
        through = "of the kinetic energy " if name == "kinetic_only" else ""
        about = (
            f"Look at what is vermillion: {len(wrong)} of {len(graph.nodes)} nodes. The velocity derivative {through}"
            "was taken through q = qd dt + q_old, so it reached q as well, and a branch that does not belong there "
            "runs into the torques. No smaller dt takes it away."
        )
    else:
        about = f"No spurious branch: {len(graph.nodes)} nodes, and the torques that the motion takes."
    if not wrong and system.constraints:
        about += " Nothing drives the joints here: these torques are those of the constraints alone."
    elif not wrong:
        about += " Nothing drives the joints here, so the torques should be 0."
    return Equations(name, graph, about, wrong, _needed(graph, state))


def _coordinate_rates(system: System, run: Trajectory) -> Array:
    """Rates of the coordinates along a motion, (T, nq)."""
    if system.kinematics.quasi is None:
        return run.qd
    rates = Graph([*system.q, *system.qd], {str(i): node for i, node in enumerate(system.q_dot)})
    values = rates.evaluate(_named(q=run.q, qd=run.qd)).values()
    return np.stack([np.broadcast_to(value, len(run.t)) for value in values], axis=1)


def _named(**tables: Array) -> dict[str, Any]:
    return {f"{name}{i}": table[:, i] for name, table in tables.items() for i in range(table.shape[1])}


def _needed(graph: Graph, state: Mapping[str, Any]) -> dict[str, Any]:
    return {name: state[name] for name in graph.input_names}


def _shares(scene: Scene, state: Mapping[str, Any]) -> dict[str, Array]:
    """Inverse dynamics of each partial Lagrangian alone, which adds up to the whole but for damping and forces."""
    system = scene.system
    parts = system.partial_lagrangians
    mechanism = scene.mechanism
    if len(parts) < 2 or "qdd0" not in state or (mechanism is not None and mechanism.base_parameters):
        return {}
    names = [body.name for body in mechanism.moving] if mechanism is not None else []
    if len(names) != len(parts):
        names = [f"link {i + 1}" for i in range(len(parts))]

    def torques(model: System) -> Array:
        graph = inverse_dynamics(model)
        at = {name: np.atleast_1d(value)[0] for name, value in _needed(graph, state).items()}
        return np.array([float(graph.evaluate(at)[f"tau{i}"]) for i in range(system.n)])

    # the parts are nodes over the system's own variables, so a function that gives one makes a system of it
    shares = {
        name: torques(
            System(
                lambda *_, part=part: part,
                system.coordinates,
                system.parameters,
                quasi_velocities=system.kinematics.quasi,
            )
        )
        for name, part in zip(names, parts, strict=True)
    }
    total = torques(system)
    return shares | {"damping and forces": total - sum(shares.values()), "all": total}
