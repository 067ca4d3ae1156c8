"""Contents of a model's page: its equations, their inputs along a motion, places of joints, shares of torques."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

import cgraph as cg
import dynamics as dyn
from cgraph import Graph, Node
from cgraph._shared import Array, counted, real_number
from cgraph.extend import topological
from dynamics.equations.momentum.hamiltonian import is_quadratic
from dynamics.multibody.bodies.joint_coordinates import display_units
from dynamics.multibody.trees.joint_positions import skeleton

from .. import theme
from ..inspector import Motion, StateTable, Step, Version
from ..pages.document import Table
from ..pages.formulation_table import TITLES
from ..paper.both_forms import HAMILTON, LAGRANGE, VELOCITIES_ALONE, both_forms, form_sizes
from .node_classes import form_rows, formulation_classes

# Those of the paper, the flawed ones first, in one picture; and equations by velocities, which may be the smallest.
PAPER = ("by_definition", "kinetic_only", "chain_rule")
FORMULATIONS = (*PAPER, "newton_euler")
INVERSE, FORWARD, MOMENTUM = "inverse dynamics", "forward dynamics", "momentum"  # groups of versions
FRAMES, RATE = 150, 30.0  # most instants shown, and how many a second
DT = 1e-3  # s, the step that the embedded formulations take


@dataclass(frozen=True)
class Inspection:
    """versions: {name: the equations}.  motion: its instants, and joints where the model has places.

    at: {input: (T,) or a number}, the one state of all versions.
    derived: what follows from it: q0_old = q0 - dt q_dot0, qd0_old = qd0 - dt qdd0, p0 = dL/dqd0; or None.
    shares: what each partial Lagrangian takes of the torques.  stopped: why the motion ends before its time, or "".
    units: {name in the graphs: unit}.  causes: what adds up to the torques.  lacking: why there are no momenta.
    """

    versions: Mapping[str, Version]
    motion: Motion
    at: Mapping[str, float | Array]
    derived: Graph | None = None
    shares: StateTable | None = None
    carried: Table | None = None
    stopped: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    causes: StateTable | None = None
    lacking: str = ""


def inspection(
    scene: dyn.Scene, *, t_end: float | None = None, say: Callable[[str], None] = lambda line: None
) -> Inspection:
    """All equations of a scene along its free motion: inverse dynamics by the formulations, forward dynamics, momenta.

    Of an OdeSystem it is the state equation.  say: told of each stage before it begins.

    Raises ValueError for t_end out of range, and as `simulate` does.
    """
    end = scene.t_end if t_end is None else real_number("t_end", t_end)
    if not 0.0 < end < np.inf:
        raise ValueError(f"t_end must be positive and finite, got {end!r} s")
    frames = int(min(FRAMES, max(2.0, RATE * end))) if np.isfinite(end) else 2
    times = np.linspace(0.0, end, frames) if end > 0.0 else None
    if scene.ode is not None:
        return _first_order(scene, end, times)
    system = scene.system
    count = counted(system.nq, "coordinate")
    say(f"{scene.name}: deriving the equations of {count}, compiling them, and a motion of {end:g} s")
    run = dyn.simulate(system, scene.q, scene.qd, end, "dopri5", rtol=1e-6, t_eval=times)
    say(f"{scene.name}: deriving forward dynamics")
    rate = dyn.forward_dynamics(system)
    state = _named(q=run.q, qd=run.qd, tau=np.zeros_like(run.qd)) | system.parameters | {"t": run.t, "dt": DT}
    found = rate.evaluate({name: state[name] for name in rate.input_names})
    qdd = np.stack([np.broadcast_to(found[f"qdd{i}"], len(run.t)) for i in range(system.n)], axis=1)
    if not np.isfinite(qdd).all():
        raise ValueError(f"{scene.name} has accelerations that are not finite: the motion {run.stats.message}")
    state |= _named(qdd=qdd)
    versions = dict[str, Version]()
    for name in FORMULATIONS:
        say(f"{scene.name}: deriving inverse dynamics, {TITLES[name]}")
        versions[name] = _version(scene, name)
    about = "Accelerations from torques: solved joint by joint from the tip to the base, then back out to the tip."
    about += " With them come the forces that hold the constraints." if system.constraints else ""
    steps = elimination(rate, dyn.display_names(scene))
    versions[FORWARD] = Version(FORWARD, rate, about, steps=steps, group=FORWARD)
    say(f"{scene.name}: deriving Hamilton's equations, and the state equation beside them")
    lacking = ""
    try:
        versions |= {each.name: each for each in _hamilton(scene)}
    except ValueError as error:  # a constraint, or a kinetic energy that gives no momenta
        lacking = f"No equations in momenta: {error}."
    derived = _derived(system, momenta=not lacking)
    places = None if scene.mechanism is None else skeleton(scene.mechanism.bind(), run.q)
    units = {} if scene.mechanism is None else display_units(scene.mechanism.moving)
    graphs = [*[each.graph for each in versions.values()], derived, *([places.graph] if places is not None else [])]
    inputs, by_cause = {name for graph in graphs for name in graph.input_names}, dyn.torque_by_cause(scene)
    rows = {f"tau{i}": [f"tau{i}_{k}" for k in range(len(by_cause.rows))] for i in range(system.n)}
    return Inspection(
        versions,
        Motion(run.t) if places is None else Motion(run.t, *places),
        {name: value for name, value in state.items() if name in inputs},
        derived,
        _shares(scene),
        carried(scene),
        stopped="" if run.stats.success else run.stats.message,
        units=units | {"t": "s", "dt": "s"},
        causes=StateTable("Torques and forces by cause", by_cause.graph, by_cause.rows, rows),
        lacking=lacking,
    )


def _hamilton(scene: dyn.Scene) -> list[Version]:
    """The two forms of the equations, in momenta and in velocities. Raises as `hamilton_equations` does."""
    forms = both_forms(scene)
    hamilton, system, sizes = forms[HAMILTON], scene.system, form_sizes(forms)
    depth = {name: size["depth"] for name, size in sizes.items()}
    about = (
        "Rates of coordinates and momenta. The velocities are solved from the momenta, "
        f"{counted(depth[VELOCITIES_ALONE], 'operation')} deep; the rates of the momenta stand on them, "
        f"{depth[HAMILTON]} deep in all, in {len(hamilton.nodes)} nodes. There is no acceleration and no bias."
    )
    beside = (
        "The same motion by accelerations: at the velocities of these momenta, torque less bias, solved. "
        f"{counted(depth[LAGRANGE], 'operation')} deep, {len(forms[LAGRANGE].nodes)} nodes."
    )
    steps = elimination(hamilton, dyn.display_names(scene)) if is_quadratic(system) else ()
    return [
        Version(HAMILTON, hamilton, about, steps=steps, rows=form_rows(hamilton), group=MOMENTUM),
        Version(LAGRANGE, forms[LAGRANGE], beside, rows=form_rows(forms[LAGRANGE]), group=MOMENTUM),
    ]


def _first_order(scene: dyn.Scene, end: float, times: Array | None) -> Inspection:
    graph = dyn.state_equation(scene)
    run = dyn.simulate(scene, scene.q, None, end, "dopri5", rtol=1e-6, t_eval=times)
    state = dict(zip(scene.coordinates, run.q.T, strict=True)) | dict(scene.parameters) | {"t": run.t}
    about = f"The rates of {len(scene.coordinates)} states: {len(graph.nodes)} nodes."
    at = {name: state[name] for name in graph.input_names}
    stopped = "" if run.stats.success else run.stats.message
    versions = {"state equation": Version("state equation", graph, about)}
    return Inspection(versions, Motion(run.t), at, stopped=stopped, units={"t": "s"})


def _derived(system: dyn.System, *, momenta: bool) -> Graph:
    """The state that embedded formulations start from, q0_old .., qd0_old .. of q, qd, qdd and dt; and momenta."""
    dt, qdd = cg.variable("dt"), cg.variables([f"qdd{i}" for i in range(system.n)])
    old = {f"q{i}_old": q - dt * rate for i, (q, rate) in enumerate(zip(system.q, system.q_dot, strict=True))}
    old |= {f"qd{i}_old": qd - dt * rate for i, (qd, rate) in enumerate(zip(system.qd, qdd, strict=True))}
    inputs = [*system.q, *system.qd, *qdd, dt]
    if momenta:
        graph = dyn.momentum(system)
        inputs += [node for node in graph.inputs if node not in inputs]
        old |= graph.outputs
    return Graph(inputs, old)


def _version(scene: dyn.Scene, name: str) -> Version:
    verdict = dyn.formulation_verdict(scene, name)
    about = f"{verdict.summary} {verdict.explanation}".strip()
    if not verdict.differs:
        alone = "these torques are those of the constraints alone"
        about += f" Nothing drives the joints here: {alone if scene.system.constraints else 'the torques should be 0'}."
    return Version(
        TITLES[name],
        verdict.graph,
        about,
        verdict.nodes,
        blamed=verdict.edges,
        flawed=verdict.differs,
        off=tuple(verdict.excess),
        excess=verdict.terms if verdict.differs else None,
        group=INVERSE if name in PAPER else name,
    )


def _named(**tables: Array) -> dict[str, float | Array]:
    return {f"{name}{i}": table[:, i] for name, table in tables.items() for i in range(table.shape[1])}


def _shares(scene: dyn.Scene) -> StateTable | None:
    """Shares of the torques of each partial Lagrangian, of damping and forces where there are any, and their sum."""
    system, mechanism = scene.system, scene.mechanism
    if len(system.partial_lagrangians) < 2 or (mechanism is not None and mechanism.base_parameters):
        return None
    table, whole = dyn.torque_by_link(system), dyn.inverse_dynamics(system, "chain_rule")
    rows = {f"tau{i}": [f"tau{i}_part{k}" for k in range(len(table.rows) + 1)] for i in range(system.n)}
    outputs = {part: table.graph.outputs[f"{tau}_{k}"] for tau, row in rows.items() for k, part in enumerate(row[:-1])}
    graph = Graph(whole.inputs, outputs | {row[-1]: whole.outputs[tau] for tau, row in rows.items()})
    return StateTable("Torques and forces that each part takes", graph, (*table.rows, "all"), rows)


def elimination(graph: Graph, names: Mapping[str, str]) -> list[Step]:
    """The steps of forward dynamics, or of Hamilton's equations where velocities are rates of coordinates.

    A pivot is what an acceleration or a velocity is divided by: the inertia that its joint feels while all joints
    further out follow freely. It is a node like others, known by what is divided by it. [] for a graph that divides by
    no pivots.

    names: {name in the graph: what a person calls it}.
    """
    rates = _numbered(graph, "p", "_dot")
    kind, solved = ("velocity", _numbered(graph, "q", "_dot")) if rates else ("acceleration", _numbered(graph, "qdd"))
    every = {node for _, node in solved.values()}
    place = {node: i for i, node in enumerate(graph.nodes)}
    found = {i: _pivot(node, every, place) for i, (_, node) in solved.items()}
    pivots = {i: pivot for i, pivot in found.items() if pivot is not None}
    if len(pivots) < len(solved) or (rates and rates.keys() != solved.keys()):
        return []
    joints = {i: names.get(name, name).partition(".")[2] or name for i, (name, _) in solved.items()}
    done = {node for node in graph.nodes if not node.args}
    steps: list[Step] = []

    def add(words: str, value: Node, i: int) -> None:
        fresh = tuple([node for node in topological([value]) if node not in done])
        done.update(fresh)
        steps.append(Step(words, fresh, value, i))

    for i, pivot in sorted(pivots.items(), key=lambda each: (bool(each[1].args), place[each[1]], -each[0])):
        words = f"Eliminate {joints[i]}: its pivot is the inertia that it feels while all joints further out follow."
        add(words, pivot, i)
    how = "nothing else is unknown at the base"
    for i, (_, node) in sorted(solved.items(), key=lambda each: place[each[1][1]]):
        add(f"Back out: the {kind} of {joints[i]}; {how}.", node, i)
        how = "what moves it from below is known now"
    for i, (_, node) in sorted(rates.items(), reverse=True):
        add(f"All velocities are known: the rate of the momentum of {joints[i]}.", node, i)
    return steps


def _numbered(graph: Graph, kind: str, end: str = "") -> dict[int, tuple[str, Node]]:
    """{number: (name, node)} of the outputs of a kind, such as q0_dot, q1_dot .."""
    found = {}
    for name, node in graph.outputs.items():
        number = name.removeprefix(kind).removesuffix(end)
        if number.isdecimal() and name == f"{kind}{number}{end}":
            found[int(number)] = (name, node)
    return found


def _pivot(solved: Node, others: set[Node], place: Mapping[Node, int]) -> Node | None:
    """The first of the divisors that are met below what is solved for, before a division or another of it.

    What of the joints further in is met, too, was divided by their pivots, which come later.
    """
    found: list[Node] = []
    rest, seen = [solved], {solved}
    while rest:
        node = rest.pop()
        if node.op.name == "div":
            found.append(node.args[1])
            continue
        below = [arg for arg in node.args if arg not in others and arg not in seen]
        rest += below
        seen.update(below)
    return min(found, key=lambda node: (bool(node.args), place[node]), default=None)


def carried(scene: dyn.Scene) -> Table | None:
    """The nodes that only the chain rule has, counted by part of the model and by what they are; None where none is.

    The classes are those of `cgraph compare`: the rates of slopes are what -dL/dq cancels in part.
    """
    verdicts = [dyn.formulation_verdict(scene, name) for name in ("chain_rule", "newton_euler")]
    left, right = (each.graph for each in verdicts)
    classes = cg.compare(left, right, classify=formulation_classes(verdicts)).classes("left")
    counts = {tuple(name.rpartition(": ")[::2]): count for name, count in classes.items()}
    if not counts:
        return None
    of_part, of_kind = Counter[str](), Counter[str]()
    for (part, kind), count in counts.items():
        of_part[part] += count
        of_kind[kind] += count
    kinds = [kind for kind, _ in of_kind.most_common()]
    rows = []
    for part in sorted(of_part, key=lambda part: (not part, theme.natural_order(part))):
        cells = [str(counts.get((part, kind), "")) for kind in kinds]
        rows.append([part or "no part", *cells, str(of_part[part])])
    rows.append(["all", *[str(of_kind[kind]) for kind in kinds], f"{of_part.total()}"])
    caption = (
        f"Nodes that only the chain rule has: {of_part.total()} of its {len(left.nodes)}. Newton and Euler's equations "
        f"have {len(right.nodes)} nodes in all, and give the same torques"
    )
    return Table(caption, ["nodes of", *map(theme.pretty, kinds), "all"], rows)
