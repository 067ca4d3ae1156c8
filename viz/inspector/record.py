"""The data of the page: graphs as arrays, one place for what the versions share, clusters, and slopes of operations."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import ADJOINT, OPS, PRIMAL, TANGENT, Op

from .. import theme
from .content import Motion, Version
from .layers import layered

ENERGIES = ("kinetic", "potential")  # a tag beside one of these is a body
OTHER = "other"  # of a body, what carries no energy's tag
MANY = 60  # clusters; above, they are not split by energy
STAGES = {PRIMAL: "as written", ADJOINT: "reverse sweep", TANGENT: "forward sweep"}
TWICE = "both sweeps"
FEW = 24  # inputs and outputs whose boxes have room for what a person calls them
_TALL = 34  # pixels that a node's label takes at least


class Group(NamedTuple):
    """What a cluster's nodes have in common."""

    column: str  # body, or another tag
    stage: str
    title: str  # energy, or other tags
    marked: bool


def record(
    versions: Sequence[Version],
    motion: Motion | None,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """All that the page's script reads, as JSON can hold it.

    names, units: {name in a graph: what a person calls it, and its unit}.

    A place is a position of the picture: nodes that compute the same in two versions share it.
    """
    bodies = _bodies(versions)
    rows = [version.rows(len(motion.t) if motion else 1) for version in versions]
    marked = [frozenset(version.marked) for version in versions]
    fine = [
        [_group(node, bodies, node in wrong) for node in v.graph.nodes]
        for v, wrong in zip(versions, marked, strict=True)
    ]
    if len({group for groups in fine for group in groups if group}) > MANY:  # an energy more or less is then too fine
        fine = [[each and each._replace(title="") for each in groups] for groups in fine]
    places, at = _places(versions, fine)
    clusters = sorted({group for _, group, _ in places if group}, key=_cluster_order)
    letters = _letters(versions, names or {})
    drawn = _drawn(places, clusters, versions, at, letters)
    known = {each.name for version in versions for each in (*version.graph.inputs, *version.graph.nodes) if each.name}
    known |= {name for version in versions for name in version.graph.outputs}
    return {
        "ops": {op.name: [op.symbol, op.commutative] for op in OPS.values()},
        "slopes": {op.name: slopes(op) for op in OPS.values()},
        **drawn,
        "stages": [stage for stage in (*STAGES.values(), TWICE) if any(group.stage == stage for group in clusters)],
        "columns": _columns(clusters, bodies),
        "called": [[name, text] for name, text in theme.called(names or {}).items() if name in known],
        "units": [[name, text] for name, text in (units or {}).items() if name in known],
        "versions": [
            {**_version(version, own, letters), "rows": table.tolist()}
            for version, own, table in zip(versions, at, rows, strict=True)
        ],
        "motion": None
        if motion is None
        else {
            "t": [_short(t) for t in motion.t],
            "points": None
            if motion.points is None
            else [[[_short(x), _short(y)] for x, y in each] for each in motion.points],
            "parents": list(motion.parents),
        },
    }


def slopes(op: Op) -> dict[str, Any]:
    """The partials of an operation as a small program, from its row: 0 is the output, 1.. the arguments, then `code`.

    A line of code is a number, or an operation and the numbers of its arguments; `out` names one result an argument.
    """
    y, *args = cg.variables(["y", *[f"x{slot}" for slot in range(op.arity)]])
    partials = [cg.constant(each) if not isinstance(each, Node) else each for each in op.partials(y, *args)]
    graph = Graph([y, *args], {str(i): node for i, node in enumerate(partials)})
    number = {node: i for i, node in enumerate([y, *args])}
    code: list[Any] = []
    for node in graph.nodes:
        if node not in number:
            number[node] = op.arity + 1 + len(code)
            code.append(node.value if node.value is not None else [node.op.name, *[number[arg] for arg in node.args]])
    return {"code": code, "out": [number[node] for node in partials]}


def _bodies(versions: Sequence[Version]) -> list[str]:
    """Tags that stand beside an energy, in the order in which they come; all tags with a number if there is none."""
    found: dict[str, None] = {}
    other: set[str] = set()
    for version in versions:
        for node in version.graph.nodes:
            if node.tags & set(ENERGIES):
                found |= dict.fromkeys(sorted(node.tags - set(ENERGIES), key=theme.natural_order))
            other |= node.tags
    numbered = [tag for tag in other if tag[-1].isdigit()]
    return sorted(found or numbered, key=theme.natural_order)


def _group(node: Node, bodies: Sequence[str], marked: bool) -> Group | None:
    if not node.args:
        return None
    own = [body for body in bodies if body in node.tags] if node.tags else []
    rest = sorted(node.tags - set(own), key=theme.natural_order)
    column = own[0] if own else rest.pop(0) if rest else ""
    return Group(column, _stage(node), ", ".join(rest) or (OTHER if own else ""), marked)


def _stage(node: Node) -> str:
    roles = node.roles
    if ADJOINT in roles and TANGENT in roles and PRIMAL not in roles:
        return TWICE
    return next((stage for role, stage in STAGES.items() if role in roles), STAGES[PRIMAL])


_Place = tuple[Node, Group | None, list[tuple[int, int]]]  # a first node there, its cluster, and (version, node) there


def _places(versions: Sequence[Version], groups: Sequence[Sequence[Group | None]]) -> tuple[list[_Place], list[Any]]:
    """Places, and of each version the place of every node. A named node stands for the variable of that name."""
    inputs = {name for version in versions for name in version.graph.input_names}
    meaning: dict[Any, int] = {}
    found: dict[tuple[Any, ...], int] = {}
    places: list[_Place] = []
    at = []
    for v, version in enumerate(versions):
        means: dict[Node, int] = {}
        seen: Counter[tuple[Any, ...]] = Counter()
        own = []
        for i, node in enumerate(version.graph.nodes):
            key: tuple[Any, ...]
            if node.name in inputs:
                key = ("name", node.name)
            elif node.value is not None:
                key = ("value", node.value, math.copysign(1.0, node.value))
            else:
                args = [means[arg] for arg in node.args]
                key = (node.op.name, *(sorted(args) if node.op.commutative else args))
            means[node] = meaning.setdefault(key, len(meaning))
            kind = (means[node], groups[v][i])
            same = (*kind, seen[kind])
            seen[kind] += 1
            if same not in found:
                found[same] = len(places)
                places.append((node, groups[v][i], []))
            places[found[same]][2].append((v, i))
            own.append(found[same])
        at.append(own)
    return places, at


def _drawn(
    places: Sequence[_Place],
    clusters: Sequence[Group],
    versions: Sequence[Version],
    at: Sequence[Sequence[int]],
    letters: Callable[[str], str],
) -> dict[str, Any]:
    """Clusters with their sizes, and where each place is in its cluster."""
    number = {group: i for i, group in enumerate(clusters)}
    members: list[list[int]] = [[] for _ in clusters]
    for p, (_, group, _) in enumerate(places):
        if group:
            members[number[group]].append(p)
    lines: list[set[tuple[int, int]]] = [set() for _ in clusters]
    for v, version in enumerate(versions):
        place = dict(zip(version.graph.nodes, at[v], strict=True))
        for edge in version.graph.edges:
            s, t = place[edge.source], place[edge.target]
            if places[s][1] is not None and places[s][1] == places[t][1]:
                lines[number[places[t][1]]].add((s, t))  # type: ignore[index]
    spot: list[list[float]] = [[-1, 0, 0, 0]] * len(places)
    drawn = []
    for c, (group, inside) in enumerate(zip(clusters, members, strict=True)):
        local = {p: i for i, p in enumerate(inside)}
        widths = [_width(places[p][0], letters) for p in inside]
        edges = sorted((local[s], local[t]) for s, t in lines[c] if local[s] < local[t])
        layout = layered(widths, edges)
        for p, x, y, width in zip(inside, layout.x, layout.y, widths, strict=True):
            spot[p] = [c, round(x), round(y), round(width)]
        drawn.append(
            {
                "column": group.column,
                "stage": group.stage,
                "title": group.title,
                "marked": group.marked,
                "width": round(layout.width),
                "height": round(layout.height),
            }
        )
    for p, (node, group, _) in enumerate(places):
        if group is None and node.value is None:
            spot[p] = [-1, 0, 0, round(_width(node, letters))]
    return {"clusters": drawn, "places": spot}


def _letters(versions: Sequence[Version], names: Mapping[str, str]) -> Callable[[str], str]:
    """What the picture shows of a name: what a person calls it, or letters where there are many."""
    leaves = {name for version in versions for name in (*version.graph.input_names, *version.graph.outputs)}
    shown = theme.called(names) if len(leaves) <= FEW else {}
    return lambda name: shown.get(name) or theme.pretty(name)


def _width(node: Node, letters: Callable[[str], str]) -> float:
    """Pixels that the node's label and value need."""
    name = len(letters(node.name).replace("\u0307", "").replace("\u0308", "")) if node.name else 0
    constants = sum([len(f"{arg.value:.4g}") + 1 for arg in node.args if arg.value is not None])
    return max(_TALL + 12, 7.5 * (name + constants + len(node.op.symbol)) + 14)


def _cluster_order(group: Group) -> tuple[Any, ...]:
    return theme.natural_order(group.column), group.stage, group.marked, group.title


def _columns(clusters: Sequence[Group], bodies: Sequence[str]) -> list[str]:
    """Columns of the picture: what belongs to no body first, then the bodies."""
    used = {group.column for group in clusters}
    return [*sorted(used - set(bodies), key=theme.natural_order), *[body for body in bodies if body in used]]


def _version(version: Version, place: Sequence[int], letters: Callable[[str], str]) -> dict[str, Any]:
    graph = version.graph
    number = {node: i for i, node in enumerate(graph.nodes)}
    labels: dict[tuple[tuple[str, ...], str], int] = {}
    ops, args, label = [], [], []
    for node in graph.nodes:
        ops.append(node.op.name)
        args.append(_number(node.value) if node.value is not None else [number[arg] for arg in node.args])
        kind = (tuple(sorted(node.tags, key=theme.natural_order)), theme.role_of(node))
        label.append(labels.setdefault(kind, len(labels)))
    marked = sorted([number[node] for node in set(version.marked)])
    names = {i: [node.name, letters(node.name)] for node, i in number.items() if node.name}
    return {
        "name": version.name,
        "about": version.about,
        "ops": ops,
        "args": args,
        "place": list(place),
        "label": label,
        "labels": [[list(tags), role] for tags, role in labels],
        "names": names,
        "marked": marked,
        "inputs": [[name, number.get(node, -1)] for name, node in zip(graph.input_names, graph.inputs, strict=True)],
        "outputs": [[name, letters(name), number[node]] for name, node in graph.outputs.items()],
        "counts": [len(graph.nodes), len(graph.edges)],
    }


def _number(value: float) -> float | str:
    """JSON has no infinity."""
    return value if math.isfinite(value) else ("Infinity" if value > 0 else "-Infinity")


def _short(value: float) -> float:
    return float(f"{value:.5g}")
