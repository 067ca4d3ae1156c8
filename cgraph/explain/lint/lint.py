"""Lint: what a person declares of a graph, checked, with a proof or the blame for each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...core.graph import Graph
from ...core.node import Edge, Node
from ..edge_partials import Point
from ..names import Name, Names, many
from .cancellation import cancellations, rounded
from .dependence import missing_dependences, unused_inputs
from .finding import Finding
from .independence import Group, check_independence
from .singular import Box, singular_nodes

Pair = tuple[Group, Group]


@dataclass(frozen=True, eq=False)
class Lint:
    """What `lint` found; `str` of it is the report.

    findings: what is not as declared.  notes: what nobody declared but may be a slip, such as an input that nothing
    uses.  proofs: what was declared and holds.
    """

    graph: Graph
    findings: tuple[Finding, ...]
    notes: tuple[Finding, ...]
    proofs: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether all that was declared holds."""
        return not self.findings

    @property
    def nodes(self) -> frozenset[Node]:
        """Nodes to mark in a drawing: those that the findings blame."""
        known = set(self.graph.nodes)
        return frozenset([node for finding in self.findings for node in finding.nodes if node in known])

    @property
    def edges(self) -> frozenset[Edge]:
        """Edges to mark in a drawing: those that would have to be cut."""
        return frozenset([edge for finding in self.findings for edge in finding.edges])

    def __str__(self) -> str:
        parts = [str(finding) for finding in self.findings]
        parts += [f"Holds: {proof}" for proof in self.proofs]
        parts += [f"Note: {note}" for note in self.notes]
        return "\n".join(parts) or "Nothing was declared, and every input is used."

    def to_dict(self) -> dict[str, Any]:
        """The same for JSON; nodes are numbered as in `graph.nodes`, an edge is (source, target, argument slot)."""
        return {
            "ok": self.ok,
            "findings": [finding.to_dict() for finding in self.findings],
            "notes": [note.to_dict() for note in self.notes],
            "proofs": list(self.proofs),
        }


def lint(
    graph: Graph,
    *,
    independent: Pair | Sequence[Pair] = (),
    depends: Mapping[Name, Name | Sequence[Name]] | None = None,
    box: Box | None = None,
    at: Point | None = None,
    digits: float = 4.0,
    function: str = "f",
) -> Lint:
    """Check what is declared of a graph; each declaration ends in a proof or in the nodes and edges to blame.

    independent: pairs of groups, neither of which may be made from the other, whatever else both are made from:
        `("q0 q1", "qd0 qd1")` or a list of such pairs. A group is a name or several in one string, or a sequence of
        names and nodes; inner nodes have names by `cg.with_name`. A violation is blamed on the fewest edges that would
        have to be cut, those nearest to what should be independent, and tells what a derivative through them counts.
    function: what the texts call the function that is differentiated, such as "L".
    depends: {output: inputs or nodes that it should depend on}.
    box: {input: (low, high)}; finds operations that could have an unbounded slope or no value in it, by interval
        arithmetic. None found is a proof; one found is a possibility, since intervals are wide.
    at: {input: number}; finds sums that lose `digits` decimal digits or more there, of the 16 that a float64 has.

    Raises GraphError for a name that the graph does not have or a node in both groups; ValueError for a box, point or
    number of digits that is none.
    """
    names = Names(graph)
    findings: list[Finding] = []
    proofs: list[str] = []
    for first, second in _pairs(independent):
        found, proved = check_independence(names, first, second, function)
        findings += found
        proofs += proved
    if depends:
        found = missing_dependences(names, depends)
        findings += found
        if not found:
            proofs.append("every output depends on what was declared for it.")
    if box is not None:
        found = singular_nodes(names, box)
        findings += found
        if not found:
            proofs.append(f"no slope is unbounded in the box, of {many(len(names.number), 'operation')}.")
    if at is not None:
        if not isinstance(digits, (int, float)) or not digits > 0.0:
            raise ValueError(f"digits must be a positive number, got {digits!r}")
        found = cancellations(names, at, digits)
        findings += found
        if not found:
            proofs.append(_accuracy(names, at, digits))
    return Lint(graph, tuple(findings), tuple(unused_inputs(names)), tuple(proofs))


def _pairs(independent: Pair | Sequence[Pair]) -> list[Pair]:
    """The pairs, also where one pair of strings or nodes was given alone."""
    if isinstance(independent, (str, Node)):
        raise TypeError(f"independent: expected pairs of groups, got {independent!r:.60}")
    given: list[Any] = list(independent)
    if len(given) == 2 and all([isinstance(each, (str, Node)) for each in given]):
        return [(given[0], given[1])]
    for pair in given:
        if isinstance(pair, (str, Node)) or len(pair) != 2:
            raise ValueError(f"independent: each entry must be a pair of groups, got {pair!r:.60}")
    return [(first, second) for first, second in given]


def _accuracy(names: Names, at: Point, digits: float) -> str:
    found = rounded(names, at)
    certain = {name: found.digits(node) for name, node in names.graph.outputs.items()}
    name = min(certain, key=lambda each: certain[each])
    least = certain[name]
    rest = f"; rounding leaves {name} {least:.0f} digits, no output less" if math.isfinite(least) else ""
    return f"no sum loses {digits:g} digits at this point{rest}."
