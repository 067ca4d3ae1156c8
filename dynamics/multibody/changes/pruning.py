"""Pruning: the graph of what a question needs, and what was left out of it, why, and how many nodes that saved."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import cgraph as cg
from cgraph import Graph, _shared

from ...equations.equations_of_motion import gravity_force
from ...equations.formulations.formulations import inverse_dynamics, size
from ...equations.formulations.lagrange_terms import SMALL, shortest
from ...systems.model import Model, as_system
from ...systems.system import System
from ..bodies.body import Body
from ..bodies.composed_joints import locked_parts, parts_of
from ..bodies.joint_coordinates import places
from ..parameters import vanishes
from ..trees.mechanism import Mechanism, as_mechanism
from ..trees.structure import changed

EFFECTS = ("gravity", "damping", "springs", "armature", "forces")
FREE_FALL = (0.0, 0.0, -9.81)  # m/s^2, put in to count what gravity would take
SKEW = (-3.0, -5.0, -7.0)  # m/s^2, along no axis
NUMBER = 0.3  # put in for a damping, stiffness, .. that a model has not
GROUPS = ("q", "qd", "qdd", "tau")
NEVER = "unobservable inertial numbers"
Equations = Callable[[Model], Graph]
_JOINT = {"damping": "damping", "springs": "stiffness", "armature": "armature"}
_ABLE = {"springs": "sprung", "armature": "geared"}  # what the type of a joint that can have it says


def has_effect(model: Model, effect: str) -> bool:
    """Whether the model has an effect. Raises ValueError for one that cannot be told apart."""
    mechanism = as_mechanism(model)
    if mechanism is not None:
        if effect in _JOINT:
            return not all(vanishes(getattr(body.joint, _JOINT[effect])) for body in mechanism.moving)
        return not vanishes(mechanism.gravity) if effect == "gravity" else bool(mechanism.forces)
    system = as_system(model)
    if effect == "damping":
        return not vanishes(system.damping)
    if effect == "forces":
        return any(force.value != 0.0 for force in system.forces)
    raise ValueError(f"the Lagrangian of {model!r:.60} is given as a whole: {effect} cannot be told apart in it")


def without_effect(model: Model, effect: str) -> Model:
    """The model with that effect switched off."""
    mechanism = as_mechanism(model)
    if mechanism is not None:
        if effect == "gravity":
            return changed(mechanism, gravity=(0.0, 0.0, 0.0))
        return changed(mechanism, forces=()) if effect == "forces" else _with(mechanism, effect, 0.0)
    system = as_system(model)
    return System(
        lambda q, qd, t: system.partial_lagrangians,
        system.coordinates,
        system.parameters,
        forces=(lambda q, qd, t: system.forces) if effect == "damping" else None,
        damping=0.0 if effect == "damping" else system.damping,
    )


def _with(model: Mechanism, effect: str, number: float, among: Collection[str] | None = None) -> Mechanism:
    """The mechanism with that damping, stiffness or armature at the joints of those bodies, or at all that move."""
    change: dict[str, Any] = {_JOINT[effect]: number}
    if effect == "springs" and not number:
        change["spring_reference"] = 0.0

    names = [body.name for body in model.bodies if body.joint.moves] if among is None else among
    return _replaced(model, names, lambda body: replace(body, joint=replace(body.joint, **change)))


def absent_parts(model: Mechanism, given: Mechanism) -> Iterator[tuple[str, str, Mechanism]]:
    """What, why, and the model with it. given: the model before anything was switched off, which is not absent."""
    model, given = _in_parts(model), _in_parts(given)
    if vanishes(given.gravity):
        yield "gravity", "it is zero", changed(model, gravity=FREE_FALL)
    elif not vanishes(model.gravity):
        forces = list(gravity_force(_with(model, "springs", 0.0)).outputs.values())
        along = [forces[place.u] for place in places(model.moving)]
        still = [all([force.value == 0.0 for force in each]) for each in along]
        free = [body.name for body, none in zip(model.moving, still, strict=True) if none]
        if free:
            yield f"gravity at {_listed(free)}", "it does no work there", changed(model, gravity=SKEW)
    for effect, name in _JOINT.items():
        had = {body.name for body in given.moving if not vanishes(getattr(body.joint, name))}
        able = [body for body in model.moving if getattr(body.joint.type, _ABLE.get(effect, "moves"))]
        without = [body.name for body in able if vanishes(getattr(body.joint, name)) and body.name not in had]
        if without:
            yield f"{effect} of {_listed(without)}", "it is zero", _with(model, effect, NUMBER, without)
    if massless := [body.name for body in model.bodies if not _frame(model, body) and not _has_inertia(body)]:
        heavy: dict[str, Any] = {"mass": 1.0, "center": (0.1, 0.2, 0.3), "inertia": (0.1, 0.2, 0.25)}
        with_mass = _replaced(model, massless, lambda body: replace(body, **heavy))
        yield f"mass of {_listed(massless)}", "it is zero", with_mass
    if welds := [body.name for body in model.bodies if not (body.joint.moves or vanishes(body.mass))]:
        hinge: dict[str, Any] = {"kind": "revolute", "armature": NUMBER}
        hinged = _replaced(model, welds, lambda body: replace(body, joint=replace(body.joint, **hinge)))
        yield f"joint of {_listed(welds)}", "it is welded on", hinged


def _in_parts(model: Mechanism) -> Mechanism:
    """The mechanism with bodies on composed joints as the bodies that they are, whose names `moving` has."""
    bodies = [part for body in model.bodies for part in parts_of(body)]
    if len(bodies) == len(model.bodies):
        return model
    return replace(model, bodies=bodies, locked=locked_parts(model.bodies, model.locked))


def _has_inertia(body: Body) -> bool:
    return not (vanishes(body.mass) and vanishes(body.inertia))


def _frame(model: Mechanism, body: Body) -> bool:
    """Whether a body only marks a place: welded on, without mass, carrying nothing."""
    carries = any(body.name == other.parent for other in model.bodies)
    return not (carries or body.joint.moves or _has_inertia(body))


def _replaced(model: Mechanism, names: Collection[str], change: Callable[[Body], Body]) -> Mechanism:
    return changed(model, bodies=tuple([change(body) if body.name in names else body for body in model.bodies]))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"{len(names) - 3} more"])


@dataclass(frozen=True)
class OmittedTerm:
    """Something that is not in a graph.

    Parameters
    ----------
    what, why : str
        What it is, and why it is not there.
    nodes, edges : int
        How many more there would be with it.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.5], damping=0.1)
    >>> print(dyn.prune(arm, effects=["gravity"]).omitted[0])
    damping: switched off (5 nodes, 8 edges)
    """

    what: str
    why: str
    nodes: int
    edges: int

    def __str__(self) -> str:
        return f"{self.what}: {self.why} ({_shared.counted(self.nodes, 'node')}, {_shared.counted(self.edges, 'edge')})"


@dataclass(frozen=True, eq=False)
class PruneResult:
    """Rest of a model after `prune`, with accounts of what was left out, made on demand.

    Parameters
    ----------
    model : Model
        What is left.
    graph : Graph
        Its equations.
    equations : callable
        What makes a graph of a model.
    steps : tuple
        From the model as given to what is left.

    Examples
    --------
    >>> import dynamics as dyn
    >>> result = dyn.prune(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]), values={"qd": 0.0})
    >>> len(result.full.nodes), len(result.graph.nodes)
    (50, 36)
    """

    model: Model
    graph: Graph
    equations: Equations
    steps: tuple[_Step, ...]  # from the model as given to what is left

    @cached_property
    def full(self) -> Graph:
        """The graph of the model as given."""
        return self.steps[0].graph(self.equations)

    @cached_property
    def omitted(self) -> tuple[OmittedTerm, ...]:
        """Terms of the full graph in the order in which they were taken out: their nodes add up to the difference."""
        before, result = self.full, []
        for step in self.steps[1:]:
            after = self.graph if step is self.steps[-1] else step.graph(self.equations)
            result.append(_omitted(step.what, step.why, before, after))
            before = after
        return tuple(result)

    @cached_property
    def absent(self) -> tuple[OmittedTerm, ...]:
        """Terms that the model as given lacks, so that no graph has nodes for them, each counted by putting it in.

        Gravity as on earth or, along the axes of some joints, askew; 0.3 for damping, stiffness and armature; a body of
        1 kg for one without mass; a hinge in place of a weld.
        """
        mechanism, given = as_mechanism(self.model), as_mechanism(self.steps[0].model)
        parts = () if mechanism is None or given is None else absent_parts(mechanism, given)
        steps = [(what, why, replace(self.steps[-1], model=model)) for what, why, model in parts]
        return tuple([_omitted(what, why, step.graph(self.equations), self.graph) for what, why, step in steps])

    @cached_property
    def remains(self) -> tuple[OmittedTerm, ...]:
        """Terms of the graph that no motion shows, and the nodes that `regroup` would save."""
        fewer = _regrouped(self.steps[-1])
        term = fewer and _omitted(NEVER, "not regrouped", self.graph, fewer.graph(self.equations))
        return (term,) if term and term.nodes > 0 else ()

    def __str__(self) -> str:
        lines = [f"{_size(self.full)} as given, {_size(self.graph)} left."]
        for title, rows in (("Left out", self.omitted), ("Not there", self.absent), ("Remains", self.remains)):
            if rows:
                lines += [f"{title}:", *(f"  {row}" for row in rows)]
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class _Step:
    """A model and what is asked of it, after `what` was taken out."""

    model: Model
    values: Mapping[str, float]
    outputs: tuple[str, ...] | None
    what: str = ""
    why: str = ""

    def graph(self, equations: Equations) -> Graph:
        """Graph of the equations; of inverse dynamics the smaller of two, which numbers may exchange."""
        ways = [partial(shortest, formulation=name) for name in SMALL] if equations is inverse_dynamics else [equations]
        graphs = [way(self.model) for way in ways]
        for graph in graphs:
            _shared.require_graph("prune, as what equations(model) gives,", graph)
        if self.values or self.outputs is not None:
            graphs = [cg.specialize(graph, _bound(graph, self.values), self.outputs) for graph in graphs]
        return min(graphs, key=size)


def prune(
    model: Model,
    equations: Equations = inverse_dynamics,
    *,
    effects: Iterable[str] = EFFECTS,
    lock: Mapping[str, float] | None = None,
    values: Mapping[str, float] | None = None,
    outputs: Sequence[str] | None = None,
    regroup: bool = False,
) -> PruneResult:
    """The equations of a model with what is asked for and nothing else.

    Parameters
    ----------
    model : Model
        A mechanism, a scene, or a Lagrangian.
    equations : callable
        The function that makes the graph: `inverse_dynamics`, `forward_dynamics`, `mass_matrix`, ...
    effects : iterable of str
        Those of `EFFECTS` that are kept: gravity, damping, springs, armature, forces. Of a Lagrangian that is not a
        mechanism's, only damping and forces can be told apart.
    lock : mapping, optional
        {body: coordinate [rad or m]} of joints to lock, of a mechanism.
    values : mapping, optional
        {input: number} of inputs that become constants; "q", "qd", "qdd", "tau" stand for all of their kind, so that
        {"qd": 0, "qdd": 0} leaves the torques that hold a posture.
    outputs : sequence of str, optional
        Names of those to keep.
    regroup : bool
        Give inertial numbers that no motion shows to the bodies further in, where that saves nodes. The motion is the
        same, but accelerations lose digits, one or two on long chains and more under a heavy load; and the tag of a
        body no longer stands for its own inertia alone.

    Returns
    -------
    PruneResult
        The model that is left, its graph with all inputs, and what was left out, why, and what that saved.

    Raises
    ------
    ValueError
        For an effect that is unknown or cannot be told apart, and as `cg.specialize` and `Mechanism.lock` do.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.5])
    >>> result = dyn.prune(arm, values={"qd": 0.0, "qdd": 0.0})
    >>> len(dyn.inverse_dynamics(arm).nodes), len(result.graph.nodes)
    (50, 10)
    """
    model = as_mechanism(model) or as_system(model)
    kept = _shared.require_sequence("effects", effects, "names", str)
    if not callable(equations) or isinstance(equations, type):
        raise TypeError(f"equations must be a function of a model, got {type(equations).__name__}: {equations!r:.60}")
    if unknown := [each for each in kept if each not in EFFECTS]:
        raise ValueError(f"effects are {', '.join(EFFECTS)}, got {unknown[0]!r}")
    numbers = _mapping("values", values)
    if numbers:
        known = as_system(model).parameters
        as_system(model).require_values(known | {name: value for name, value in numbers.items() if name in known})
    steps = _steps(model, kept, _mapping("lock", lock), numbers, outputs)
    graph = steps[-1].graph(equations)
    fewer = _regrouped(steps[-1]) if _shared.require_flag("regroup", regroup) else None
    if fewer is not None and len((candidate := fewer.graph(equations)).nodes) < len(graph.nodes):
        steps.append(fewer)
        graph = candidate
    return PruneResult(steps[-1].model, graph, equations, tuple(steps))


def _mapping(what: str, given: Mapping[str, float] | None) -> dict[str, float]:
    """The numbers of a mapping by name; none for None."""
    chosen = {} if given is None else _shared.require_mapping(what, given, "name: number")
    return {
        _shared.check_name(what, name): _shared.real_number(f"{what}: {name!r}", value)
        for name, value in chosen.items()
    }


def _regrouped(step: _Step) -> _Step | None:
    """The step with base parameters; None of a model that has them or is no mechanism."""
    mechanism = as_mechanism(step.model)
    if mechanism is None or mechanism.base_parameters:
        return None
    return replace(step, model=replace(mechanism, base_parameters=True), what=NEVER, why="regrouped")


def _steps(
    model: Model,
    kept: Collection[str],
    lock: Mapping[str, float],
    values: Mapping[str, float],
    outputs: Sequence[str] | None,
) -> list[_Step]:
    """Steps from the model as given, one thing after another taken out."""
    steps = [_Step(model, {}, None)]
    for effect in EFFECTS:
        if effect not in kept and has_effect(steps[-1].model, effect):
            less = without_effect(steps[-1].model, effect)
            steps.append(replace(steps[-1], what=effect, why="switched off", model=less))
    for body, at in lock.items():
        mechanism = as_mechanism(steps[-1].model)
        if mechanism is None:
            raise ValueError(f"a joint can be locked of a Mechanism, got {type(model).__name__}")
        locked = mechanism.lock(body, at)
        steps.append(replace(steps[-1], what=f"joint of {body}", why=f"locked at {at:g}", model=locked))
    for name, value in values.items():
        known = {**steps[-1].values, name: value}
        steps.append(replace(steps[-1], what=f"input {name}", why=f"is {value:g}", values=known))
    if outputs is not None:
        outputs = list(_shared.require_sequence("outputs", outputs, "names", str))
        why = f"only {', '.join(outputs)} asked for"
        steps.append(replace(steps[-1], what="other outputs", why=why, outputs=tuple(outputs)))
    return steps


def _bound(graph: Graph, values: Mapping[str, float]) -> dict[str, float]:
    """The values by the graph's own names; a group's for every input of the group."""
    result: dict[str, float] = {}
    for name, value in values.items():
        members = [each for each in graph.input_names if each.startswith(name) and each[len(name) :].isdecimal()]
        result |= dict.fromkeys(members if name in GROUPS and members else [name], value)
    return result


def _omitted(what: str, why: str, before: Graph, after: Graph) -> OmittedTerm:
    return OmittedTerm(what, why, len(before.nodes) - len(after.nodes), len(before.edges) - len(after.edges))


def _size(graph: Graph) -> str:
    return f"{_shared.counted(len(graph.nodes), 'node')} and {_shared.counted(len(graph.edges), 'edge')}"
