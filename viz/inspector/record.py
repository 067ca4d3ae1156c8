"""The data of the page: graphs as arrays, their one state, a motion; what the page's script reads and may be handed.

    title, introduction   texts
    notices               texts that stand above everything, such as what a model lacks of its file
    called, units         [[name in a graph: what a person calls it, or its unit]]
    inputs, rows          names of the state's values, and these at every instant of the motion (one without a motion)
    derived               null, or a graph that computes other inputs of versions from the state
    columns               [[tag, tag of its parent or null]] in the order of the picture; [] leaves it to the page
    versions              [{name, group, about, labels, label, stages, marked, blamed, flawed, off, excess, steps,
                          drawing} and a
                          graph], see below
    tables                [{caption, header, rows: [[name, [numbers of nodes]]]} and a graph]: they follow the state
    causes                null, or such a table: parts of outputs that add up to them, a column for each cause
    motion                null, or {t, points: null or [[[x, y]]], parents, joints, turns, radii, surfaces: null or
                          [[[x, y]]], places: null or a graph}

A graph is that of `graph_data`, with outputs [[name, letters, number of a node]], and with names, {number of a node:
[name, letters]}. Versions of one group share a picture. stages are titles of its rows, from the bottom; [] leaves them
to the page, by sweep. labels are the [tags, role, row] that occur, label which of them a node
has, marked the nodes in the color of what is wrong, blamed the edges [source, target] in it, flawed whether the version
is wrong, off the names of the outputs in which it is, excess null or a graph of what its outputs have too much, steps
[{words, nodes, value, joint}]. Where nodes stand is the page's business, but for a `drawing`.
"""

from collections.abc import Callable, Mapping, Sequence

from cgraph import Graph, Node
from cgraph._shared import Array, Json, columns
from cgraph.extend import ADJOINT, PRIMAL, TANGENT

from .. import theme
from ..graph_drawing.render import Line, Positions, RenderError, positions
from ..pages.operations import graph_data
from .content import Motion, State, StateTable, Version

STAGES = {PRIMAL: "as written", ADJOINT: "reverse sweep", TANGENT: "forward sweep"}
SMALL_GRAPH = 60  # nodes of a graph that is laid out by Graphviz
NODE_HEIGHT, LEAF_HEIGHT = 34.0, 30.0  # pixels, as in arrange.js
LONGEST_NAME = 42  # letters of a name for which a box has room
Letters = Callable[[str], str]


def record(
    versions: Sequence[Version],
    motion: Motion | None,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    *,
    state: State | None = None,
    columns: Mapping[str, str | None] | None = None,
    tables: Sequence[StateTable] = (),
    causes: StateTable | None = None,
) -> dict[str, Json]:
    """All that the page's script reads, as JSON can hold it.

    names, units: {name in a graph: what a person calls it, and its unit}.  columns: {tag: tag of its parent}.
    """
    state = state or State({})
    graphs = [version.graph for version in versions]
    moved = [motion.places] if motion is not None and motion.places is not None else []
    inputs = state.inputs([*graphs, *moved])
    known = {each.name for graph in graphs for each in (*graph.inputs, *graph.nodes) if each.name}
    known |= {name for graph in graphs for name in graph.outputs} | set(inputs)
    letters = _letters(names or {})
    for version in versions:
        version.check()
    drawings = dict[str, dict[str, Json] | None]()
    for own in _groups(versions):
        found = _drawings([version.graph for version in own], letters)
        drawings |= dict(zip([version.name for version in own], found, strict=True))
    for table in (*tables, *([causes] if causes else [])):
        table.check(inputs)
    return {
        "called": [[name, text] for name, text in (names or {}).items() if name in known],
        "units": [[name, text] for name, text in (units or {}).items() if name in known],
        "inputs": inputs,
        "rows": state.rows(inputs, len(motion.t) if motion else 1).tolist(),
        "derived": None if state.derived is None else _graph(state.derived, letters),
        "columns": [[tag, parent] for tag, parent in (columns or {}).items()],
        "versions": [_version(version, letters) | {"drawing": drawings[version.name]} for version in versions],
        "tables": [_table(table, letters) for table in tables],
        "causes": None if causes is None else _table(causes, letters),
        "motion": None if motion is None else _motion(motion, letters),
    }


def _groups(versions: Sequence[Version]) -> list[list[Version]]:
    """The versions by group, whose rows have the same titles."""
    groups: dict[str, list[Version]] = {}
    for version in versions:
        groups.setdefault(version.group, []).append(version)
    for own in groups.values():
        if len(titles := {tuple(version.rows) for version in own}) > 1:
            raise ValueError(f"all versions of a group need the same rows, got {sorted(map(list, titles))}")
    return list(groups.values())


def _motion(motion: Motion, letters: Letters) -> dict[str, Json]:
    return {
        "t": [_short(t) for t in motion.t],
        "points": _points(motion.points),
        "parents": list(motion.parents),
        "joints": list(motion.joints),
        "turns": list(motion.turns),
        "radii": [_short(each) for each in motion.radii],
        "surfaces": _points(motion.surfaces),
        "places": _graph(motion.places, letters) if motion.places is not None else None,
    }


def _points(points: Array | None) -> list[Json] | None:
    return None if points is None else [[[_short(x), _short(y)] for x, y in each] for each in points]


def _letters(names: Mapping[str, str]) -> Letters:
    """Label of a name in the picture: its display name, of a long one the ends; without one, its letters."""
    return lambda name: _fitted(names[name]) if name in names else theme.pretty(name)


