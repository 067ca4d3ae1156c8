"""Comparison of two graphs by structure: common nodes, and nodes of one of them alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from ..core.checks import GraphError
from ..core.graph import Graph, largest_first
from ..core.html_text import html_lines
from ..core.node import VARIABLE, Node, variable
from ..util.json_type import Json
from ..util.require import require_choice, require_graph, require_sequence, require_texts
from ..util.words import counted
from ..writing.structure_hash import node_hashes
from .names import Names, joined

Classify = Callable[[Graph], Callable[[Node], str]]
Side = Literal["left", "right"]
_SHOWN = 12  # classes that the text lists


class Overlay(NamedTuple):
    """Two graphs as one, their common nodes once, and what only one of them has: to be marked in a drawing."""

    graph: Graph
    only_left: frozenset[Node]
    only_right: frozenset[Node]


@dataclass(frozen=True, eq=False)
class Comparison:
    """The nodes of two graphs, paired by structure; made by `compare`. `str` of it is the summary.

    Attributes
    ----------
    left, right : Graph
        The two graphs.
    common : tuple of (Node, Node)
        Pairs (node of left, node of right) that compute the same; a node is in one pair at most.
    only_left, only_right : tuple of Node
        The other nodes, in the order of their graph.
    same_outputs, other_outputs : tuple of str
        Names that both graphs have, computed alike or not.
    atoms : dict of Node to str
        The nodes that count as a variable of that name.
    classify : callable
        Graph -> (node -> name of its class).
    names : mapping of str to str
        {name in the graphs: what a person calls it}.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> print(cg.compare(cg.Graph([x], {"y": cg.sin(x)}), cg.Graph([x], {"y": cg.sin(x) + x})))
    2 nodes left, 3 right: 2 in both, 0 only left, 1 only right.
    Computed otherwise: y.
    Only right:
          1  primal
    """

    left: Graph
    right: Graph
    common: tuple[tuple[Node, Node], ...]
    only_left: tuple[Node, ...]
    only_right: tuple[Node, ...]
    same_outputs: tuple[str, ...]
    other_outputs: tuple[str, ...]
    atoms: dict[Node, str]
    classify: Classify
    names: Mapping[str, str] = field(default_factory=dict)

    def classes(self, side: Side) -> dict[str, int]:
        """{class: number of nodes that only that side has}, the largest first."""
        require_choice("side", side, ("left", "right"))
        graph, nodes = (self.left, self.only_left) if side == "left" else (self.right, self.only_right)
        name_of = self.classify(graph)
        return largest_first(Counter([name_of(node) for node in nodes]))

    def __str__(self) -> str:
        sizes = f"{counted(len(self.left.nodes), 'node')} left, {len(self.right.nodes)} right"
        only = f"{len(self.only_left)} only left, {len(self.only_right)} only right"
        lines = [f"{sizes}: {len(self.common)} in both, {only}."]
        for how, outputs in (("alike", self.same_outputs), ("otherwise", self.other_outputs)):
            if outputs:
                lines.append(f"Computed {how}: {joined([self.names.get(name, name) for name in outputs])}.")
        sides: tuple[Side, Side] = ("left", "right")
        for side in sides:
            if rows := list(self.classes(side).items()):
                lines.append(f"Only {side}:")
                lines += [f"  {number:>5}  {name}" for name, number in rows[:_SHOWN]]
                if rest := rows[_SHOWN:]:
                    lines.append(f"  {sum([number for _, number in rest]):>5}  in {len(rest)} more classes")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return html_lines(str(self))

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON; nodes are numbered as in `graph.nodes` of their graph."""
        left, right = ({node: i for i, node in enumerate(graph.nodes)} for graph in (self.left, self.right))
        return {
            "common": [[left[a], right[b]] for a, b in self.common],
            "only_left": _described(self.left, self.only_left, self.classify, self.names),
            "only_right": _described(self.right, self.only_right, self.classify, self.names),
            "left_classes": self.classes("left"),
            "right_classes": self.classes("right"),
            "same_outputs": list(self.same_outputs),
            "other_outputs": list(self.other_outputs),
        }

    def overlay(self) -> Overlay:
        """The union of the two graphs, for a single drawing.

        An output that both compute alike keeps its name, any other is `left tau0` or `right tau0`. An atom is drawn as
        the variable of its name; what a graph computes it from ends in a separate output, `right q0`.
        """
        outputs: dict[str, Node] = {}
        marked: list[set[Node]] = []
        inputs: dict[Node, None] = {}
        shared: dict[Node, Node] = {}  # {node of right: its partner in the overlay}
        for side, graph, only in (("left", self.left, self.only_left), ("right", self.right, self.only_right)):
            copies: dict[Node, Node] = {}
            mark = set()
            for node in graph.nodes:
                args = tuple([copies[arg] for arg in node.args])
                copy = node if args == node.args else Node(node.op, args, node.label, name=node.name)
                if node.args and node in self.atoms:
                    outputs[f"{side} {self.atoms[node]}"] = copy
                    mark.add(copy)
                    copy = variable(self.atoms[node])
                copies[node] = shared.get(node, copy)
            for name, node in graph.outputs.items():
                outputs[name if name in self.same_outputs else f"{side} {name}"] = copies[node]
            inputs |= dict.fromkeys([*graph.inputs, *[node for node in copies.values() if node.op is VARIABLE]])
            marked.append(mark | {copies[node] for node in only})
            if side == "left":
                shared = {b: copies[a] for a, b in self.common}
        both = Graph(list(inputs), outputs)
        left, right = (frozenset(mark.intersection(both.nodes)) for mark in marked)
        return Overlay(both, left, right)


