"""What there is to inspect in a scene: its equations as graphs, their inputs along its motion, its joints' places."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Edge, Graph, Node
from cgraph.extend import PRIMAL, TANGENT, Array, real_number

from ..equations.both_forms import HAMILTON, LAGRANGE, VELOCITIES_ALONE, both_forms, form_sizes
from ..equations.equations_of_motion import forward_dynamics
from ..equations.formulations import inverse_dynamics
from ..equations.hamiltonian import velocities
from ..equations.legendre import is_quadratic
from ..equations.node_classes import (
    ACCELERATIONS,
    BIAS,
    DAMPING,
    LEAVES,
    POSITIONS,
    RATES,
    VELOCITIES,
    form_classes,
)
from ..equations.state_equation import state_equation
from ..equations.torque_decomposition import torque_by_link
from ..equations.verdict import formulation_verdict
from ..multibody.display_units import display_units
from ..multibody.joint_positions import Skeleton, skeleton
from ..simulation.simulate import simulate
from ..simulation.trajectory import Trajectory
from ..systems.display_names import display_names
from ..systems.system import System
from .elimination import EliminationStep, elimination
from .scenes import Scene

FORMULATIONS = ("euler_embedded", "kinetic_only", "chain_rule")  # those of the paper, the flawed ones first
FRAMES, RATE = 150, 30.0  # most instants shown, and how many a second
# Rows of the picture by classes of both forms. Of what is solved for, the way back out is a row above the way in.
INWARD, OUTWARD, TOP = "eliminated", "back out", "rates"
ROWS = {
    "of positions": (LEAVES, POSITIONS), "bias": (BIAS, DAMPING), INWARD: (ACCELERATIONS, VELOCITIES), OUTWARD: (),
    TOP: (RATES,),
}  # fmt: skip
DT = 1e-3  # s, the step that the embedded formulations take


class Equations(NamedTuple):
    """A graph of the equations.  about: what to see.  marked: spurious nodes.  steps: of an elimination.

    rows: {title: nodes} of the rows of the picture from the bottom; those of the sweeps where there are none.
    blamed: edges by which what is spurious enters.  flawed: whether these are not the equations of the chain rule.
    """

    name: str
    graph: Graph
    about: str
    marked: frozenset[Node]
    steps: tuple[EliminationStep, ...] = ()
    rows: Mapping[str, Collection[Node]] = MappingProxyType({})
    blamed: frozenset[Edge] = frozenset()
    flawed: bool = False


class Shares(NamedTuple):
    """Torques by partial Lagrangians.  graph: outputs tau0_part0 ..  parts: their names, then the rest and the sum."""

    graph: Graph
    parts: tuple[str, ...]

    def row(self, i: int) -> list[str]:
        """The outputs for coordinate i, one a part."""
        return [f"tau{i}_part{k}" for k in range(len(self.parts))]


@dataclass(frozen=True)
class Inspection:
    """versions: the equations.  t: (T,) [s].  skeleton: joints along the motion, None where the model has no places.

    at: {input: (T,) or a number}, the one state of all versions.  derived: the inputs of embedded formulations from it,
    q0_old = q0 - dt q_dot0 and qd0_old = qd0 - dt qdd0; None where there are none.
    shares: what each partial Lagrangian takes of the torques, None for one part.
    stopped: why the motion ends before its time, empty where it does not.
    units: {name in the graphs: unit}, where they are known.
    """

    versions: tuple[Equations, ...]
    t: Array
    skeleton: Skeleton | None
    at: Mapping[str, float | Array]
    derived: Graph | None = None
    shares: Shares | None = None
    stopped: str = ""
    units: Mapping[str, str] = field(default_factory=dict)


def inspection(
    scene: Scene,
    *,
    forward: bool = False,
    momentum: bool = False,
    t_end: float | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Inspection:
    """The scene's inverse dynamics by the three formulations, along its free motion.

    forward: its forward dynamics in place of them.  momentum: Hamilton's equations and the state equation.
    Of an OdeSystem it is the state equation.  say: told of each stage before it begins.

    Raises ValueError for t_end out of range or both, and as `simulate` and `hamilton_equations` do.
    """
    if forward and momentum:
        raise ValueError("forward and momentum exclude one another: a page shows one of them")
    end = scene.t_end if t_end is None else real_number("t_end", t_end)
    if not 0.0 < end < np.inf:
        raise ValueError(f"t_end must be positive and finite, got {end!r} s")
    frames = int(min(FRAMES, max(2.0, RATE * end))) if np.isfinite(end) else 2
    times = np.linspace(0.0, end, frames) if end > 0.0 else None
    if momentum:
        return _hamilton(scene, end, times, say)
    if scene.ode is not None:
        return _first_order(scene, end, times)
    system = scene.system
    count = f"{system.nq} coordinate{'s' * (system.nq != 1)}"
    say(f"{scene.name}: deriving the equations of {count}, compiling them, and a motion of {end:g} s")
    run = simulate(system, scene.q, scene.qd, end, "dopri5", rtol=1e-6, t_eval=times)
    say(f"{scene.name}: deriving forward dynamics")
    rate = forward_dynamics(system)
    state = _named(q=run.q, qd=run.qd, tau=np.zeros_like(run.qd)) | system.parameters | {"t": run.t}
    derived = shares = None
    if forward:
        about = "Accelerations from torques: solved joint by joint from the tip to the base, then back out to the tip."
        about += " With them come the forces that hold the constraints." if system.constraints else ""
        versions = [
            Equations("forward dynamics", rate, about, frozenset(), tuple(elimination(rate, display_names(scene))))
        ]
    else:
        found = rate.evaluate({name: state[name] for name in rate.input_names})
        qdd = np.stack([np.broadcast_to(found[f"qdd{i}"], len(run.t)) for i in range(system.n)], axis=1)
        if not np.isfinite(qdd).all():
            raise ValueError(f"{scene.name} has accelerations that are not finite: the motion {run.stats.message}")
        state |= _named(qdd=qdd)
        versions = []
        for name in FORMULATIONS:
            say(f"{scene.name}: deriving inverse dynamics, {name.replace('_', ' ')}")
            versions.append(_version(scene, name))
        derived, shares = _derived(system), _shares(scene)
    stopped = "" if run.stats.success else run.stats.message
    return _along(scene, run, versions, state | {"dt": DT}, derived, shares, stopped=stopped)


def _along(
    scene: Scene,
    run: Trajectory,
    versions: Sequence[Equations],
    state: Mapping[str, float | Array],
    derived: Graph | None,
    shares: Shares | None = None,
    *,
    stopped: str,
) -> Inspection:
    """The versions along a motion.  state: values of all inputs that a graph may have.  stopped: why it ends early."""
    places = None if scene.mechanism is None else skeleton(scene.mechanism.bind(), run.q)
    units = {} if scene.mechanism is None else display_units(scene.mechanism.moving)
    graphs = [each.graph for each in versions] + [each for each in (derived,) if each]
    graphs += [places.graph] if places is not None else []
    inputs = {name for graph in graphs for name in graph.input_names}
    at = {name: value for name, value in state.items() if name in inputs}
    units = units | {"t": "s", "dt": "s"}
    return Inspection(tuple(versions), run.t, places, at, derived, shares, stopped, units)


def _hamilton(scene: Scene, end: float, times: Array | None, say: Callable[[str], None]) -> Inspection:
    """Both forms of the equations in the state (q, p), along a motion that is stepped in it; velocities follow."""
    say(f"{scene.name}: deriving Hamilton's equations, and the state equation beside them")
    forms = both_forms(scene)
    hamilton, system, sizes = forms[HAMILTON], scene.system, form_sizes(forms)
    say(f"{scene.name}: a motion of {end:g} s, stepped in coordinates and momenta")
    run = simulate(system, scene.q, scene.qd, end, "dopri5", rtol=1e-6, t_eval=times, form="momentum")
    assert run.p is not None
    state = _named(q=run.q, p=run.p, tau=np.zeros_like(run.qd)) | system.parameters | {"t": run.t}
    depth = {name: counts.depth for name, counts in sizes.items()}
    about = (
        "Rates of coordinates and momenta. The velocities are solved from the momenta, "
        f"{_operations(depth[VELOCITIES_ALONE])} deep; the rates of the momenta stand on them, {depth[HAMILTON]} deep "
        f"in all, in {len(hamilton.nodes)} nodes. There is no acceleration and no bias."
    )
    beside = (
        "The same motion by accelerations: at the velocities of these momenta, torque less bias, solved. "
        f"{_operations(depth[LAGRANGE])} deep, {len(forms[LAGRANGE].nodes)} nodes."
    )
    steps = tuple(elimination(hamilton, display_names(scene))) if is_quadratic(system) else ()
    versions = [
        Equations(HAMILTON, hamilton, about, frozenset(), steps, _rows(hamilton)),
        Equations(LAGRANGE, forms[LAGRANGE], beside, frozenset(), (), _rows(forms[LAGRANGE])),
    ]
    stopped = "" if run.stats.success else run.stats.message
    return _along(scene, run, versions, state, velocities(system), stopped=stopped)


def _operations(count: int) -> str:
    return f"{count} operation{'s' * (count != 1)}"


def _rows(graph: Graph) -> dict[str, list[Node]]:
    """{title: nodes} of `ROWS`."""
    class_of, rows = form_classes(graph), {title: list[Node]() for title in ROWS}
    title_of = {kind: title for title, kinds in ROWS.items() for kind in kinds}
    if "p0_dot" in graph.outputs:
        title_of[DAMPING] = TOP  # there it is of velocities that have been solved for
    for node in graph.nodes:
        title = title_of[class_of(node)]
        back = title in (INWARD, TOP) and TANGENT in node.roles and PRIMAL not in node.roles
        rows[OUTWARD if back else title].append(node)
    return rows


def _first_order(scene: Scene, end: float, times: Array | None) -> Inspection:
    graph = state_equation(scene)
    run = simulate(scene, scene.q, None, end, "dopri5", rtol=1e-6, t_eval=times)
    state = dict(zip(scene.coordinates, run.q.T, strict=True)) | dict(scene.parameters) | {"t": run.t}
    about = f"The rates of {len(scene.coordinates)} states: {len(graph.nodes)} nodes."
    at = {name: state[name] for name in graph.input_names}
    stopped = "" if run.stats.success else run.stats.message
    version = Equations("state equation", graph, about, frozenset())
    return Inspection((version,), run.t, None, at, stopped=stopped, units={"t": "s"})


def _derived(system: System) -> Graph:
    """The state that embedded formulations start from: q0_old .., qd0_old .. of q, qd, qdd and dt."""
    dt, qdd = cg.variable("dt"), cg.variables([f"qdd{i}" for i in range(system.n)])
    old = {f"q{i}_old": q - dt * rate for i, (q, rate) in enumerate(zip(system.q, system.q_dot, strict=True))}
    old |= {f"qd{i}_old": qd - dt * rate for i, (qd, rate) in enumerate(zip(system.qd, qdd, strict=True))}
    return Graph([*system.q, *system.qd, *qdd, dt], old)


def _version(scene: Scene, name: str) -> Equations:
    verdict = formulation_verdict(scene, name)
    wrong, edges, about = verdict.nodes, verdict.edges, verdict.summary
    if verdict.differs:
        through = "of the kinetic energy " if name == "kinetic_only" else ""
        about += f" The velocity derivative {through}was taken through q = qd dt + q_old, so it reached q as well."
        entries = f"the {len(edges)} edges" if len(edges) > 1 else "the edge"
        nodes = f"{len(wrong)} of {len(verdict.graph.nodes)} nodes, and " if wrong else ""
        about += f" Look at what is vermillion: {nodes}{entries} by which the surplus enters." if edges else ""
        about += f" {verdict.lacking}" if verdict.missing else ""
    elif scene.system.constraints:
        about += " Nothing drives the joints here: these torques are those of the constraints alone."
    else:
        about += " Nothing drives the joints here, so the torques should be 0."
    return Equations(name, verdict.graph, about, wrong, blamed=edges, flawed=verdict.differs)


def _named(**tables: Array) -> dict[str, float | Array]:
    return {f"{name}{i}": table[:, i] for name, table in tables.items() for i in range(table.shape[1])}


def _shares(scene: Scene) -> Shares | None:
    """What each partial Lagrangian takes of the torques, and damping and forces where there are any; the sum of all."""
    system, mechanism = scene.system, scene.mechanism
    if len(system.partial_lagrangians) < 2 or (mechanism is not None and mechanism.base_parameters):
        return None
    table, whole = torque_by_link(system), inverse_dynamics(system, "chain_rule")
    columns = [[table.graph.outputs[f"tau{i}_{k}"] for i in range(system.n)] for k in range(len(table.rows))]
    columns.append([whole.outputs[f"tau{i}"] for i in range(system.n)])
    outputs = {f"tau{i}_part{k}": node for k, column in enumerate(columns) for i, node in enumerate(column)}
    return Shares(Graph(whole.inputs, outputs), (*table.rows, "all"))
