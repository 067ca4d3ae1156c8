"""Pictures of a graph and of a motion for a notebook's cell, and how to see more."""

from html import escape
from typing import Protocol

import numpy as np

from cgraph import Graph, Node
from cgraph._shared import Array, counted, remarks_of, require_graph
from cgraph.extend import topological

from .. import theme
from ..graph_drawing.dot import to_dot
from ..graph_drawing.render import LARGE_GRAPH, render_svg, tags_to_collapse
from ..plots.plot import GRID, empty_figure, style, to_adaptive_svg
from .mathml import equations

SECONDS = 20.0  # for Graphviz; a cell that takes longer shows text
COLUMNS = 12  # curves that are told apart in one picture
HALF = 4.0  # inches, of a panel


class Rows(Protocol):
    """Parts of a `dynamics.Trajectory` that are plotted."""

    t: Array
    q: Array
    qd: Array
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]


def graph_html(graph: Graph) -> str:
    """The drawing of a graph, as wide as the cell at most; a large one folded by its tags, and the way to its page.

    What is wrong in it, as whoever derived it knows, is painted, and said below.

    Raises RenderError where Graphviz is missing or does not end; the notebook shows the text form then.
    """
    require_graph("graph_html", graph)
    tags = tags_to_collapse(graph)
    nodes = counted(len(graph.nodes), "node")
    said = f"{nodes}; <code>viz.page(graph)</code> unfolds them, and shows values and paths."
    if len(graph.nodes) > LARGE_GRAPH and not tags:
        return f"<p>{escape(repr(graph))}: {said}</p>"
    known = remarks_of(graph)
    drawing = to_dot(
        graph,
        names=known.names,
        marked=known.nodes,
        marked_edges=known.edges,
        wrong_outputs=known.outputs,
        collapse=tags,
    )
    svg = render_svg(drawing, timeout=SECONDS)
    note = f"<p>{escape(known.words)}</p>" if known.words else ""
    note += f"<p>Folded by tags: {said}</p>" if tags else ""
    return f'<div style="max-width:100%;overflow-x:auto;background:{theme.WHITE}">{_fitting(svg)}</div>{note}'


def node_html(node: Node) -> str:
    """The formula of a node, as MathML; of a long one the last lines, and how many are left out."""
    variables = [each for each in topological([node]) if not each.args and each.value is None]
    return equations(Graph(variables, {node.name or "node": node}), {"node": ""})


def trajectory_html(run: Rows) -> str:
    """The plot of a motion over time: coordinates and velocities, or states, and how the run went.

    Raises ImportError without matplotlib; the notebook shows the text form then.
    """
    tables = [("state" if not run.qd.shape[1] else "coordinates", run.q, run.coordinates)]
    if run.qd.shape[1]:
        tables.append(("velocities", run.qd, run.velocities))
    with style():
        figure = empty_figure(2 * HALF if len(tables) == 2 else 1.5 * HALF, 2.8)
        axes = np.atleast_1d(figure.subplots(1, len(tables))).flat
        for axis, (what, values, names) in zip(axes, tables, strict=True):
            for i in range(min(COLUMNS, values.shape[1])):
                color, dashes = theme.SERIES[i % len(theme.SERIES)], ("-", "--", ":")[i // len(theme.SERIES) % 3]
                axis.plot(run.t, values[:, i], color=color, linestyle=dashes, label=names[i] if names else str(i))
            more = values.shape[1] - COLUMNS
            axis.set_title(what + (f", the first {COLUMNS} of {values.shape[1]}" if more > 0 else ""), loc="left")
            axis.set_xlabel("t [s]")
            axis.grid(**GRID)
            if values.shape[1] > 0:
                axis.legend(frameon=False, fontsize=8, ncols=2 if values.shape[1] > 6 else 1)
        svg = to_adaptive_svg(figure, background=True)
    return f"{_fitting(svg[svg.index('<svg') :])}<p>{escape(repr(run))}</p>"


def _fitting(svg: str) -> str:
    """The picture, scaled down to the width of the cell and never up."""
    return svg.replace("<svg ", '<svg style="max-width:100%;height:auto" ', 1)
