"""HTML of a graph or a node, as a notebook shows it."""

from __future__ import annotations

from ..core.graph import Graph
from ..core.html_text import render_html
from ..core.node import Node


def html(what: Node | Graph) -> str | None:
    """The drawing of a graph, or the formula of a node, as HTML: what a notebook shows of it.

    Parameters
    ----------
    what : Node or Graph
        The node or the graph.

    Returns
    -------
    str or None
        The HTML; None if no package is installed that draws it (extra `viz`), or if it cannot draw.

    Raises
    ------
    TypeError
        For what is neither a node nor a graph.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> "<math" in cg.html(cg.sin(x))
    True
    """
    if not isinstance(what, (Node, Graph)):
        raise TypeError(f"html needs a node or a graph, got {type(what).__name__}: {what!r:.60}")
    return render_html("graph" if isinstance(what, Graph) else "node", what)
