"""Boxes and arrows of a drawing of a graph: a box for every node and output, an arrow for every edge."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from cgraph import Edge, Graph, Node
from cgraph._shared import columns, counted
from cgraph.extend import Names

from .. import theme
from ..theme import Paint
from .draw_shapes import BOX, LEAF_SIZE, Arrow, Attributes, Box

ClusterRule = Callable[[Node], str | None]

_CONSTANT = {"shape": "box", "style": "filled", "height": "0.24", "margin": "0.05,0.02", "fontsize": "12"}
_OPERATION = {"shape": "ellipse", "style": "filled", "height": "0.42", "width": "0.42", "margin": "0.04,0.02"}
_OUTPUT = {**LEAF_SIZE, "shape": "box", "style": "filled", "peripheries": "2"}
_PART = {"shape": "box3d", "style": "filled", "margin": "0.16,0.08"}
_THICK = {"penwidth": "3"}


@dataclass(frozen=True)
class Plan:
    """All shapes and lines, in the order in which they are written."""

    boxes: list[Box] = field(default_factory=list)
    arrows: list[Arrow] = field(default_factory=list)

    @property
    def kinds(self) -> list[Paint]:
        """The kinds of shapes that occur, in the order of the theme, each once."""
        order = [paint.words for paint in (*theme.ROLES.values(), theme.OUTPUT, theme.COLLAPSED)]
        present = {box.kind.words: box.kind for box in self.boxes}
        return [present.pop(words) for words in order if words in present] + list(present.values())


@dataclass(frozen=True)
class _Subject:
    """The graph, and the answers to what each shape asks about a node."""

    graph: Graph
    names: Mapping[str, str]
    formulas: Mapping[Node, str]
    marks: Mapping[Node, Paint]
    marked_edges: frozenset[Edge]
    wrong_outputs: frozenset[str]
    number: dict[Node, int]
    part: dict[Node, str]  # id of the collapsed box that a node is in
    listed: Names  # who has the %number of the listing
    only: frozenset[Node] | None = None  # nodes that are drawn, with the numbers that they use; None for all

    @property
    def nodes(self) -> list[Node]:
        return [node for node in self.graph.nodes if self.only is None or node in self.only]

    @property
    def edges(self) -> list[Edge]:
        only = self.only
        edges = self.graph.edges
        return [
            each
            for each in edges
            if only is None or (each.target in only and (each.source in only or each.source.value is not None))
        ]

    @property
    def outputs(self) -> list[tuple[int, str, Node]]:
        """(its number, name, node) of every output that is drawn."""
        outputs = enumerate(self.graph.outputs.items())
        return [(i, name, node) for i, (name, node) in outputs if self.only is None or node in self.only]

    def id(self, node: Node) -> str:
        return self.part.get(node, f"n{self.number[node]}")

    def told(self, node: Node) -> str:
        """Name of a node in a tooltip: the name of its part, the %number of the listing, its name or its value."""
        if node in self.part:
            return self.part[node]
        return f"%{self.listed.number[node]}" if node.args else self.listed.short(node)

    def shown(self, name: str) -> str:
        return self.names[name] if name in self.names else theme.pretty(name)

    def kind(self, node: Node) -> Paint:
        return self.marks.get(node) or theme.ROLES[theme.role_of(node)]

    def mark_of(self, edge: Edge) -> Paint | None:
        return self.marks.get(edge.source) or (theme.MARKS[0] if edge in self.marked_edges else None)


def plan_of(
    graph: Graph,
    names: Mapping[str, str],
    formulas: Mapping[Node, str],
    marks: Mapping[Node, Paint],
    marked_edges: frozenset[Edge],
    wrong_outputs: frozenset[str],
    cluster_of: ClusterRule,
    collapse: tuple[str, ...],
    only: frozenset[Node] | None = None,
) -> Plan:
    """The boxes and arrows of a graph. Raises ValueError for a node or a collapsed tag that it does not have."""
    number = {node: i for i, node in enumerate(graph.nodes)}
    for what, nodes in (("marked", list(marks)), ("drawn", list(only or ()))):
        if strange := [node for node in nodes if node not in number]:
            raise ValueError(
                f"{len(strange)} of {len(nodes)} {what} nodes are not in the graph, such as {strange[0]!r}"
            )
    parts, listed = _parts(graph, collapse), Names(graph)
    subject = _Subject(graph, names, formulas, marks, marked_edges, wrong_outputs, number, parts, listed, only)
    plan = Plan()
    plan.boxes.extend(_part_boxes(subject, collapse))
    for node in subject.nodes:
        if node.value is None and node not in subject.part:
            plan.boxes.append(_node_box(subject, node, subject.id(node), cluster_of(node)))
    for edge in subject.edges:
        if edge.source.value is None or edge.target in subject.part:  # a number that a collapsed part uses is inside it
            continue
        copy = f"n{number[edge.source]}-{number[edge.target]}-{edge.slot}"
        plan.boxes.append(_node_box(subject, edge.source, copy, cluster_of(edge.target)))
    for i, name, node in subject.outputs:
        if node.value is not None:
            plan.boxes.append(_node_box(subject, node, f"n{number[node]}-o{i}", None))
        plan.boxes.append(_output_box(subject, name, f"o{i}"))
    plan.arrows.extend(_arrows(subject))
    return plan


def _parts(graph: Graph, collapse: Sequence[str]) -> dict[Node, str]:
    """Collapsed node: id of its box."""
    carried = set().union(*(node.tags for node in graph.nodes))
    for tag in collapse:
        if tag not in carried:
            known = ", ".join(sorted(carried, key=theme.natural_order)) or "none"
            raise ValueError(f"cannot collapse {tag!r}: no node carries that tag (tags: {known})")
    part = {}
    for node in graph.nodes:
        first = next((i for i, tag in enumerate(collapse) if tag in node.tags), None)
        if first is not None:
            part[node] = f"c{first}"
    return part


def _part_boxes(subject: _Subject, collapse: Sequence[str]) -> Iterator[Box]:
    sizes = Counter(subject.part.values())
    marked = Counter((part, subject.marks[node]) for node, part in subject.part.items() if node in subject.marks)
    for i, tag in enumerate(collapse):
        part = f"c{i}"
        if not sizes[part]:  # every node of this tag belongs to an earlier one
            continue
        words = counted(sizes[part], "node")
        marks = {paint: count for (box, paint), count in marked.items() if box == part}
        words += "".join([f", {count} {paint.words}" for paint, count in marks.items()])
        kind = next(iter(marks), theme.COLLAPSED)
        tooltip = f"{part}: {words} tagged {tag}"
        yield Box(part, kind, {**_PART, **_weight(bool(marks)), "label": f"{tag} ({words})", "tooltip": tooltip})


def _node_box(subject: _Subject, node: Node, box_id: str, cluster: str | None) -> Box:
    kind = subject.kind(node)
    name = subject.shown(node.name) if node.name else subject.formulas.get(node, "")
    if node.value is not None:
        look, label = _CONSTANT, f"{node.value:.4g}"
    elif not node.args:
        look, label = BOX, name
    else:
        look, label = _OPERATION, f"{name}\n{columns(node.op).symbol}" if name else columns(node.op).symbol
    attributes = {**look, **_weight(node in subject.marks), "label": label, "tooltip": _about(subject, node)}
    return Box(box_id, kind, attributes, cluster)


def _output_box(subject: _Subject, name: str, box_id: str) -> Box:
    about = f"output {name}, computed by {subject.told(subject.graph.outputs[name])}"
    kind = theme.WRONG_OUTPUT if name in subject.wrong_outputs else theme.OUTPUT
    return Box(box_id, kind, {**_OUTPUT, "label": subject.shown(name), "tooltip": about})


def _weight(heavy: bool) -> Attributes:
    return _THICK if heavy else {}


def _about(subject: _Subject, node: Node) -> str:
    """One line on a node, for the tooltip: %number of the listing, operation and name, roles, tags."""
    what = repr(node.value) if node.value is not None else (node.name or "")
    number = f"{subject.told(node)}: " if node.args else ""
    lines = [f"{number}{node.op.name} {what}".rstrip()]
    if node.roles:
        lines.append(", ".join(sorted(node.roles)))
    if node.tags:
        lines.append("tags: " + ", ".join(sorted(node.tags, key=theme.natural_order)))
    if node in subject.marks:
        lines.append(subject.marks[node].words)
    return "; ".join(lines)


def _arrows(subject: _Subject) -> Iterator[Arrow]:
    merged: dict[tuple[str, str], list[Edge]] = {}
    for edge in subject.edges:
        tail, head = subject.id(edge.source), subject.id(edge.target)
        if edge.source in subject.part or edge.target in subject.part:
            if tail != head and edge.source.value is None:
                merged.setdefault((tail, head), []).append(edge)
        else:
            yield _node_arrow(subject, edge)
    for (tail, head), edges in merged.items():
        mark = next(filter(None, [subject.mark_of(edge) for edge in edges]), None)
        ends = f"from {subject.told(edges[0].source)} to {subject.told(edges[0].target)}"
        about = f"{counted(len(edges), 'edge')} {ends}"
        attributes = {"id": f"e{tail.removeprefix('n')}-{head.removeprefix('n')}", "edgetooltip": about}
        if len(edges) > 1:
            attributes["label"] = f"×{len(edges)}"
        yield Arrow(tail, head, {**attributes, **_line(mark)})
    for i, _, node in subject.outputs:
        number = subject.number[node]
        tail = subject.id(node) if node.value is None else f"n{number}-o{i}"
        yield Arrow(tail, f"o{i}", {"id": f"e{number}-o{i}", **_line(subject.marks.get(node))})


def _node_arrow(subject: _Subject, edge: Edge) -> Arrow:
    source, target, slot = subject.number[edge.source], subject.number[edge.target], edge.slot
    op = edge.target.op
    tail = f"n{source}" if edge.source.value is None else f"n{source}-{target}-{slot}"
    attributes = {
        "id": f"e{source}-{target}-{slot}",
        "edgetooltip": f"argument {slot + 1} of {subject.told(edge.target)}: {op.name}",
    }
    if op.arity > 1 and not op.commutative:
        attributes["headlabel"] = str(slot + 1)
    return Arrow(tail, f"n{target}", {**attributes, **_line(subject.mark_of(edge))})


def _line(mark: Paint | None) -> Attributes:
    return {"color": mark.line, "penwidth": "2.5"} if mark else {}
