"""The verdict on a formulation: whether it differs from the chain rule, by how much, and what in its graph is to blame.

With q = G qd dt + q_old in it the derivative by qd of E, which is L by definition or K alone, is p + dt c, so that its
rate exceeds that of p by c = G^T dE/dq at every dt, however small. It is the torque of the chain rule if and only if c
is 0 at every state.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial, reduce
from operator import or_
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Edge, Graph, GraphError, Node, _shared, extend, jacobian, simplify
from cgraph._shared import (
    Remarks,
    counted,
    or_nearest,
    real_number,
    remarked,
    require_graph,
    require_mapping,
    shortened,
)
from cgraph.extend import Builder, Names, building, cotangents, folded

from ...systems.arguments import new_variables
from ...systems.kinematics import ONE, ZERO
from ...systems.model import Model, as_system, display_names
from ...systems.system import System
from ..equation import documented
from .lagrange_terms import COUPLING, THROUGH_STEP, formulation_name, torques

Derive = Callable[[System, str, Node], Graph]


class Blame(NamedTuple):
    """Nodes and edges that a graph has from the derivative through the step.

    nodes: they serve nothing else.  edges: by these it enters what is sound, or another use of a sound node is wrong.
    cancelled: outputs that have no such edge left, since simplification took it away together with a right one.
    """

    nodes: frozenset[Node] = frozenset()
    edges: frozenset[Edge] = frozenset()
    cancelled: tuple[str, ...] = ()


def split(system: System, formulation: str, derive: Derive) -> tuple[Graph, Node]:
    """Torques or momenta by a formulation of `THROUGH_STEP`, and an input by which all that comes by it is multiplied.

    At 1 they are its own, at 0 those without the step.
    """
    (through,) = new_variables("through", 1, system.parameters)
    return cg.simplify(derive(system, formulation, through)), through


def blame(
    system: System, formulation: str, derive: Derive, graph: Graph, known: tuple[Graph, Node] | None = None
) -> Blame:
    """Blame for what the graph has by the derivative through the step, whether its value is 0 or not.

    derive: `torques` or `momenta`, of which `graph` is the simplified graph by this formulation.  known: its `split`.

    All that comes through the step is multiplied by a variable. What folds to 0 when that is 0 is wrong, and the edges
    that lead out of it are to blame; at 1 the graph is the formulation's, node by node.
    """
    if formulation not in THROUGH_STEP:
        return Blame()
    marked, through = known or split(system, formulation, derive)
    without, whole = (
        dict(zip(marked.nodes, folded(marked.nodes, Builder(), {through: factor}), strict=True))
        for factor in (ZERO, ONE)
    )
    wrong = {node for node in marked.nodes if without[node].value == 0.0 and node.value != 0.0}
    image = Graph(graph.inputs, {name: whole[node] for name, node in marked.outputs.items()})
    same = dict(cg.compare(image, graph).common)
    leaving = {edge for edge in marked.edges if edge.source in wrong and edge.target not in wrong}
    drawn: dict[Edge, Edge] = {}
    for edge in leaving:
        source, target = same.get(whole[edge.source]), same.get(whole[edge.target])
        if source is not None and target is not None and source in target.args:
            drawn[edge] = Edge(source, target, target.args.index(source))
    edges, reach = frozenset(drawn.values()), dict.fromkeys(marked.nodes, 0)
    for k, node in enumerate(marked.outputs.values()):
        reach[node] |= 1 << k
    for node in reversed(marked.nodes):  # which outputs need it, a bit each
        for arg in node.args:
            reach[arg] |= reach[node]
    touched, left = (reduce(or_, [reach[edge.target] for edge in each], 0) for each in (leaving, drawn))
    cancelled = tuple([name for k, name in enumerate(marked.outputs) if touched & ~left & 1 << k])
    outputs = [graph.outputs[name] for name, node in marked.outputs.items() if node not in wrong]
    return Blame(frozenset(graph.nodes) - _needed(outputs, edges), edges, cancelled)


def spurious_nodes(graph: Graph) -> frozenset[Node]:
    """Nodes that are there only because a derivative was taken through the embedded Euler relation.

    They are the adjoints that the product qd dt of q = qd dt + q_old passes on, the "unnecessary terms" of eq. (3), and
    all that only these need, whether the author of the Lagrangian tagged anything or not. Where a slope dL/dq does not
    change along the step, such as a weight m g, the derivative of m g dt is the node m g itself, which is not marked:
    there an edge is wrong. Whether the torque is wrong, and by which edges, `formulation_verdict` says.

    Parameters
    ----------
    graph : Graph
        One of `inverse_dynamics` or `momentum_rate`, by any formulation.

    Returns
    -------
    frozenset of Node
        Empty for a formulation by the chain rule.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.scenes.load("spring_mass")
    >>> [len(dyn.spurious_nodes(dyn.momentum_rate(spring, name))) for name in ("chain_rule", "by_definition")]
    [0, 13]
    """
    require_graph("spurious_nodes", graph)
    coupling = {node for node in graph.nodes if COUPLING in node.tags and "adjoint" in node.roles}
    entering = frozenset([edge for edge in graph.edges if edge.source in coupling])
    outputs = [node for node in graph.outputs.values() if node not in coupling]
    return frozenset(graph.nodes) - _needed(outputs, entering)


def _needed(outputs: list[Node], cut: frozenset[Edge]) -> set[Node]:
    """The nodes that outputs need when these edges are cut."""
    closed = {(edge.target, edge.slot) for edge in cut}
    needed: set[Node] = set()
    stack = list(outputs)
    while stack:
        node = stack.pop()
        if node not in needed:
            needed.add(node)
            stack.extend([arg for slot, arg in enumerate(node.args) if (node, slot) not in closed])
    return needed


if TYPE_CHECKING:
    from cgraph._shared import Json

STATES = 24  # tried where c does not fold to 0: a third of size 1, the rest of sizes from 1e-6 to 1e6
WRITTEN = 200  # nodes of c that identities are tried on
SHOWN, NAMED, FORMULA = 6, 3, 60  # coordinates in the text and in its summary, and characters of a formula
HOW = {
    "by_definition": "By definition",
    "kinetic_only": "Kinetic only",
    "kinetic_only_exact": "Kinetic only, exact",
    "chain_rule": "By the chain rule",
    "chain_rule_literal": "By the chain rule, written out",
    "newton_euler": "By Newton and Euler",
}  # how a sentence on a formulation begins
ENERGIES = {"by_definition": "L", "kinetic_only": "K"}  # what is differentiated by qd through the step


class Excess(NamedTuple):
    """What the torque of one velocity is off by.

    symbol: "dL/dq.y".  formula: in a person's names, empty where it is long.  value: at the state of the verdict.
    torque, right: the torque there by the formulation as dt tends to 0, and by the chain rule [N m or N].
    """

    symbol: str
    formula: str
    value: float
    torque: float
    right: float

    @property
    def slope(self) -> str:
        """The symbol without the velocity."""
        return self.symbol.partition(".")[0].strip("()")

    def __str__(self) -> str:
        number = f"{self.value:.6g}"
        return " = ".join(dict.fromkeys(filter(None, (self.symbol, self.formula, number))))


class Off(NamedTuple):
    """How many torques are off, and how many of their slopes d tau / d(q, qd), at a state at which something is.

    torques, slopes: of these many `of_torques`, n, and `of_slopes`, n (nq + n).

    >>> import dynamics as dyn
    >>> print(dyn.formulation_verdict(dyn.scenes.load("triple_pendulum"), "by_definition").off)
    Off are 3 of 3 torques and 15 of 18 slopes d tau/d(q, qd).
    """

    torques: int
    of_torques: int
    slopes: int
    of_slopes: int

    def __str__(self) -> str:
        slopes = f"{self.slopes} of {self.of_slopes} slopes d tau/d(q, qd)"
        return f"Off are {self.torques} of {counted(self.of_torques, 'torque')} and {slopes}."


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether the torque by a formulation is that of the chain rule; `str` of it says so and why.

    Attributes
    ----------
    formulation : str
        One of `FORMULATIONS`.
    graph : Graph
        `inverse_dynamics` by it, which a notebook paints.
    differs : bool
        Whether there are states at which it is another torque than that of the chain rule, at every dt.
    proved : bool
        Whether that it does not differ holds at every state; else at those that were tried.
    reason : str
        Why it does not differ; empty where it does.
    excess : mapping of str to Excess
        {"tau1": what it is off by}, of the outputs that differ at the state `at`, as dt tends to 0 [N m or N].
    missing : mapping of str to Excess
        {"tau1": what it lacks}, of outputs in which the spurious term has cancelled a right one.
    at : mapping of str to float
        The state of the numbers: coordinates, velocities, accelerations, t and parameters that they depend on.
    nodes : frozenset of Node
        Spurious nodes of the graph: they serve nothing but the excess.
    edges : frozenset of Edge
        Spurious edges: by them it enters the rest; there may be some where there are no such nodes.
    names : mapping of str to str
        {name in the graph: what a person calls it}.
    terms : Graph, optional
        c at any state: what each torque is off by as dt tends to 0, from q0.., qd0.., then t and parameters; None of
        a formulation that takes no derivative through the step.
    asked : bool
        Whether `at` is a state that was asked for.
    taken : str
        Sentence on what K is; empty of a formulation that differentiates L.

    Examples
    --------
    >>> import dynamics as dyn
    >>> ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["y"])
    >>> print(dyn.formulation_verdict(ball, "by_definition"))
    By definition, the torque is wrong at every dt, however small. At qdd.y=0.0236:
      tau.y is 0.0236, by the chain rule 9.8336: off by dL/dq.y = -9.81
    Why: the derivative by qd went through q = qd dt + q_old. That adds dt dL/dq to the momentum and dL/dq to its \
rate, which cancels the -dL/dq of Lagrange's equation.
    In tau.y nothing spurious is left to be marked: a right term is gone with it. -dL/dq.y = 9.81 is missing.
    """

    formulation: str
    graph: Graph
    differs: bool = False
    proved: bool = True
    reason: str = ""
    excess: Mapping[str, Excess] = field(default_factory=dict)
    missing: Mapping[str, Excess] = field(default_factory=dict)
    at: Mapping[str, float] = field(default_factory=dict)
    nodes: frozenset[Node] = frozenset()
    edges: frozenset[Edge] = frozenset()
    names: Mapping[str, str] = field(default_factory=dict)
    terms: Graph | None = None
    asked: bool = False
    taken: str = ""

    @cached_property
    def off(self) -> Off:
        """How many torques and slopes d tau / d(q, qd) are off at `at`: 0 where nothing differs."""
        found = [re.fullmatch(r"(qd?\d+)(?:_old)?", name) for name in self.graph.input_names]
        state = [each[1] for each in found if each]  # coordinates and velocities, after the step
        wrong, of_torques = 0, sum([name.startswith("tau") for name in self.graph.outputs])
        if self.terms is not None and self.excess:
            slopes = jacobian(self.terms, wrt=[name for name in state if name in self.terms.input_names])
            known = {name: self.at.get(name, 1.0) for name in slopes.input_names}  # of what no torque uses any number
            wrong = sum([value != 0.0 for value in _certain(slopes, known).values()])
        return Off(len(self.excess), of_torques, wrong, of_torques * len(state))

    def excess_at(self, at: Mapping[str, float]) -> dict[str, float]:
        """{"tau1": what it is off by} at a state, of the outputs where that is not 0, as dt tends to 0.

        Not 0 is what has a digit that rounding cannot have made, whatever its unit.

        Parameters
        ----------
        at : mapping of str to float
            {name: number} of all inputs of `terms`, finite, by the graph's names or a person's; other names are left
            alone.

        Returns
        -------
        dict of str to float
            Empty where nothing is off.

        Raises
        ------
        TypeError
            For what is no mapping.
        GraphError
            For an input that is missing.

        Examples
        --------
        >>> import dynamics as dyn
        >>> verdict = dyn.formulation_verdict(dyn.scenes.load("spring_mass"))
        >>> verdict.excess_at({"q0": 0.5, "qd0": 0.0, "I": 1.0, "k": 4.0})
        {'tau0': -2.0}
        """
        given = require_mapping("at", at, "name: number")
        if self.terms is None:
            return {}
        meant = {shown: name for name, shown in self.names.items()}
        given = {meant.get(name, name): value for name, value in given.items()}
        known = {name: given[name] for name in self.terms.input_names if name in given}
        return {name: value for name, value in _certain(self.terms, known).items() if value}

    def __str__(self) -> str:
        if not self.excess:
            return f"{self.summary} {self.taken}".strip()
        texts = [f"{self.names.get(name, name)}={value:g}" for name, value in self.at.items()]
        where = _listed(texts, len(texts) if self.asked else SHOWN)
        lines = [f"{HOW[self.formulation]}, the torque is wrong at every dt, however small. At {where}:"]
        for name, each in [*self.excess.items()][:SHOWN]:
            values = f"{each.torque:.6g}, by the chain rule {each.right:.6g}"
            lines.append(f"  {self._called.shown(name)} is {values}: off by {each}")
        lines += [f"  and {len(self.excess) - SHOWN} more"] if len(self.excess) > SHOWN else []
        return "\n".join([*lines, *self._explained(listed=True)])

    @cached_property
    def _called(self) -> Names:
        return Names(self.graph, self.names)

    @property
    def summary(self) -> str:
        """The verdict in a sentence, without numbers of a state."""
        begin = f"{HOW[self.formulation]}, the torque is"
        if not self.differs:
            return f"{begin} right: {self.reason}."
        if not self.excess:
            return f"{begin} not shown to be right: {self.reason}."
        names, terms = [self._called.shown(name) for name in self.excess], list(self.excess.values())
        if len(terms) > 1:
            off = f"{_listed(names, NAMED)} are off, each by its {terms[0].slope}"
        else:
            off = f"{names[0]} is off by {terms[0].symbol}{terms[0].formula and f' = {terms[0].formula}'}"
        return f"{begin} wrong at every dt, however small: {off}."

    @property
    def why(self) -> str:
        """Sentences on why it differs; empty where it does not."""
        if not self.excess:
            return ""
        slope = next(iter(self.excess.values())).slope
        return (
            f"Why: the derivative by qd went through {_step(slope)}. That adds dt {slope} to the momentum and {slope} "
            f"to its rate, which cancels the -{slope} of Lagrange's equation."
        )

    @property
    def lacking(self) -> str:
        """Sentence on right terms that the spurious one has cancelled; empty where there are none."""
        if not self.missing:
            return ""
        outputs, terms = _listed(map(self._called.shown, self.missing)), _listed(map(str, self.missing.values()))
        verb = "are" if len(self.missing) > 1 else "is"
        return (
            f"In {outputs} nothing spurious is left to be marked: a right term is gone with it. {terms} {verb} missing."
        )

    @property
    def explanation(self) -> str:
        """Sentences that follow the summary: why it differs, and how much of the graph is spurious; else empty."""
        return " ".join(self._explained(listed=False))

    def _explained(self, *, listed: bool) -> list[str]:
        """Sentences after the summary.  listed: whether spurious edges are told one by one."""
        spurious = spurious_text(len(self.graph.nodes), len(self.nodes), len(self.edges)) if self.edges else ""
        if listed:
            shown = [edge for edge in self.graph.edges if edge in self.edges]
            texts = [f"{self._called.text(edge.source)} -> {self._called.text(edge.target)}" for edge in shown]
            spurious += f": {_listed(texts)}" if texts else ""
        return [*filter(None, (self.why, spurious and f"{spurious}.", self.lacking, self.taken))]

    def _repr_html_(self) -> str:
        return f"{_shared.html_lines(str(self))}{_shared.render_html('graph', self.graph) or ''}"

    def to_dict(self) -> dict[str, Json]:
        """The verdict for JSON; nodes are numbered as in `graph.nodes`, an edge is [source, target, argument slot]."""
        number = {node: i for i, node in enumerate(self.graph.nodes)}
        return {
            "formulation": self.formulation,
            "differs": self.differs,
            "proved": self.proved,
            "text": str(self),
            "excess": {name: each._asdict() for name, each in self.excess.items()},
            "missing": {name: each._asdict() for name, each in self.missing.items()},
            "at": dict(self.at),
            "off": self.off._asdict(),
            "nodes": sorted([number[node] for node in self.nodes]),
            "edges": sorted([[number[edge.source], number[edge.target], edge.slot] for edge in self.edges]),
        }