def compare(
    left: Graph,
    right: Graph,
    *,
    atoms: str | Iterable[str] = (),
    classify: Classify | None = None,
    names: Mapping[str, str] | None = None,
) -> Comparison:
    """Compare two graphs by structure.

    Two nodes are alike when they are the same operation on alike arguments, in any order where they commute, the same
    constant to the last bit, or variables of one name. Tags, roles and names of operations do not count. Of several
    alike nodes in a graph, each is paired at most once.

    Parameters
    ----------
    left, right : Graph
        The two graphs.
    atoms : str or iterable of str
        Names that count as variables in either graph, whatever computes them there, such as "q0 qd0" where one graph
        has them as inputs and the other computes them.
    classify : callable, optional
        Called with a graph, it returns a function from nodes to names of classes, by which the summary counts; by
        default, a node's roles and tags.
    names : mapping of str to str, optional
        {name in the graphs: what a person calls it}, shown in the summary.

    Returns
    -------
    Comparison
        The pairs, and what only one graph has.

    Raises
    ------
    GraphError
        If neither graph has a node of an atom's name.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> found = cg.compare(cg.Graph([x], {"y": cg.sin(x)}), cg.Graph([x], {"y": cg.sin(x) + x}))
    >>> len(found.common), found.only_right
    (2, (<node add>,))
    """
    for graph in (left, right):
        require_graph("compare", graph)
    atoms = atoms.replace(",", " ").split() if isinstance(atoms, str) else atoms
    chosen = set(require_sequence("atoms", atoms, "names", str))
    if classify is not None and (not callable(classify) or isinstance(classify, type)):
        raise TypeError(f"classify must be a function of a graph, got {type(classify).__name__}: {classify!r:.60}")
    named = {node: node.name for graph in (left, right) for node in graph.nodes if node.name in chosen}
    unused = [name for graph in (left, right) for name in graph.input_names]  # an input that nothing uses is no node
    if missing := chosen.difference(named.values(), unused):
        raise GraphError(f"neither graph has a node called {', '.join(sorted(map(str, missing)))}")
    stand_ins = {node: name for node, name in named.items() if name is not None}
    left_hashes, right_hashes = (node_hashes(graph.nodes, stand_ins) for graph in (left, right))
    common = _paired(left_hashes, right_hashes)
    lefts, rights = {a for a, _ in common}, {b for _, b in common}
    only_left = tuple([node for node in left.nodes if node not in lefts])
    only_right = tuple([node for node in right.nodes if node not in rights])
    shared = [name for name in left.outputs if name in right.outputs]
    same = [name for name in shared if left_hashes[left.outputs[name]] == right_hashes[right.outputs[name]]]
    return Comparison(
        left,
        right,
        tuple(common),
        only_left,
        only_right,
        tuple(same),
        tuple([name for name in shared if name not in same]),
        stand_ins,
        classify or _by_label,
        require_texts("names", names),
    )


def _paired(left: dict[Node, bytes], right: dict[Node, bytes]) -> list[tuple[Node, Node]]:
    """Pairs of alike nodes, in the order of the right graph; a node that is in both graphs goes with itself."""
    partner = {node: node for node, digest in right.items() if left.get(node) == digest}
    free: dict[bytes, list[Node]] = {}
    for node, digest in reversed(left.items()):
        if node not in partner:
            free.setdefault(digest, []).append(node)
    for node, digest in right.items():
        if node not in partner and free.get(digest):
            partner[node] = free[digest].pop()
    return [(partner[node], node) for node in right if node in partner]


def _by_label(graph: Graph) -> Callable[[Node], str]:
    """Classes such as `adjoint, tangent; kinetic, link 3`, as in the listing."""
    return lambda node: "; ".join([", ".join(sorted(part)) for part in (node.roles, node.tags) if part]) or node.op.name


def _described(
    graph: Graph, nodes: Iterable[Node], classify: Classify, called: Mapping[str, str]
) -> list[dict[str, Json]]:
    names, name_of = Names(graph, called), classify(graph)
    number = {node: i for i, node in enumerate(graph.nodes)}
    return [{"node": number[node], "text": names.line(node), "class": name_of(node)} for node in nodes]
