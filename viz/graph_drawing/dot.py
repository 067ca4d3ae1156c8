"""The drawing of a graph as DOT, the language of Graphviz, and short formulas for its nodes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from cgraph import Edge, Graph, Node, _shared
from cgraph.extend import Names

from .. import theme
from .boxes_and_arrows import ClusterRule, Plan
from .draw_shapes import digraph, draw_boxes, draw_legend, escaped, literal

if TYPE_CHECKING:
    from graphviz import Digraph


def to_dot(
    graph: Graph,
    *,
    names: Mapping[str, str] | None = None,
    formulas: Mapping[Node, str] | None = None,
    marked: Collection[Node] | Mapping[str, Collection[Node]] = frozenset(),
    marked_label: str = theme.MARKED.words,
    marked_edges: Collection[Edge] = frozenset(),
    wrong_outputs: Collection[str] = (),
    clusters: bool | Sequence[str] | ClusterRule = True,
    collapse: Sequence[str] = (),
    only: Collection[Node] | None = None,
    caption: str | None = None,
    legend: bool | Mapping[str, str] = True,
    rankdir: Literal["BT", "TB", "LR", "RL"] = "BT",
) -> Digraph:
    """The drawing of a graph; `viz.render_svg` makes a picture of it, `.source` is its text.

    An operation shows its symbol, and its name if it has one; its color tells its role. A constant is drawn again at
    each use, so that shared numbers make no long edges. An output is a box above the node that computes it. The order
    of arguments is written at an edge where it matters. An input that no output needs is not drawn.

    Tooltips call operations by their numbers in `graph.listing()`. Ids are stable: node i of `graph.nodes` is `n<i>`, a
    constant's copy `n<i>-<use>-<slot>`, output j `o<j>`, collapsed box k `c<k>`; an edge is
    `e<source>-<target>-<slot>`. The same graph gives the same text in every run.
    Some 200 nodes are read by scrolling. Above, collapse tags.

    Parameters
    ----------
    graph : Graph
        What is drawn, its inputs at the bottom.
    names : mapping of str to str, optional
        {name of an input, an output or a node: text to show}. Other names are shown by `theme.pretty`, q0 as q₀.
    formulas : mapping of Node to str, optional
        {node without a name: text to show above its symbol}, such as of `short_formulas`.
    marked : collection of Node, or mapping of str to collection of Node
        Nodes to draw thick in the one color of what is wrong, with the edges out of them; or
        {what the legend calls them: nodes} for two groups, the second in another color.
    marked_label : str
        What the legend calls the marked nodes where there is one group.
    marked_edges : collection of Edge
        Edges to draw in the first color, too, such as those of a path or a cut.
    wrong_outputs : collection of str
        Names of outputs to draw in a tint of that color.
    clusters : bool, sequence of str, or function
        Frames around the nodes of a tag. True: by `main_tag`; tags: by these, a node with several of them in none;
        a function: the frame's title for a node, or None.
    collapse : sequence of str
        Tags whose nodes become one box, "link 2 (34 nodes)"; an edge at it says how many it stands for. A node with
        several of these tags belongs to the first.
    only : collection of Node, optional
        The nodes to draw, such as those of a few paths, with the edges among them and the numbers that they use; by
        default all.
    caption : str, optional
        A line below the drawing; a second line then counts the graph's nodes and edges.
    legend : bool or mapping of str to str
        Whether to explain the colors in use; or {role: words} where other words say what a role is in this graph.
    rankdir : {"BT", "TB", "LR", "RL"}
        "BT" grows from the inputs at the bottom to the outputs at the top, "LR" from left to right.

    Returns
    -------
    graphviz.Digraph

    Raises
    ------
    ValueError
        For a collapsed tag that no node carries, a node that the graph does not have, a marked one in both groups, a
        third group, or an unknown direction.
    ImportError
        When the Python package graphviz is missing.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> drawing = to_dot(cg.Graph([x], {"y": cg.sin(x)}), legend=False)
    >>> [line.split("[")[0].strip() for line in drawing.source.splitlines() if "->" in line]
    ['n0 -> n1', 'n1 -> o0']
    """
    _shared.require_graph("to_dot", graph)
    _shared.require_choice("rankdir", rankdir, ("BT", "TB", "LR", "RL"))
    words = _shared.require_texts("legend", legend) if isinstance(legend, Mapping) else {}
    if not isinstance(legend, Mapping):
        _shared.require_flag("legend", legend)
    for what, text in (("caption", "" if caption is None else caption), ("marked_label", marked_label)):
        _shared.require_kind(what, text, str, "text")
    plan = Plan(
        graph,
        _shared.require_texts("names", names),
        {} if formulas is None else _shared.require_mapping("formulas", formulas, "node: text"),
        _marks(marked, marked_label),
        frozenset(_shared.require_sequence("marked_edges", marked_edges, "edges", tuple)),
        frozenset(_shared.require_sequence("wrong_outputs", wrong_outputs, "names", str)),
        _cluster_rule(clusters),
        _shared.require_sequence("collapse", collapse, "tags", str),
        frozenset(graph.nodes if only is None else _shared.require_sequence("only", only, "nodes", Node)),
    )
    drawing = digraph(rankdir)
    if caption is not None:
        counts = f"{_shared.counted(len(graph.nodes), 'node')}, {_shared.counted(len(graph.edges), 'edge')}"
        counts = counts if only is None else f"{len(set(only))} of {counts}"
        drawing.attr(label=literal(f"{caption}\n{counts}" if caption else counts), labelloc="b", fontsize="16")
    boxes = list(plan.boxes())
    draw_boxes(drawing, boxes)
    if legend is not False:
        draw_legend(drawing, boxes, words, vertical=rankdir in ("BT", "TB"))
    for tail, head, attributes in plan.arrows():
        drawing.edge(tail, head, **escaped(attributes))
    return drawing


def _marks(marked: Collection[Node] | Mapping[str, Collection[Node]], words: str) -> dict[Node, theme.Paint]:
    """Paint of each marked node."""
    groups = marked if isinstance(marked, Mapping) else {words: marked}
    if len(groups) > len(theme.MARKS):
        raise ValueError(f"marked nodes come in at most {len(theme.MARKS)} groups, got {len(groups)}")
    marks: dict[Node, theme.Paint] = {}
    for paint, (group, given) in zip(theme.MARKS, groups.items(), strict=False):
        nodes = _shared.require_sequence("marked", given, "nodes", Node)
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
    if callable(clusters) and not isinstance(clusters, type):
        return clusters
    if isinstance(clusters, bool):
        return main_tag if clusters else lambda node: None
    given = [clusters] if isinstance(clusters, str) else clusters
    chosen = frozenset(_shared.require_sequence("clusters", given, "tags, or True, False or a function of a node", str))
    return lambda node: _only(node.tags & chosen)


def plain_drawing(
    graph: Graph, names: Mapping[str, str], marked: Collection[Node] = (), marked_edges: Collection[Edge] = ()
) -> Digraph:
    """The drawing of a small graph with short formulas, without frames and legend; arguments as of `to_dot`."""
    formulas = short_formulas(graph, names)
    return to_dot(
        graph, names=names, formulas=formulas, marked=marked, marked_edges=marked_edges, clusters=False, legend=False
    )


def short_formulas(graph: Graph, names: Mapping[str, str], length: int = 10) -> dict[Node, str]:
    """The formulas of those operations without a name that have one of at most `length` characters, which fit a node.

    names: {name in the graph: text shown}.
    """
    texts = Names(graph, names)
    formulas = {
        node: texts.text(node, 2 * length).replace(" * ", " ")
        for node in graph.nodes
        if node.args and node.name is None
    }
    return {node: text for node, text in formulas.items() if len(text) <= length and "%" not in text}