@documented
def formulation_verdict(
    model: Model, formulation: str = "by_definition", at: Mapping[str, float] | None = None
) -> Verdict:
    """Whether the torque by a formulation is that of the chain rule, by how much it is off, and what is to blame.

    Parameters
    ----------
    formulation : str
        One of `FORMULATIONS`.
    at : mapping of str to float, optional
        The state after the step at which the torques are told, {name: number} by the graph's names or a person's; what
        it leaves out is as without it, where the verdict chooses a state at which something is off.

    Returns
    -------
    Verdict
        `differs`, and why; `str` of it says it in words.

    Raises
    ------
    ValueError
        For an unknown formulation.
    GraphError
        For a name in `at` that is no coordinate, velocity, acceleration, parameter or t.

    Examples
    --------
    >>> import dynamics as dyn
    >>> charge = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + q[0] * qd[1], "x y")  # in a field
    >>> verdict = dyn.formulation_verdict(charge, "kinetic_only")
    >>> verdict.differs, verdict.excess["tau0"].formula
    (True, 'qd.y')
    >>> print(dyn.formulation_verdict(dyn.scenes.load("spring_mass"), "kinetic_only"))
    Kinetic only, the torque is right: the mass matrix does not depend on q, dK/dq is 0, and the derivative through q \
= qd dt + q_old adds nothing. K is the terms of L tagged 'kinetic'.
    """
    system, names = as_system(model), display_names(model)
    formulation, stated = formulation_name(formulation), {} if at is None else require_mapping("at", at, "name: number")
    given = {name: real_number(f"at: {name!s:.80}", value) for name, value in stated.items()}
    graph = remarked(simplify(torques(system, formulation)), partial(remarks, model, formulation, torques))
    taken = system.energies.taken if formulation.startswith("kinetic") else ""
    if formulation not in THROUGH_STEP:
        reason = "every derivative in it is taken at independent q and qd"
        return Verdict(formulation, graph, reason=reason, names=names, taken=taken)
    terms, slope = _terms(system, formulation), f"d{ENERGIES[formulation]}/dq"
    if system.kinematics.quasi is not None:
        slope = f"G^T {slope}"
    alike = Verdict(formulation, graph, names=names, terms=terms, taken=taken)
    if all([node.value == 0.0 for node in terms.outputs.values()]):
        free = "L does not depend on q" if formulation == "by_definition" else "the mass matrix does not depend on q"
        reason = f"{free}, {slope} is 0, and the derivative through {_step(slope)} adds nothing"
        return replace(alike, reason=reason)
    chosen, finite = _chosen_state(system, terms, alike.excess_at)
    if not finite:
        reason = f"{slope} is finite at none of the {STATES} states tried"
        return replace(alike, differs=True, proved=False, reason=reason)
    found = alike.excess_at(chosen)
    if not found:
        reason = f"{slope} is 0 to rounding at all {finite} states tried, though its form does not prove it"
        return replace(alike, proved=False, reason=reason)
    state = chosen | _asked_state(names, chosen, given)
    there = alike.excess_at(state) if given else found
    values = {name: there.get(name, 0.0) for name in terms.outputs if name in found or name in there}
    marked = split(system, formulation, torques)
    faults = blame(system, formulation, torques, graph, marked)
    wrong, right = (_torques(*marked, state, factor) for factor in (1.0, 0.0))
    called = Names(terms, names)

    def term(name: str, sign: int) -> Excess:
        node, velocity = terms.outputs[name], system.velocities[int(name.removeprefix("tau"))]
        symbol = f"{'-' * (sign < 0)}{slope if slope[0] == 'd' else f'({slope})'}.{velocity}"
        with building(Builder()):
            text = called.text(node if sign > 0 else -node, FORMULA)
        formula = "" if "%" in text or "?" in text else text
        return Excess(symbol, formula, sign * values[name], wrong[name], right[name])

    off = Graph(graph.inputs, {name: graph.outputs[name] for name in values}).nodes
    used = {str(node.name).removesuffix("_old") for node in off if not node.args}
    return replace(
        alike,
        differs=True,
        excess={name: term(name, 1) for name in values},
        missing={name: term(name, -1) for name in values if name in faults.cancelled},
        at={name: number for name, number in state.items() if name in used},
        nodes=faults.nodes,
        edges=faults.edges,
        asked=bool(given),
    )


