"""Boxes and arrows of a drawing of a graph: a box for every node and output, an arrow for every edge."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from cgraph import Edge, Graph, Node
from cgraph._shared import columns, counted
from cgraph.extend import Names

from .. import theme
from .draw_shapes import BOX, LEAF_SIZE, Arrow, Attributes, Box

ClusterRule = Callable[[Node], str | None]

_CONSTANT = {"shape": "box", "style": "filled", "height": "0.24", "margin": "0.05,0.02", "fontsize": "12"}
_OPERATION = {"shape": "ellipse", "style": "filled", "height": "0.42", "width": "0.42", "margin": "0.04,0.02"}
_OUTPUT = {**LEAF_SIZE, "shape": "box", "style": "filled", "peripheries": "2"}
_PART = {"shape": "box3d", "style": "filled", "margin": "0.16,0.08"}


@dataclass
class Plan:
    """All shapes and lines of a graph, in the order in which they are written; arguments as of `to_dot`.

    Raises ValueError for a node or a collapsed tag that the graph does not have.
    """

    graph: Graph
    names: Mapping[str, str]
    formulas: Mapping[Node, str]
    marks: Mapping[Node, theme.Paint]
    marked_edges: frozenset[Edge]
    wrong_outputs: frozenset[str]
    cluster_of: ClusterRule
    collapse: tuple[str, ...]
    only: frozenset[Node]

    def __post_init__(self) -> None:
        self.number = {node: i for i, node in enumerate(self.graph.nodes)}
        for what, nodes in (("marked", [*self.marks]), ("drawn", [*self.only])):
            if strange := [node for node in nodes if node not in self.number]:
                raise ValueError(
                    f"{len(strange)} of {len(nodes)} {what} nodes are not in the graph, such as {strange[0]!r}"
                )
        carried = set().union(*(node.tags for node in self.graph.nodes))
        for tag in self.collapse:
            if tag not in carried:
                known = ", ".join(sorted(carried, key=theme.natural_order)) or "none"
                raise ValueError(f"cannot collapse {tag!r}: no node carries that tag (tags: {known})")
        tags = [*enumerate(self.collapse)][::-1]  # a node with several of them belongs to the first
        self.part = {node: f"c{i}" for node in self.graph.nodes for i, tag in tags if tag in node.tags}
        self.listed = Names(self.graph)  # who has the %number of the listing
        self.edges = [
            edge
            for edge in self.graph.edges
            if edge.target in self.only and (edge.source in self.only or edge.source.value is not None)
        ]
        self.outputs = [
            (i, name, node) for i, (name, node) in enumerate(self.graph.outputs.items()) if node in self.only
        ]

    def boxes(self) -> Iterator[Box]:
        """Collapsed parts, nodes, a copy of a number for each use of it, and outputs."""
        yield from self._part_boxes()
        for node in self.graph.nodes:
            if node in self.only and node.value is None and node not in self.part:
                yield self._node_box(node, f"n{self.number[node]}", self.cluster_of(node))
        for edge in self.edges:
            if edge.source.value is not None and edge.target not in self.part:  # a part has its numbers inside
                yield self._node_box(edge.source, self._tail(edge), self.cluster_of(edge.target))
        for i, name, node in self.outputs:
            if node.value is not None:
                yield self._node_box(node, f"n{self.number[node]}-o{i}", None)
            about = f"output {name}, computed by {self._told(node)}"
            kind = theme.WRONG_OUTPUT if name in self.wrong_outputs else theme.OUTPUT
            yield Box(f"o{i}", kind, {**_OUTPUT, "label": self._shown(name), "tooltip": about})

    def arrows(self) -> Iterator[Arrow]:
        """An arrow for each edge between nodes, then one for all from one part to another, then those to outputs."""
        merged: dict[tuple[str, str], list[Edge]] = {}
        for edge in self.edges:
            if edge.source not in self.part and edge.target not in self.part:
                yield self._node_arrow(edge)
                continue
            tail, head = (self.part.get(node, f"n{self.number[node]}") for node in (edge.source, edge.target))
            if tail != head and edge.source.value is None:
                merged.setdefault((tail, head), []).append(edge)
        for (tail, head), edges in merged.items():
            mark = next(filter(None, map(self._mark_of, edges)), None)
            ends = f"from {self._told(edges[0].source)} to {self._told(edges[0].target)}"
            about = f"{counted(len(edges), 'edge')} {ends}"
            attributes = {"id": f"e{tail.removeprefix('n')}-{head.removeprefix('n')}", "edgetooltip": about}
            if len(edges) > 1:
                attributes["label"] = f"×{len(edges)}"
            yield tail, head, {**attributes, **_line(mark)}
        for i, _, node in self.outputs:
            number = self.number[node]
            tail = self.part.get(node, f"n{number}") if node.value is None else f"n{number}-o{i}"
            yield tail, f"o{i}", {"id": f"e{number}-o{i}", **_line(self.marks.get(node))}

    def _told(self, node: Node) -> str:
        """Name of a node in a tooltip: the name of its part, the %number of the listing, its name or its value."""
        if node in self.part:
            return self.part[node]
        return f"%{self.listed.number[node]}" if node.args else self.listed.short(node)

    def _shown(self, name: str) -> str:
        return self.names[name] if name in self.names else theme.pretty(name)

    def _mark_of(self, edge: Edge) -> theme.Paint | None:
        return self.marks.get(edge.source) or (theme.MARKS[0] if edge in self.marked_edges else None)

    def _tail(self, edge: Edge) -> str:
        """Id of the shape that an arrow starts from, of a number its copy for this use."""
        source, target = self.number[edge.source], self.number[edge.target]
        return f"n{source}" if edge.source.value is None else f"n{source}-{target}-{edge.slot}"

    def _part_boxes(self) -> Iterator[Box]:
        sizes = Counter(self.part.values())
        marked = Counter((part, self.marks[node]) for node, part in self.part.items() if node in self.marks)
        for i, tag in enumerate(self.collapse):
            part = f"c{i}"
            if not sizes[part]:  # every node of this tag belongs to an earlier one
                continue
            marks = {paint: count for (box, paint), count in marked.items() if box == part}
            words = ", ".join([counted(sizes[part], "node"), *[f"{n} {paint.words}" for paint, n in marks.items()]])
            kind = next(iter(marks), theme.COLLAPSED)
            tooltip = f"{part}: {words} tagged {tag}"
            yield Box(part, kind, {**_look(_PART, bool(marks)), "label": f"{tag} ({words})", "tooltip": tooltip})

    def _node_box(self, node: Node, box_id: str, cluster: str | None) -> Box:
        kind = self.marks.get(node) or theme.ROLES[theme.role_of(node)]
        name = self._shown(node.name) if node.name else self.formulas.get(node, "")
        if node.value is not None:
            look, label = _CONSTANT, f"{node.value:.4g}"
        elif not node.args:
            look, label = BOX, name
        else:
            look, label = _OPERATION, f"{name}\n{columns(node.op).symbol}" if name else columns(node.op).symbol
        attributes = {**_look(look, node in self.marks), "label": label, "tooltip": self._about(node)}
        return Box(box_id, kind, attributes, cluster)

    def _about(self, node: Node) -> str:
        """One line on a node, for the tooltip: %number of the listing, operation and name, roles, tags."""
        what = repr(node.value) if node.value is not None else (node.name or "")
        number = f"{self._told(node)}: " if node.args else ""
        lines = [f"{number}{node.op.name} {what}".rstrip()]
        if node.roles:
            lines.append(", ".join(sorted(node.roles)))
        if node.tags:
            lines.append("tags: " + ", ".join(sorted(node.tags, key=theme.natural_order)))
        if node in self.marks:
            lines.append(self.marks[node].words)
        return "; ".join(lines)

    def _node_arrow(self, edge: Edge) -> Arrow:
        source, target, op = self.number[edge.source], self.number[edge.target], edge.target.op
        attributes = {
            "id": f"e{source}-{target}-{edge.slot}",
            "edgetooltip": f"argument {edge.slot + 1} of {self._told(edge.target)}: {op.name}",
        }
        if op.arity > 1 and not op.commutative:
            attributes["headlabel"] = str(edge.slot + 1)
        return self._tail(edge), f"n{target}", {**attributes, **_line(self._mark_of(edge))}


def _look(look: Attributes, heavy: bool) -> Attributes:
    return {**look, "penwidth": "3"} if heavy else look


def _line(mark: theme.Paint | None) -> Attributes:
    return {"color": mark.line, "penwidth": "2.5"} if mark else {}
