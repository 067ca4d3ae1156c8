"""Independence: the proof that no path leads from one group of nodes to another, or the edges to blame for one."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from ...core.builder import Builder
from ...core.checks import GraphError
from ...core.forward import tangents
from ...core.graph import Edge, Graph
from ...core.label import ADJOINT
from ...core.node import Node, constant
from ...core.traversal import descendants
from ...util.words import counted
from ...writing.networkx_queries import minimum_cut
from ...writing.source_lines import lines_text
from ..names import Name, Names, joined
from ..paths import ancestors, best_paths, between, edges_among
from .finding import Finding

Group = Name | Sequence[Name]
STEPS = 8  # nodes that a path's text names; of more, the first and the last
SLOPE_NODES = 200  # a dependence made from more nodes has no formula that fits a line


class Leak(NamedTuple):
    """A derivative that counts another one as well: df/dqd gains dt * df/dq."""

    derivative: str
    gains: str


def check_independence(names: Names, first: Group, second: Group, function: str) -> tuple[list[Finding], list[str]]:
    """Violations by which one group depends on the other, either way, and the proofs where none does.

    Raises GraphError when the groups share a node.
    """
    groups = names.group(first), names.group(second)
    if shared := [node for node in groups[0] if node in set(groups[1])]:
        raise GraphError(f"{names.text(shared[0])} is in both groups, and cannot be independent of itself")
    findings, proofs = [], []
    for dependent, on in (groups, groups[::-1]):
        inside = between(names.graph.nodes, on, dependent)
        if inside:
            findings.append(_blame(names, inside, dependent, on, function))
        else:
            proofs.append(_proof(names, dependent, on))
    return findings, proofs


def _proof(names: Names, dependent: list[Node], on: list[Node]) -> str:
    to = _called(names, dependent)
    claim = f"no path leads from {_called(names, on)} to {to}"
    if not any([node.args for node in dependent]):
        return f"{claim}: {to} {'are inputs' if len(dependent) > 1 else 'is an input'}."
    reached = ancestors(dependent)
    sources = [names.text(node) for node in names.graph.inputs if node in reached]
    return f"{claim}, made from {joined(sources, 12) or 'numbers'} alone."


def _blame(names: Names, inside: list[Node], dependent: list[Node], on: list[Node], function: str) -> Finding:
    """The finding for `dependent`, which depends on `on` through the nodes `inside`: a minimum cut of the paths."""
    allowed, sources, sinks = set(inside), set(on), set(dependent)
    edges = [edge for edge in edges_among(inside) if edge.target not in sources and edge.source not in sinks]
    starts, ends = [node for node in on if node in allowed], [node for node in dependent if node in allowed]
    cut = minimum_cut(edges, starts, ends)
    paths = _paths_through(cut, inside, edges, starts, ends)
    pairs = dict.fromkeys([(path[0].source, path[-1].target) for path in paths])
    leaks = [_leak(names, *pair, sources | sinks, function) for pair in pairs]
    through = _derivatives_through(names.graph, paths)
    needed = ancestors(names.graph.outputs.values(), through or ())
    wrong = [node for node in names.graph.nodes if node not in needed]
    number = {node: i for i, node in enumerate(names.graph.nodes)}
    return Finding(
        "dependence",
        _report(names, cut, paths, dict(zip(pairs, leaks, strict=True)), through, wrong),
        tuple(wrong) or tuple(dict.fromkeys([node for path in paths for edge in path for node in edge[:2]])),
        tuple(cut),
        {
            "dependent": [names.text(sink) for sink in dict.fromkeys([sink for _, sink in pairs])],
            "on": [names.text(source) for source in dict.fromkeys([source for source, _ in pairs])],
            "cut": [
                {
                    "text": _edge_text(names, edge),
                    "edge": [number[edge.source], number[edge.target], edge.slot],
                    "lines": [str(line) for line in sorted(edge.target.lines)],
                }
                for edge in cut
            ],
            "paths": [_path_text(names, path) for path in paths],
            "corrupted": [leak._asdict() for leak in leaks],
            "derivatives_through": None if through is None else len(through),
            "nodes_for_this_alone": [number[node] for node in wrong],
        },
    )


def _report(
    names: Names,
    cut: Sequence[Edge],
    paths: Sequence[Sequence[Edge]],
    leaks: Mapping[tuple[Node, Node], Leak],
    through: set[Node] | None,
    wrong: Sequence[Node],
) -> str:
    sources, sinks = (list(dict.fromkeys(ends)) for ends in zip(*leaks, strict=True))
    dependence = f"{_called(names, sinks)} {_verb(sinks, 'depend')} on {_called(names, sources)}."
    lines = [f"{dependence} Without {'this edge' if len(cut) == 1 else f'these {len(cut)} edges'} there is no path:"]
    shown = [_edge_text(names, edge) for edge in cut]
    width = max(map(len, shown))
    gains = "would gain" if through == set() else "gains"
    for edge, text, path in zip(cut, shown, paths, strict=True):
        leak = leaks[path[0].source, path[-1].target]
        lines.append(f"  {text:<{width}}  through it {leak.derivative} {gains} {leak.gains}")
        if edge.target.lines:
            lines.append(f"    written at {lines_text([edge.target])}")
        if len(path) > 2:
            lines.append(f"    on the path {_path_text(names, path)}")
    if through:
        affected = descendants(names.graph.nodes, through)
        outputs = [names.shown(name) for name, node in names.graph.outputs.items() if node in affected]
        alone = f"{counted(len(wrong), 'node')} of {len(names.graph.nodes)} {_verb(wrong, 'serve')} nothing else."
        lines.append(f"{joined(outputs)} {_verb(outputs, 'contain')} what was gained; {alone}")
    elif through is not None:
        lines.append("No derivative in this graph was taken that way.")
    return "\n".join(lines)


def _paths_through(
    cut: Sequence[Edge], nodes: Sequence[Node], edges: Sequence[Edge], sources: Sequence[Node], sinks: Sequence[Node]
) -> list[list[Edge]]:
    """Shortest path from a source to a sink through each edge of the cut."""
    paths = []
    for edge in cut:
        (before,) = best_paths(nodes, edges, sources, [edge.source], 1)
        (after,) = best_paths(nodes, edges, [edge.target], sinks, 1)
        paths.append([*before, edge, *after])
    return paths


def _leak(names: Names, source: Node, sink: Node, members: set[Node], function: str) -> Leak:
    """Share of the derivative by `source` that passes through `sink`: d sink / d source, all other members fixed."""
    a, b = names.text(source), names.text(sink)
    gained = f"d{function}/d{b}"
    slope = None
    if len(ancestors([sink])) <= SLOPE_NODES:
        seeds = {node: constant(0.0) for node in members if node not in (source, sink)} | {source: constant(1.0)}
        slope = tangents(seeds, [sink], Builder()).get(sink)
    text = names.text(slope) if slope is not None else "?"
    if "?" in text:
        text = f"d{b}/d{a}"
    elif " " in text:
        text = f"({text})" if any(f" {sign} " in text for sign in "+-<=") else text
    return Leak(f"d{function}/d{a}", gained if text == "1" else f"{text} * {gained}")


def _derivatives_through(graph: Graph, paths: Sequence[Sequence[Edge]]) -> set[Node] | None:
    """The adjoint nodes that reverse mode made along these paths, by the tags that only their inner nodes have.

    None where no tag sets the inner nodes apart.
    """
    ends = {path[0].source for path in paths} | {path[-1].target for path in paths}
    inner = {edge.target for path in paths for edge in path} - ends
    inner_tags = {tag for node in inner for tag in node.tags} - {tag for node in ends for tag in node.tags}
    return {node for node in graph.nodes if ADJOINT in node.roles and inner_tags & node.tags} if inner_tags else None


def _edge_text(names: Names, edge: Edge) -> str:
    return f"{names.text(edge.source)} -> {names.text(edge.target)}"


def _path_text(names: Names, path: Sequence[Edge]) -> str:
    nodes = [path[0].source, *[edge.target for edge in path]]
    if len(nodes) <= STEPS:
        return " -> ".join([names.text(node) for node in nodes])
    first, last = ([names.text(node) for node in part] for part in (nodes[: STEPS // 2], nodes[-(STEPS // 2) :]))
    return " -> ".join([*first, "...", *last])


def _called(names: Names, nodes: Iterable[Node]) -> str:
    return joined([names.text(node) for node in nodes], 12)


def _verb(subjects: Sequence[object], verb: str) -> str:
    return verb if len(subjects) > 1 else f"{verb}s"