def remarks(model: Model, formulation: str, derive: Derive, graph: Graph) -> Remarks:
    """What a notebook shows of a graph of torques or momenta by a formulation: the verdict's words, nodes and edges."""
    verdict, names = formulation_verdict(model, formulation), display_names(model)
    if not verdict.differs:
        return Remarks(names, verdict.summary if verdict.terms is not None else "")
    nodes, edges, _ = blame(as_system(model), formulation, derive, graph)
    spurious = f"{spurious_text(len(graph.nodes), len(nodes), len(edges))}." if edges else verdict.lacking
    outputs = [
        name for tau in verdict.excess for name in (tau, tau.replace("tau", "p") + "_dot") if name in graph.outputs
    ]
    return Remarks(names, f"{verdict.summary} {spurious}", nodes, edges, outputs)


def spurious_text(nodes: int, spurious: int, edges: int) -> str:
    """Words on how many edges and nodes of a graph of so many nodes are spurious."""
    serve = f"{spurious} of {counted(nodes, 'node')} that serve{'s' * (spurious == 1)} nothing else"
    return f"Spurious: {counted(edges, 'edge')}, and {serve if spurious else 'no node'}"


def _step(slope: str) -> str:
    """The embedded relation, with G where there is one."""
    return f"q = {'G ' * slope.startswith('G')}qd dt + q_old"


