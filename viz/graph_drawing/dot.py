"""The drawing of a graph as DOT, the language of Graphviz."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from cgraph import Edge, Graph, Node
from cgraph.errors import install

from .. import theme
from ..theme import Paint

if TYPE_CHECKING:
    from graphviz import Digraph

Attributes = dict[str, str]
ClusterRule = Callable[[Node], str | None]

DIRECTIONS = ("BT", "TB", "LR", "RL")
_LEAF = {"height": "0.34", "margin": "0.09,0.04"}
_BOX = {**_LEAF, "shape": "box", "style": "filled,rounded"}
_CONSTANT = {"shape": "box", "style": "filled", "height": "0.24", "margin": "0.05,0.02", "fontsize": "12"}
_OPERATION = {"shape": "ellipse", "style": "filled", "height": "0.42", "width": "0.42", "margin": "0.04,0.02"}
_OUTPUT = {**_LEAF, "shape": "box", "style": "filled", "peripheries": "2"}
_PART = {"shape": "box3d", "style": "filled", "margin": "0.16,0.08"}
_THICK = {"penwidth": "3"}


def to_dot(
    graph: Graph,
    *,
    names: Mapping[str, str] | None = None,
    marked: Collection[Node] | Mapping[str, Collection[Node]] = frozenset(),
    marked_label: str = theme.MARKED.words,
    marked_edges: Collection[Edge] = frozenset(),
    clusters: bool | Sequence[str] | ClusterRule = True,
    collapse: Sequence[str] = (),
    caption: str | None = None,
    legend: bool = True,
    rankdir: Literal["BT", "TB", "LR", "RL"] = "BT",
) -> Digraph:
    """The drawing of a graph; `viz.render_svg` makes a picture of it, `.source` is its text.

    An operation shows its symbol, and its name if it has one; its colour tells its role. A constant is drawn again at
    each use, so that shared numbers make no long edges. An output is a box of its own, above the node that computes
    it. The order of arguments is written at an edge where it matters. An input that no output needs is not drawn.

    names: {name of an input, an output or a node: text to show}; other names are shown by `theme.pretty`, q0 as q₀.
    marked: nodes to draw thick in the one colour of what is wrong, with the edges out of them; or
        {what the legend calls them: nodes} for two groups, the second in a colour of its own.
    marked_label: what the legend calls them where there is one group.
    marked_edges: edges to draw in the first colour, too, such as those of a path or a cut.
    clusters: frames around the nodes of a tag. True: by `main_tag`; tags: by these, a node with several of them in
        none; a function: the frame's title for a node, or None.
    collapse: tags whose nodes become one box, "link 2 (34 nodes)"; an edge at it says how many it stands for.
        A node with several of these tags belongs to the first.
    caption: a line below the drawing; a second line then counts the graph's nodes and edges.
    rankdir: "BT" grows from the inputs at the bottom to the outputs at the top, "LR" from left to right.

    Ids are stable: node i of `graph.nodes` is `n<i>`, a constant's copy `n<i>-<use>-<slot>`, output j `o<j>`, collapsed
    box k `c<k>`; an edge is `e<source>-<target>-<slot>`. The same graph gives the same text in every run.
    Up to some 500 nodes this draws well. Above, collapse tags, or draw with `legend=False` and render with
    `engine="sfdp"`, which draws no clusters.

    Raises ValueError for a collapsed tag that no node carries, a marked node that the graph does not have or that is in
    both groups, a third group, or an unknown direction; ImportError when the Python package graphviz is missing.
    """
    if rankdir not in DIRECTIONS:
        raise ValueError(f"rankdir must be one of {', '.join(DIRECTIONS)}, got {rankdir!r}")
    plan = _plan(
        graph,
        names or {},
        _marks(marked, marked_label),
        frozenset(marked_edges),
        _cluster_rule(clusters),
        tuple(collapse),
    )
    drawing = _digraph(rankdir)
    if caption is not None:
        counts = f"{len(graph.nodes)} nodes, {len(graph.edges)} edges"
        drawing.attr(label=_text(f"{caption}\n{counts}" if caption else counts), labelloc="b", fontsize="16")
    _draw_boxes(drawing, plan.boxes)
    if legend:
        _draw_legend(drawing, plan.kinds, vertical=rankdir in ("BT", "TB"))
    for arrow in plan.arrows:
        drawing.edge(arrow.tail, arrow.head, **_escaped(arrow.attributes))
    return drawing


def _marks(marked: Collection[Node] | Mapping[str, Collection[Node]], words: str) -> dict[Node, Paint]:
    """How each marked node is painted."""
    groups = marked if isinstance(marked, Mapping) else {words: marked}
    if len(groups) > len(theme.MARKS):
        raise ValueError(f"marked nodes come in at most {len(theme.MARKS)} groups, got {len(groups)}")
    marks: dict[Node, Paint] = {}
    for paint, (group, nodes) in zip(theme.MARKS, groups.items(), strict=False):
        if both := [node for node in nodes if node in marks]:
            raise ValueError(f"{len(both)} marked nodes are in both groups, such as {both[0]!r}")
        marks |= dict.fromkeys(nodes, replace(paint, words=group))
    return marks


def main_tag(node: Node) -> str | None:
    """The one tag of a node that ends in a number, such as "link 2"; without any such tag, its only tag; or None."""
    numbered = [tag for tag in node.tags if tag[-1].isdigit()]
    return _only(numbered or node.tags)


def _only(tags: Collection[str]) -> str | None:
    return next(iter(tags)) if len(tags) == 1 else None


def _cluster_rule(clusters: bool | Sequence[str] | ClusterRule) -> ClusterRule:
    if callable(clusters):
        return clusters
    if isinstance(clusters, bool):
        return main_tag if clusters else lambda node: None
    chosen = frozenset([clusters] if isinstance(clusters, str) else clusters)
    return lambda node: _only(node.tags & chosen)


# What to draw, before a word of DOT.


@dataclass(frozen=True)
class _Box:
    """One shape of the drawing."""

    id: str
    kind: Paint
    attributes: Attributes
    cluster: str | None = None


@dataclass(frozen=True)
class _Arrow:
    """One line of the drawing."""

    tail: str
    head: str
    attributes: Attributes


@dataclass(frozen=True)
class _Plan:
    """All shapes and lines, in the order in which they are written."""

    boxes: list[_Box] = field(default_factory=list)
    arrows: list[_Arrow] = field(default_factory=list)

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
    marks: Mapping[Node, Paint]
    marked_edges: frozenset[Edge]
    number: dict[Node, int]
    part: dict[Node, str]  # id of the collapsed box that a node is in

    def id(self, node: Node) -> str:
        return self.part.get(node, f"n{self.number[node]}")

    def shown(self, name: str) -> str:
        return self.names[name] if name in self.names else theme.pretty(name)

    def kind(self, node: Node) -> Paint:
        return self.marks.get(node) or theme.ROLES[theme.role_of(node)]

    def mark_of(self, edge: Edge) -> Paint | None:
        return self.marks.get(edge.source) or (theme.MARKS[0] if edge in self.marked_edges else None)


def _plan(
    graph: Graph,
    names: Mapping[str, str],
    marks: Mapping[Node, Paint],
    marked_edges: frozenset[Edge],
    cluster_of: ClusterRule,
    collapse: tuple[str, ...],
) -> _Plan:
    number = {node: i for i, node in enumerate(graph.nodes)}
    strange = [node for node in marks if node not in number]
    if strange:
        raise ValueError(f"{len(strange)} of {len(marks)} marked nodes are not in the graph, such as {strange[0]!r}")
    subject = _Subject(graph, names, marks, marked_edges, number, _parts(graph, collapse))
    plan = _Plan()
    plan.boxes.extend(_part_boxes(subject, collapse))
    for node in graph.nodes:
        if node.value is None and node not in subject.part:
            plan.boxes.append(_node_box(subject, node, subject.id(node), cluster_of(node)))
    for edge in graph.edges:
        if edge.source.value is None or edge.target in subject.part:  # a number that a collapsed part uses is inside it
            continue
        copy = f"n{number[edge.source]}-{number[edge.target]}-{edge.slot}"
        plan.boxes.append(_node_box(subject, edge.source, copy, cluster_of(edge.target)))
    for i, (name, node) in enumerate(graph.outputs.items()):
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


def _part_boxes(subject: _Subject, collapse: Sequence[str]) -> Iterator[_Box]:
    sizes = Counter(subject.part.values())
    marked = Counter((part, subject.marks[node]) for node, part in subject.part.items() if node in subject.marks)
    for i, tag in enumerate(collapse):
        part = f"c{i}"
        if not sizes[part]:  # every node of this tag belongs to an earlier one
            continue
        words = f"{sizes[part]} node{'s' if sizes[part] > 1 else ''}"
        marks = {paint: count for (box, paint), count in marked.items() if box == part}
        words += "".join([f", {count} {paint.words}" for paint, count in marks.items()])
        kind = next(iter(marks), theme.COLLAPSED)
        tooltip = f"{part}: {words} tagged {tag}"
        yield _Box(part, kind, {**_PART, **_weight(bool(marks)), "label": f"{tag} ({words})", "tooltip": tooltip})


def _node_box(subject: _Subject, node: Node, box_id: str, cluster: str | None) -> _Box:
    kind = subject.kind(node)
    name = subject.shown(node.name) if node.name else ""
    if node.value is not None:
        look, label = _CONSTANT, f"{node.value:.4g}"
    elif not node.args:
        look, label = _BOX, name
    else:
        look, label = _OPERATION, f"{name}\n{node.op.symbol}" if name else node.op.symbol
    attributes = {**look, **_weight(node in subject.marks), "label": label, "tooltip": _about(subject, node)}
    return _Box(box_id, kind, attributes, cluster)


def _output_box(subject: _Subject, name: str, box_id: str) -> _Box:
    about = f"output {name}, computed by {subject.id(subject.graph.outputs[name])}"
    return _Box(box_id, theme.OUTPUT, {**_OUTPUT, "label": subject.shown(name), "tooltip": about})


def _weight(heavy: bool) -> Attributes:
    return _THICK if heavy else {}


def _about(subject: _Subject, node: Node) -> str:
    """One line on a node, for the tooltip: number, operation and name, roles, tags."""
    what = repr(node.value) if node.value is not None else (node.name or "")
    lines = [f"n{subject.number[node]}: {node.op.name} {what}".rstrip()]
    if node.roles:
        lines.append(", ".join(sorted(node.roles)))
    if node.tags:
        lines.append("tags: " + ", ".join(sorted(node.tags, key=theme.natural_order)))
    if node in subject.marks:
        lines.append(subject.marks[node].words)
    return "; ".join(lines)


def _arrows(subject: _Subject) -> Iterator[_Arrow]:
    merged: dict[tuple[str, str], list[Edge]] = {}
    for edge in subject.graph.edges:
        tail, head = subject.id(edge.source), subject.id(edge.target)
        if edge.source in subject.part or edge.target in subject.part:
            if tail != head and edge.source.value is None:
                merged.setdefault((tail, head), []).append(edge)
        else:
            yield _node_arrow(subject, edge)
    for (tail, head), edges in merged.items():
        mark = next(filter(None, [subject.mark_of(edge) for edge in edges]), None)
        about = f"{len(edges)} edge{'s' if len(edges) > 1 else ''} from {tail} to {head}"
        attributes = {"id": f"e{tail.removeprefix('n')}-{head.removeprefix('n')}", "edgetooltip": about}
        if len(edges) > 1:
            attributes["label"] = f"×{len(edges)}"
        yield _Arrow(tail, head, {**attributes, **_line(mark)})
    for i, node in enumerate(subject.graph.outputs.values()):
        number = subject.number[node]
        tail = subject.id(node) if node.value is None else f"n{number}-o{i}"
        yield _Arrow(tail, f"o{i}", {"id": f"e{number}-o{i}", **_line(subject.marks.get(node))})


def _node_arrow(subject: _Subject, edge: Edge) -> _Arrow:
    source, target, slot = subject.number[edge.source], subject.number[edge.target], edge.slot
    op = edge.target.op
    tail = f"n{source}" if edge.source.value is None else f"n{source}-{target}-{slot}"
    attributes = {"id": f"e{source}-{target}-{slot}", "edgetooltip": f"argument {slot + 1} of n{target}: {op.name}"}
    if op.arity > 1 and not op.commutative:
        attributes["headlabel"] = str(slot + 1)
    return _Arrow(tail, f"n{target}", {**attributes, **_line(subject.mark_of(edge))})


def _line(mark: Paint | None) -> Attributes:
    return {"color": mark.line, "penwidth": "2.5"} if mark else {}


# The words of DOT.


def _digraph(rankdir: str) -> Digraph:
    """An empty drawing in the fonts and colours of the theme."""
    try:
        from graphviz import Digraph
    except ImportError as error:
        raise ImportError(f"drawing a graph needs the Python package graphviz: {install('viz')}") from error
    small = str(theme.SMALL_FONT_SIZE)
    font = {"fontname": theme.FONT, "fontcolor": theme.TEXT}
    return Digraph(
        "graph",
        graph_attr={
            **font,
            "rankdir": rankdir,
            "ranksep": "0.32",
            "nodesep": "0.18",
            "overlap": "false",  # for the engines without layers
            "bgcolor": "white",
            "tooltip": " ",  # else the name of the graph
        },
        node_attr={**font, "fontsize": str(theme.FONT_SIZE), "width": "0.3"},
        edge_attr={**font, "fontsize": small, "color": theme.LINE, "arrowsize": "0.6", "labeldistance": "1.4"},
    )


def _draw_boxes(drawing: Digraph, boxes: Sequence[_Box]) -> None:
    clusters: dict[str, list[_Box]] = {}
    for box in boxes:
        if box.cluster is None:
            _draw_box(drawing, box)
        else:
            clusters.setdefault(box.cluster, []).append(box)
    colours = theme.tag_colours(clusters)
    for i, title in enumerate(sorted(clusters, key=theme.natural_order)):
        with drawing.subgraph(name=f"cluster_{i}") as frame:
            colour = colours[title]
            frame.attr(**_escaped({"id": f"t{i}", "label": title, "tooltip": title}), style="filled,rounded")
            frame.attr(color=colour, fillcolor=theme.tint(colour, 0.08), labeljust="l", margin="10", fontsize="12")
            for box in clusters[title]:
                _draw_box(frame, box)


def _draw_box(drawing: Digraph, box: _Box) -> None:
    drawing.node(box.id, id=box.id, color=box.kind.line, fillcolor=box.kind.fill, **_escaped(box.attributes))


def _draw_legend(drawing: Digraph, kinds: Sequence[Paint], *, vertical: bool) -> None:
    with drawing.subgraph(name="cluster_legend") as frame:
        frame.attr(id="legend", label="legend", tooltip="legend", style="rounded", color=theme.LINE, fontsize="12")
        for i, kind in enumerate(kinds):
            look = {**_BOX, "fontsize": "12", "width": "1.9"}
            _draw_box(frame, _Box(f"k{i}", kind, {**look, "label": kind.words, "tooltip": kind.words}))
        if vertical:
            for i in range(len(kinds) - 1):
                frame.edge(f"k{i}", f"k{i + 1}", style="invis")


def _escaped(attributes: Attributes) -> Attributes:
    return {key: _text(value) for key, value in attributes.items()}


def _text(text: str) -> str:
    r"""A text to be shown as it is: Graphviz gives a meaning to \N, and to <...> as a whole."""
    from graphviz import escape

    escaped: str = escape(text)  # a subclass of str
    return escaped