def _fitted(text: str) -> str:
    ends = LONGEST_NAME // 2
    return text if len(text) <= LONGEST_NAME else f"{text[:ends]}…{text[1 - ends :]}"


def _graph(graph: Graph, letters: Letters) -> dict[str, Json]:
    number = {node: i for i, node in enumerate(graph.nodes)}
    return graph_data(graph) | {
        "names": {str(i): [node.name, letters(node.name)] for node, i in number.items() if node.name},
        "outputs": [[name, letters(name), number[node]] for name, node in graph.outputs.items()],
    }


def _version(version: Version, letters: Letters) -> dict[str, Json]:
    labels: dict[tuple[tuple[str, ...], str, str], int] = {}
    label = []
    row = {node: title for title, nodes in version.rows.items() for node in nodes}
    first = next(iter(version.rows), None)
    for node in version.graph.nodes:
        stage = _stage(node) if first is None else row.get(node, first)
        kind = (tuple(sorted(node.tags, key=theme.natural_order)), theme.role_of(node), stage)
        label.append(labels.setdefault(kind, len(labels)))
    marked, number = set(version.marked), {node: i for i, node in enumerate(version.graph.nodes)}
    return {
        "name": version.name,
        "group": version.group,
        "about": version.about,
        "stages": list(version.rows),
        **_graph(version.graph, letters),
        "label": label,
        "labels": [[list(tags), *rest] for tags, *rest in labels],
        "marked": [number[node] for node in version.graph.nodes if node in marked],
        "blamed": sorted([[number[edge.source], number[edge.target]] for edge in version.blamed]),
        "flawed": version.flawed or bool(marked),
        "off": [name for name in version.graph.outputs if name in version.off],
        "excess": None if version.excess is None else _graph(version.excess, letters),
        "steps": [
            step._asdict() | {"nodes": [number[node] for node in step.nodes], "value": number[step.value]}
            for step in version.steps
        ],
    }


def _drawings(graphs: Sequence[Graph], letters: Letters) -> list[dict[str, Json] | None]:
    """Small graphs as Graphviz lays them out, if it is there: {width, height, nodes, outputs, lines}.

    nodes: [x, y, width] of every node, null for a constant, which is written where it is used; outputs the same.
    lines: {"n<source> n<target>" or "n<source> o<name>": path}.
    """
    if max([len(graph.nodes) for graph in graphs], default=0) > SMALL_GRAPH:
        return [None] * len(graphs)
    planned = [_plan(graph, letters) for graph in graphs]
    try:
        drawn = positions(*[(tuple(sizes.values()), lines) for sizes, lines in planned])
    except RenderError:
        return [None] * len(graphs)
    return [_drawing(graph, sizes, where) for graph, (sizes, _), where in zip(graphs, planned, drawn, strict=True)]


_Sizes = dict[Node | str, tuple[float, float]]  # of nodes but constants, then of outputs by name


def _plan(graph: Graph, letters: Letters) -> tuple[_Sizes, tuple[Line, ...]]:
    """Sizes of the parts of a drawing, and the lines between them."""
    sizes: _Sizes = {node: (_width(node, letters), NODE_HEIGHT) for node in graph.nodes if node.value is None}
    sizes |= {name: (_width(name, letters), LEAF_HEIGHT) for name in graph.outputs}
    at = {each: i for i, each in enumerate(sizes)}
    lines = [(at[edge.source], at[edge.target]) for edge in graph.edges if edge.source in at]
    lines += [(at[node], at[name]) for name, node in graph.outputs.items() if node in at]
    return sizes, tuple(dict.fromkeys(lines))


def _drawing(graph: Graph, sizes: _Sizes, where: Positions) -> dict[str, Json]:
    boxes = {each: [x, y, sizes[each][0]] for each, (x, y) in zip(sizes, where.centers, strict=True)}
    number = {node: f"n{i}" for i, node in enumerate(graph.nodes)}
    ids = [number[each] if isinstance(each, Node) else f"o{each}" for each in sizes]
    return {
        "width": where.size[0],
        "height": where.size[1],
        "nodes": [boxes.get(node) for node in graph.nodes],
        "outputs": [boxes[name] for name in graph.outputs],
        "lines": {f"{ids[source]} {ids[target]}": path for (source, target), path in where.lines.items()},
    }


def _width(shown: Node | str, letters: Letters) -> float:
    """Pixels that a label needs."""
    if isinstance(shown, str):
        text = letters(shown)
    else:
        text = letters(shown.name) if shown.name else ""
        text += "".join([f" {arg.value:.3g}" for arg in shown.args if arg.value is not None])
        if shown.args:
            text += f": {columns(shown.op).symbol}" if shown.name else columns(shown.op).symbol
    letters_wide = len(text.replace("\u0307", "").replace("\u0308", ""))
    return max(58.0, 7.4 * letters_wide + 14.0)


def _stage(node: Node) -> str:
    """The row of the picture: which sweep made the node."""
    roles = node.roles
    if ADJOINT in roles and TANGENT in roles and PRIMAL not in roles:
        return "both sweeps"
    return next((stage for role, stage in STAGES.items() if role in roles), STAGES[PRIMAL])


def _table(table: StateTable, letters: Letters) -> dict[str, Json]:
    number = {name: i for i, name in enumerate(table.graph.outputs)}
    return {
        "caption": table.caption,
        "header": list(table.header),
        "rows": [[row, [number[name] for name in outputs]] for row, outputs in table.rows.items()],
        **_graph(table.graph, letters),
    }


def _short(value: float) -> float:
    return float(f"{value:.5g}")