def _torques(graph: Graph, through: Node, at: Mapping[str, float], factor: float) -> dict[str, float]:
    """The torques as dt tends to 0, with what comes through the step times a factor."""
    given = {"dt": 0.0, str(through.name): factor}
    known = {name: given[name] if name in given else at[name.removesuffix("_old")] for name in graph.input_names}
    return _certain(graph, known)


def _certain(graph: Graph, at: Mapping[str, float]) -> dict[str, float]:
    """The outputs at a point; 0 where rounding may have made all of it."""
    digits, values = extend.certain_digits(graph, at), graph.evaluate(at)
    return {name: float(value) if digits[name] >= 1.0 else 0.0 for name, value in values.items()}


def _terms(system: System, formulation: str) -> Graph:
    """c = G^T dE/dq at independent q and qd, as short as it gets, named as the torques that it is in."""
    build = Builder()
    (energy,) = folded([THROUGH_STEP[formulation](system)], build)
    nodes = system.kinematics.pulled_back(cotangents({energy: ONE}, system.q, build), build)
    graph = system.graph({f"tau{i}": node for i, node in enumerate(nodes)}, [*system.q, *system.qd])
    if len(graph.nodes) > WRITTEN:
        return graph
    return Graph(graph.inputs, dict(zip(graph.outputs, shortened(folded(nodes, Builder())), strict=True)))


