"""Lint: what a person declares of a graph, checked, with a proof or the nodes and edges to blame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ...core.graph import Edge, Graph
from ...core.html_text import html_table, html_text
from ...core.label import PRIMAL
from ...core.node import Node
from ...operations.table import FLAT
from ...util.json_type import Json
from ...util.require import require_graph, require_kind, require_mapping, require_sequence
from ...util.words import counted
from ..names import Name, Names, Point, joined
from ..paths import ancestors
from .cancellation import Box, Rounded, cancellations, rounded, singular_nodes
from .finding import Finding
from .independence import Group, check_independence

Pair = tuple[Group, Group]


@dataclass(frozen=True, eq=False)
class Lint:
    """The result of `lint`; `str` of it is the report.

    Attributes
    ----------
    graph : Graph
        What was checked.
    findings : tuple of Finding
        What is not as declared, and guards by equality.
    notes : tuple of Finding
        What was not declared but may be a slip, such as an input that nothing uses.
    proofs : tuple of str
        What was declared and holds, in sentences.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.lint(cg.Graph([x, y], {"f": x * y}), depends={"f": "x y"}).ok
    True
    """

    graph: Graph
    findings: tuple[Finding, ...]
    notes: tuple[Finding, ...]
    proofs: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether there is no finding: all that was declared holds."""
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

    def _repr_html_(self) -> str:
        rows = [("Finding", str(each)) for each in self.findings] + [("Holds", proof) for proof in self.proofs]
        rows += [("Note", str(each)) for each in self.notes]
        return html_table(("", ""), rows, texts=2) if rows else html_text(str(self))

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON; nodes are numbered as in `graph.nodes`, an edge is (source, target, argument slot)."""
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
    names: Mapping[str, str] | None = None,
) -> Lint:
    """Check what is declared of a graph; a declaration ends in a proof or in the nodes and edges to blame.

    Guards by equality, as `where(x == 0, 1, sin(x) / x)`, are blamed undeclared: slopes there are those of one point.

    Parameters
    ----------
    graph : Graph
        What to check.
    independent : pair of groups, or list of such pairs
        `("q0 q1", "qd0 qd1")`: neither group may depend on the other, whatever else both depend on. A group is a name,
        several names in one string, or a list of names and nodes; inner nodes have names by `cg.with_name`. A
        violation is blamed on a minimum cut of the paths, the one nearest to what should be independent, and tells what
        a derivative through it counts.
    depends : mapping, optional
        {output: inputs or nodes that it should depend on}.
    box : mapping of str to (float, float), optional
        {input: (low, high)}: looks for operations that could have an unbounded slope or no value in it, by interval
        arithmetic. None is a proof; one is a possibility, since intervals are wide.
    at : mapping of str to float, optional
        {input: number}: looks for sums that lose `digits` decimal digits or more there, of the 16 of a float64.
    digits : float
        The loss that counts, in decimal digits.
    function : str
        What the texts call the function that is differentiated, such as "L".
    names : mapping of str to str, optional
        {name in the graph: what a person calls it}, shown, and taken beside the graph's.

    Returns
    -------
    Lint
        Findings, notes and proofs.

    Raises
    ------
    GraphError
        If the graph has no node of a name, or a node is in both groups.
    ValueError
        If a box, point or number of digits is none.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> graph = cg.Graph([x, y], {"f": x * y})
    >>> print(cg.lint(graph, independent=("x", "y")))
    Holds: no path leads from y to x: x is an input.
    Holds: no path leads from x to y: y is an input.
    """
    require_graph("lint", graph)
    if isinstance(digits, bool) or not isinstance(digits, (int, float)) or not digits > 0.0:
        raise ValueError(f"digits must be a positive number, got {digits!r:.60}")
    require_kind("function", function, str, "the name of one")
    known = Names(graph, names)
    findings = _guards_by_equality(known)
    proofs: list[str] = []
    for first, second in _pairs(independent):
        violations, held = check_independence(known, first, second, function)
        findings += violations
        proofs += held
    checks: list[tuple[list[Finding], str]] = []  # and what holds where there is no finding
    if depends is not None and require_mapping("depends", depends, "output: names"):
        checks.append((_missing_dependences(known, depends), "every output depends on what was declared for it."))
    if box is not None:
        proof = f"no slope is unbounded in the box, of {counted(len(known.number), 'operation')}."
        checks.append((singular_nodes(known, box), proof))
    if at is not None:
        errors = rounded(known, at)
        checks.append((cancellations(known, errors, digits), _accuracy(graph, errors, digits)))
    for found, proof in checks:
        findings += found
        proofs += [] if found else [proof]
    return Lint(graph, tuple(findings), tuple(_unused_inputs(known)), tuple(proofs))


def _pairs(independent: Pair | Sequence[Pair]) -> list[Pair]:
    """The pairs: a tuple of two is one itself, as are two names in a list; a list holds pairs.

    Raises ValueError for two tuples of two in a tuple, which may be either.
    """
    if isinstance(independent, (str, Node)):
        raise TypeError(f"independent: expected pairs of groups, got {independent!r:.60}")
    pairs = list(require_sequence("independent", independent, "pairs of groups"))
    named = all([isinstance(group, (str, Node)) for group in pairs])
    if len(pairs) == 2 and (named or isinstance(independent, tuple)):
        if isinstance(independent, tuple) and all([isinstance(each, tuple) and len(each) == 2 for each in pairs]):
            raise ValueError(
                f"independent: {independent!r:.60} may be one pair of groups or two pairs; give groups as strings or "
                "lists, and several pairs in a list"
            )
        return [(pairs[0], pairs[1])]
    for pair in pairs:
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
            raise ValueError(f"independent: each entry must be a pair of groups, got {pair!r:.60}")
    return [(first, second) for first, second in pairs]


_GUARD = """{}: at exactly this point the slope is that of the branch chosen there, which holds nowhere beside it; \
choose a series near it by <, or take a function of the library, such as abs(x) for sign(x) * x."""
_COMPARED = {"where": 1, "equal": 2, "not_equal": 2}  # arguments
_MOST = 32  # factors that are looked at


def _guards_by_equality(names: Names) -> list[Finding]:
    """Choices by == or by what is not 0 that somebody wrote of what is used besides, and products sign(x) * x."""
    nodes, flat = names.graph.nodes, set[Node]()
    for node in nodes:
        if node.value is not None or node.op.name in FLAT or (node.args and flat.issuperset(node.args)):
            flat.add(node)
    used = {arg for node in nodes if node not in flat for arg in node.args[node.op.name == "where" :]} - flat
    findings = []
    for node in nodes:
        by = [arg for arg in node.args[: _COMPARED.get(node.op.name, 0)] if arg not in flat]
        signed = _is_signed(node) and not any(map(_is_signed, node.args))
        if PRIMAL in node.roles and (signed or not used.isdisjoint(ancestors(by))):
            data: dict[str, Json] = {"number": names.number[node], "tags": sorted(node.tags)}
            findings.append(Finding("guard by equality", _GUARD.format(names.line(node)), (node,), data=data))
    return findings


def _is_signed(node: Node) -> bool:
    """Whether sign(x) and x are factors of a product, or of products that are its factors."""
    factors = [*node.args] if node.op.name == "mul" else []
    for x in factors:  # which grow in number
        factors += x.args if x.op.name == "mul" and len(factors) < _MOST else ()
    return any([x.op.name == "sign" and x.args[0] in factors for x in factors])


def _unused_inputs(names: Names) -> list[Finding]:
    """The inputs that no output depends on."""
    used = set(names.graph.nodes)
    unused = [(names.text(node), node) for node in names.graph.inputs if node not in used]
    return [
        Finding("unused input", f"Nothing uses the input {name}.", (node,), data={"input": name})
        for name, node in unused
    ]


def _missing_dependences(names: Names, depends: Mapping[Name, Name | Sequence[Name]]) -> list[Finding]:
    """The outputs that do not depend on each of the nodes declared for them."""
    findings = []
    for output, declared in depends.items():
        sink = names.output(output)
        reached = ancestors([sink])
        inputs = [names.text(node) for node in names.graph.inputs if node in reached]
        for node in names.group(declared):
            if node not in reached:
                to, origin = names.called(output), names.text(node)
                text = f"{to} does not depend on {origin}; it is made from {joined(inputs, 12) or 'numbers'}."
                data = {"output": to, "input": origin, "made_from_inputs": inputs}
                findings.append(Finding("missing dependence", text, (sink, node), data=data))
    return findings


def _accuracy(graph: Graph, errors: Rounded, digits: float) -> str:
    certain = {name: errors.digits(node) for name, node in graph.outputs.items()}
    name = min(certain, key=lambda output: certain[output])
    least = certain[name]
    rest = f"; rounding leaves {name} {least:.0f} digits, no output less" if math.isfinite(least) else ""
    return f"no sum loses {digits:g} digits at this point{rest}."
