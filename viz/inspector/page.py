"""The inspector as one HTML file: style, script and data inside, nothing loaded from anywhere."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from html import escape
from string import Template

from cgraph import Graph, Node, __version__, _shared
from cgraph._shared import Array, Json

from .. import theme
from ..pages import html
from ..pages.document import Table
from ..pages.html import Page, Panel, asset
from ..pages.operations import operations
from .content import Motion, State, StateTable, Version
from .record import record

SCRIPTS = (
    "state.js", "picture/places.js", "picture/arrange.js", "picture/legible.js", "picture/course.js", "picture.js",
    "marks.js", "panels.js", "why/causes.js", "why/why.js", "steps.js", "motion.js", "outline.js", "link.js", "keys.js",
    "app.js",
)  # fmt: skip


def page(
    graph: Graph | Sequence[Version],
    *,
    title: str = "Computational graph",
    about: str = "",
    at: Mapping[str, float | Array] | None = None,
    marked: Collection[Node] = frozenset(),
    motion: Motion | None = None,
    tables: Sequence[Table | StateTable] = (),
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    derived: Graph | None = None,
    columns: Mapping[str, str | None] | None = None,
    notices: Sequence[str] = (),
    panels: Sequence[Panel] = (),
    causes: StateTable | None = None,
    view: str = "",
) -> Page:
    """The page on which a graph is looked at: it folds by tags, and shows values, paths, sweeps and equations.

    Parameters
    ----------
    graph : Graph, or sequence of Version
        One graph, or versions to switch among; nodes that compute the same in two versions keep their place.
    title : str
        Heading of the page.
    about : str
        What to see, a sentence or two.
    at : mapping of str to float or array (T,), optional
        {input: value}, or values along the motion: the one state of all versions. An input without a value is 0.5.
    marked : collection of Node
        Nodes of one graph in the color of what is wrong; by default what is known to be wrong in it.
    motion : Motion, optional
        Instants to play [s], and points that move beside the graph [m].
    tables : sequence of Table or StateTable
        Texts in rows, or numbers that follow the state, shown beside the graph.
    names : mapping of str to str, optional
        {name of an input, output or node: what a person calls it}, such as `dynamics.display_names(model)`. Tables and
        panels and boxes show it; without it boxes have letters, as q₀. By default what the graphs know of it.
    units : mapping of str to str, optional
        {name of an input or output: its unit}, shown beside the name.
    derived : Graph, optional
        Inputs that only some versions have, as a graph of the state: its outputs are computed, not asked for, and all
        versions are in one state.
    columns : mapping of str to str or None, optional
        {tag that is a column of the picture: tag of its parent}, bodies of a tree from its base. By default tags beside
        "kinetic" or "potential", or those that end in a number.
    notices : sequence of str
        What stands above everything, such as what a model lacks of its file.
    panels : sequence of Panel
        Parts that other modules add, such as the box of `viz.typed_page`.
    causes : StateTable, optional
        What the outputs of versions are the sums of, a column for each cause, as of `dynamics.torque_by_cause`: what
        the page answers to "why".
    view : str
        Name of the version that is shown first; by default the first.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    ValueError
        For no version, two of one name, a view that is none, `marked` beside versions, a value for a name that is no
        input or is derived, a number that is not finite, a marked node of another graph, or shapes that do not fit
        the motion.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> text = page(cg.Graph([x], {"y": cg.sin(x)}), title="A sine", at={"x": 0.3})
    >>> "<title>A sine</title>" in text
    True
    """
    for what, text in (("title", title), ("about", about), ("view", view)):
        _shared.require_kind(f"{what} of a page", text, str, "text")
    if at is not None:
        _shared.require_mapping("at", at, "input: value")
    _shared.require_texts("names", names)
    nodes = frozenset(_shared.require_sequence("marked", marked, "nodes", Node))
    tables = _shared.require_sequence("tables", tables, "Table or StateTable", (Table, StateTable))
    notices = _shared.require_sequence("notices", notices, "texts", str)
    panels = _shared.require_sequence("panels", panels, "Panel", Panel)
    if columns is not None:
        parents = _shared.require_mapping("columns", columns, "tag: parent").values()
        _shared.require_sequence("columns", [*columns, *[tag for tag in parents if tag is not None]], "tags", str)
    if derived is not None:
        _shared.require_graph("derived", derived)
    versions = _versions(graph, about, nodes)
    if motion is not None:
        _shared.require_kind("motion", motion, Motion).check()
    if names is None:
        names = {name: text for version in versions for name, text in _shared.remarks_of(version.graph).names.items()}
    if view and all(version.name != view for version in versions):
        raise ValueError(f"view must be one of the versions, got {view!r}: {[version.name for version in versions]}")
    introduction = "" if isinstance(graph, Graph) else about
    data: dict[str, Json] = {"title": title, "introduction": introduction, "notices": list(notices), "view": view}
    _shared.require_kind("causes", causes, StateTable | None, "a StateTable")
    live = [table for table in tables if isinstance(table, StateTable)]
    units, state = _shared.require_texts("units", units), State(at or {}, derived)
    data |= record(versions, motion, names, units, state=state, columns=columns, tables=live, causes=causes)
    return compose(title, data, [table for table in tables if isinstance(table, Table)], panels)


def compose(title: str, data: Mapping[str, Json] | None, tables: Sequence[Table], panels: Sequence[Panel] = ()) -> Page:
    """The file. Without data a panel says what is shown first."""
    first = "".join([panel.first for panel in panels])
    begin = "".join([f"\n{panel.run}" for panel in panels])
    added = "\n".join([panel.script for panel in panels])
    body = Template(asset(__package__, "page.html")).substitute(
        title=escape(title),
        tables="".join([table.html() for table in tables]),
        version=f"cgraph {__version__}",
        panels="".join([panel.body for panel in panels]),
        end="\n".join([panel.end for panel in panels if panel.end]),
    )
    return html.compose(
        title,
        body,
        f"{_colors()}{asset(__package__, 'page.css')}{''.join([panel.style for panel in panels])}",
        f'"use strict";\n{scripts()}\n{added}\nconst inspector = start({first});{begin}',
        {"data": data} | {name: each for panel in panels for name, each in panel.data.items()},
    )


def _versions(graph: Graph | Sequence[Version], about: str, marked: frozenset[Node]) -> list[Version]:
    """The versions to switch among, checked; a graph alone is one."""
    if isinstance(graph, Graph):
        known = _shared.remarks_of(graph)
        version = Version("graph", graph, about or known.words, marked)
        if marked or not known.outputs:
            return [version]
        return [replace(version, marked=known.nodes, blamed=known.edges, flawed=True, off=known.outputs)]
    given: object = graph
    listed = isinstance(given, Sequence) and not isinstance(given, str)
    if not listed or not all(isinstance(each, Version) for each in graph):
        _shared.require_graph("page", graph)
    if marked:
        raise ValueError("with versions, give each its own marked nodes")
    names = [version.name for version in graph]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"a page needs versions with names of their own, got {names}")
    return list(graph)


def scripts() -> str:
    """The page's JavaScript: operations from their table, then the files."""
    shared = asset(html.__package__, "elements.js", "tables.js", "address.js", "graph.js", "slopes.js", "surfaces.js")
    return "\n".join([operations(), shared, asset(__package__, *SCRIPTS)])


def _colors() -> str:
    """The theme's colors as the style sheet names them."""
    roles = {role: paint.line for role, paint in theme.ROLES.items()} | {"input": theme.YELLOW}
    names = roles | {"wrong": theme.SPURIOUS, "up": theme.BLUE, "down": theme.GREEN, "path": theme.PURPLE}
    parts = "".join(f".part{i}{{--c:{color}}}" for i, color in enumerate((*theme.LINKS, *theme.SERIES[1:5])))
    return parts + ":root{" + "".join(f"--{name}:{color};" for name, color in names.items()) + "}\n"