def _listed(texts: Iterable[str], most: int = SHOWN) -> str:
    """Text of a few texts, or of the first of many."""
    shown = list(texts)
    return ", ".join(shown if len(shown) <= most else [*shown[:most], f"and {len(shown) - most} more"])


def _chosen_state(
    system: System, terms: Graph, excess_at: Callable[[dict[str, float]], dict[str, float]]
) -> tuple[dict[str, float], int]:
    """The first state at which c is not 0, else the last; and at how many it was finite.

    States are about the neutral one, always the same, of three digits, so that a person can type them again.
    """
    names, accelerations = terms.input_names, [str(node.name) for node in system.qdd]
    rng, finite, at = np.random.default_rng(0), 0, dict[str, float]()
    neutral = {f"q{i}": number for i, number in enumerate(system.kinematics.neutral)}
    for k in range(STATES):
        sizes = 10.0 ** rng.uniform(-6.0, 6.0, len(names)) if k >= STATES // 3 else np.ones(len(names))
        drawn = rng.uniform(-1.0, 1.0, len(names)) * sizes
        drawn = np.abs(drawn) if k % 2 else drawn  # where a root or a logarithm is
        numbers = {name: neutral.get(name, 0.0) + x for name, x in zip(names, drawn, strict=True)}
        at = {name: float(f"{x:.3g}") for name, x in numbers.items()} | system.parameters
        if np.isfinite([float(value) for value in terms.evaluate(at).values()]).all():
            finite += 1
            if excess_at(at):
                break
    drawn = np.random.default_rng(1).uniform(-1.0, 1.0, system.n)
    qdd = {name: float(f"{x:.3g}") for name, x in zip(accelerations, drawn, strict=True)}
    order = [*names[: system.nq + system.n], *qdd, *names[system.nq + system.n :]]
    return {name: (at | qdd)[name] for name in order}, finite


def _asked_state(names: Mapping[str, str], known: Mapping[str, float], at: Mapping[str, float]) -> dict[str, float]:
    """The state that is asked for, by the graph's names. Raises GraphError for a name that is none."""
    meant = {names.get(name, name): name for name in known}
    for name in at:
        if name not in known and name not in meant:
            raise GraphError(f"at: there is no {name!s:.80}; {or_nearest(str(name), [*meant])}")
    return {meant.get(name, name): value for name, value in at.items()}
