"""The verdict on a formulation: whether it differs from the chain rule, by how much, and what in its graph is to blame.

With q = G qd dt + q_old in it the derivative by qd of E, which is L by definition or K alone, is p + dt c, so that its
rate exceeds that of p by c = G^T dE/dq at every dt, however small. It is the torque of the chain rule if and only if c
is 0 at every state.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cgraph import Edge, Graph, Node, extend
from cgraph.extend import Builder, Names, building, cotangents, folded, require_mapping, shortened

from ...systems.display_names import display_names
from ...systems.kinematics import ONE
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented
from .blame import blame
from .formulations import THROUGH_STEP, formulation_name, inverse_dynamics, torques

if TYPE_CHECKING:
    from cgraph.extend import Json

STATES = 24  # tried where c does not fold to 0: a third of size 1, the rest of sizes from 1e-6 to 1e6
WRITTEN = 200  # nodes of c that identities are tried on
SHOWN, FORMULA = 6, 60  # coordinates that the text lists, and characters of a formula in it
_DIFFERS = "This is not the torque of the chain rule, however small dt is"


class Excess(NamedTuple):
    """Excess in the torque of one velocity.

    symbol: "dL/dq.y".  formula: in a person's names, empty where it is long.  value: at the state of the verdict.
    """

    symbol: str
    formula: str
    value: float

    def __str__(self) -> str:
        number = f"{self.value:.6g}"
        return " = ".join(dict.fromkeys(filter(None, (self.symbol, self.formula, number))))


@dataclass(frozen=True, eq=False)
class Verdict:
    """Whether the torque by a formulation is that of the chain rule; `str` of it says so and why.

    Attributes
    ----------
    formulation : str
        One of `FORMULATIONS`.
    graph : Graph
        `inverse_dynamics` by it.
    differs : bool
        Whether there are states at which it is another torque than that of the chain rule, at every dt.
    proved : bool
        Whether that it does not differ holds at every state; else at those that were tried.
    reason : str
        Why it does not differ; empty where it does.
    excess : mapping of str to Excess
        {"tau1": what it has too much}, of the outputs that differ at the state `at`, as dt tends to 0 [N m or N].
    missing : mapping of str to Excess
        {"tau1": what it lacks}, of outputs in which the wrong term has cancelled a right one.
    at : mapping of str to float
        The state of the numbers: the inputs that they depend on.
    nodes : frozenset of Node
        Nodes of the graph that serve nothing but the excess.
    edges : frozenset of Edge
        Edges by which it enters the rest; there may be some where there are no such nodes.
    names : mapping of str to str
        {name in the graph: what a person calls it}.
    terms : Graph, optional
        c at any state: what each torque has too much as dt tends to 0, from q0.., qd0.., then t and parameters; None of
        a formulation that takes no derivative through the step.

    Examples
    --------
    >>> import dynamics as dyn
    >>> ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["y"])
    >>> print(dyn.formulation_verdict(ball, "by_definition"))
    This is not the torque of the chain rule, however small dt is. Too much in it:
      tau.y  dL/dq.y = -9.81
    In tau.y this cancels a right term, and no edge is left to be marked. Missing: -dL/dq.y = 9.81.
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

    def excess_at(self, at: Mapping[str, float]) -> dict[str, float]:
        """{"tau1": what it has too much} at a state, of the outputs where that is not 0, as dt tends to 0.

        Not 0 is what has a digit that rounding cannot have made, whatever its unit.

        Parameters
        ----------
        at : mapping of str to float
            {name: number} of all inputs of `terms`, finite; other names are left alone.

        Returns
        -------
        dict of str to float
            Empty where nothing is too much.

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
        known = {name: given[name] for name in self.terms.input_names if name in given}
        digits, values = extend.certain_digits(self.terms, known), self.terms.evaluate(known)
        return {name: float(value) for name, value in values.items() if value and digits[name] >= 1.0}

    def __str__(self) -> str:
        if not self.excess:
            return self.summary
        called = Names(self.graph, self.names)
        where = _listed([f"{called.shown(name)}={value:g}" for name, value in self.at.items()])
        lines = [f"{_DIFFERS}. Too much in it{where and f' at {where}'}:"]
        width = max([len(called.shown(name)) for name in self.excess])
        lines += [f"  {called.shown(name):<{width}}  {each}" for name, each in [*self.excess.items()][:SHOWN]]
        lines += [f"  and {len(self.excess) - SHOWN} more"] if len(self.excess) > SHOWN else []
        return "\n".join([*lines, *[self._blamed(called)] * bool(self.edges), *[self.lacking] * bool(self.missing)])

    @property
    def summary(self) -> str:
        """The verdict in a sentence, without numbers of a state."""
        if not self.differs:
            return f"Holds: this is the torque of the chain rule: {self.reason}."
        if not self.excess:
            return f"This is not shown to be the torque of the chain rule: {self.reason}."
        called = Names(self.graph, self.names)
        terms = [f"{called.shown(name)} has {each.symbol}" for name, each in self.excess.items()]
        terms = [
            f"{term}{each.formula and f' = {each.formula}'}"
            for term, each in zip(terms, self.excess.values(), strict=True)
        ]
        return f"{_DIFFERS}: {_listed(terms)} too much."

    @property
    def lacking(self) -> str:
        """Sentence on right terms that the wrong one has cancelled; empty where there are none."""
        if not self.missing:
            return ""
        called = Names(self.graph, self.names)
        outputs, terms = (_listed(each) for each in (map(called.shown, self.missing), map(str, self.missing.values())))
        return f"In {outputs} this cancels a right term, and no edge is left to be marked. Missing: {terms}."

    def _blamed(self, called: Names) -> str:
        edges = [edge for edge in self.graph.edges if edge in self.edges]
        texts = _listed([f"{called.text(edge.source)} -> {called.text(edge.target)}" for edge in edges])
        count = len(self.nodes)
        alone = f"with {count} of {len(self.graph.nodes)} nodes, which serve{'s' * (count == 1)} nothing else"
        what = "this edge" if len(edges) == 1 else f"these {len(edges)} edges"
        return f"There by mistake: {what}, {alone if count else 'and no node by itself'}: {texts}."

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
            "nodes": sorted([number[node] for node in self.nodes]),
            "edges": sorted([[number[edge.source], number[edge.target], edge.slot] for edge in self.edges]),
        }


@documented
def formulation_verdict(model: Model, formulation: str = "by_definition") -> Verdict:
    """Whether the torque by a formulation is that of the chain rule, by how much it is off, and what is to blame.

    Parameters
    ----------
    formulation : str
        One of `FORMULATIONS`.

    Returns
    -------
    Verdict
        `differs`, and why; `str` of it says it in words.

    Raises
    ------
    ValueError
        For an unknown formulation.

    Examples
    --------
    >>> import dynamics as dyn
    >>> charge = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + q[0] * qd[1], "x y")  # in a field
    >>> verdict = dyn.formulation_verdict(charge, "kinetic_only")
    >>> verdict.differs, verdict.excess["tau0"].formula
    (True, 'qd.y')
    >>> print(dyn.formulation_verdict(dyn.scenes.load("spring_mass"), "kinetic_only"))
    Holds: this is the torque of the chain rule: dK/dq is 0, so nothing comes through q = qd dt + q_old.
    """
    system, names = as_system(model), display_names(model)
    formulation = formulation_name(formulation)
    graph = inverse_dynamics(model, formulation)
    if formulation not in THROUGH_STEP:
        return Verdict(formulation, graph, reason="no derivative in it is taken through a step of time", names=names)
    terms, quasi = _terms(system, formulation), system.kinematics.quasi is not None
    slope = f"{'G^T ' * quasi}{'dL/dq' if formulation == 'by_definition' else 'dK/dq'}"
    alike = Verdict(formulation, graph, names=names, terms=terms)
    if all([node.value == 0.0 for node in terms.outputs.values()]):
        return replace(alike, reason=f"{slope} is 0, so nothing comes through q = qd dt + q_old")
    at, finite = _state(system, alike)
    if not finite:
        reason = f"{slope} is finite at none of the {STATES} states tried"
        return replace(alike, differs=True, proved=False, reason=reason)
    values = alike.excess_at(at)
    if not values:
        reason = f"{slope} is 0 to rounding at all {finite} states tried, though its form does not prove it"
        return replace(alike, proved=False, reason=reason)
    nodes, edges, cancelled = blame(system, formulation, torques, graph)
    called = Names(terms, names)

    def term(name: str, sign: int) -> Excess:
        node, velocity = terms.outputs[name], system.velocities[int(name.removeprefix("tau"))]
        symbol = f"{'-' * (sign < 0)}{f'({slope})' if quasi else slope}.{velocity}"
        with building(Builder()):
            text = called.text(node if sign > 0 else -node, FORMULA)
        return Excess(symbol, "" if "%" in text or "?" in text else text, sign * values[name])

    used = {node.name for node in Graph(terms.inputs, {name: terms.outputs[name] for name in values}).nodes}
    return replace(
        alike,
        differs=True,
        excess={name: term(name, 1) for name in values},
        missing={name: term(name, -1) for name in values if name in cancelled},
        at={name: at[name] for name in terms.input_names if name in used},
        nodes=nodes,
        edges=edges,
    )


def _terms(system: System, formulation: str) -> Graph:
    """c = G^T dE/dq at independent q and qd, as short as it gets, named as the torques that it is in."""
    build = Builder()
    (energy,) = folded([THROUGH_STEP[formulation](system)], build)
    nodes = system.kinematics.pulled_back(cotangents({energy: ONE}, system.q, build), build)
    graph = system.graph({f"tau{i}": node for i, node in enumerate(nodes)}, [*system.q, *system.qd])
    if len(graph.nodes) > WRITTEN:
        return graph
    return Graph(graph.inputs, dict(zip(graph.outputs, shortened(folded(nodes, Builder())), strict=True)))


def _state(system: System, verdict: Verdict) -> tuple[dict[str, float], int]:
    """The first state at which c is not 0, else the last; and at how many it was finite.

    States are about the neutral one, always the same, of three digits, so that a person can type them again.
    """
    assert verdict.terms is not None
    names = verdict.terms.input_names
    rng, finite, at = np.random.default_rng(0), 0, dict[str, float]()
    neutral = {f"q{i}": number for i, number in enumerate(system.kinematics.neutral)}
    for k in range(STATES):
        sizes = 10.0 ** rng.uniform(-6.0, 6.0, len(names)) if k >= STATES // 3 else np.ones(len(names))
        drawn = rng.uniform(-1.0, 1.0, len(names)) * sizes
        drawn = np.abs(drawn) if k % 2 else drawn  # where a root or a logarithm is
        numbers = {name: neutral.get(name, 0.0) + x for name, x in zip(names, drawn, strict=True)}
        at = {name: float(f"{x:.3g}") for name, x in numbers.items()} | system.parameters
        if np.isfinite([float(value) for value in verdict.terms.evaluate(at).values()]).all():
            finite += 1
            if verdict.excess_at(at):
                break
    return at, finite


def _listed(texts: Iterable[str]) -> str:
    """Text of a few texts, or of the first of many."""
    shown = list(texts)
    return ", ".join(shown if len(shown) <= SHOWN else [*shown[:SHOWN], f"and {len(shown) - SHOWN} more"])
