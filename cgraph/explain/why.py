"""Dependence of an output on an input, and what all paths add up to; or independence, and how far the input reaches."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..core.checks import GraphError
from ..core.graph import Edge, Graph, values_of
from ..core.html_text import html_lines, html_table, html_text
from ..core.node import Node
from ..core.traversal import descendants
from ..operations.operation import columns
from ..util.json_type import Json, json_number
from ..util.require import require_graph
from ..util.words import counted
from ..writing.source_lines import lines_text
from .names import Name, Names, Point, checked_point, joined
from .paths import ancestors, best_paths, between, by_target, edges_among, path_count

EXACT = 10**15  # up to here a number of paths is printed digit by digit
LONGEST_PATH = 90  # characters up to which a path is written out; a longer one is written by its tags


@dataclass(frozen=True, eq=False)
class Path:
    """One path from an input to an output.

    Attributes
    ----------
    edges : tuple of Edge
        In order; empty when the output is the input.
    value : float or None
        The product of the partials along it; None without a point.
    text : str
        Its products and functions by name, %number and tag. Sums are left out, but where two paths would read the same:
        then `%7.2` is the second argument of node %7, for every step.
    """

    edges: tuple[Edge, ...]
    value: float | None
    text: str


@dataclass(frozen=True, eq=False)
class Why:
    """Dependence of an output on an input; made by `why`. `str` of it is the explanation.

    Attributes
    ----------
    graph : Graph
        Where they are.
    output, input : str
        Their names.
    count : int
        The number of paths, exact however large.
    paths : tuple of Path
        The heaviest, or without a point the shortest.
    derivative : float or None
        d output / d input at the point.
    weight : float or None
        The sum over all paths of the absolute value of the product of partials.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> answer = cg.why(cg.Graph([x], {"y": x * x}), "y", "x")
    >>> answer.count
    2
    """

    graph: Graph
    output: str
    input: str
    count: int
    paths: tuple[Path, ...]
    derivative: float | None = None
    weight: float | None = None

    @property
    def share(self) -> float | None:
        """The part of `weight` in the listed paths, 0 to 1; None without a point, or where no path has any."""
        if not self.weight or not math.isfinite(self.weight):
            return None
        return min(1.0, sum([abs(path.value or 0.0) for path in self.paths]) / self.weight)

    @property
    def nodes(self) -> frozenset[Node]:
        """Nodes of the listed paths, to be marked in a drawing."""
        return frozenset([node for path in self.paths for edge in path.edges for node in (edge.source, edge.target)])

    @property
    def edges(self) -> frozenset[Edge]:
        """Edges of the listed paths, to be marked in a drawing."""
        return frozenset([edge for path in self.paths for edge in path.edges])

    def __str__(self) -> str:
        before, after = self._sentences()
        values = [_weight(path) for path in self.paths]
        width = max(map(len, values), default=0)
        rows = [f"  {value:>{width}}  {path.text}" for value, path in zip(values, self.paths, strict=True)]
        return "\n".join([*before, *rows, *after])

    def _repr_html_(self) -> str:
        before, after = self._sentences()
        rows = [(path.text, _weight(path)) for path in self.paths]
        table = html_table(("path", "weight" if self.derivative is not None else ""), rows) if rows else ""
        return "".join([html_text(each) for each in before]) + table + "".join([html_text(each) for each in after])

    def _sentences(self) -> tuple[list[str], list[str]]:
        """Sentences before and after the list of paths."""
        if not self.count:
            return [f"{self.output} does not depend on {self.input}; cg.why_not tells where it stops."], []
        paths = counted(self.count, "path") if self.count <= EXACT else f"{digits_of(self.count)} paths"
        said = [f"{self.output} depends on {self.input} along {paths}."]
        if self.derivative is not None:
            said.append(f"d {self.output} / d {self.input} = {self.derivative:.6g}, the sum over all of them.")
            return said, [self._balance()]
        cut = f"These are the shortest {len(self.paths)}; with a point, at={{...}}, the heaviest are listed."
        return said, [cut] if len(self.paths) < self.count else []

    def _balance(self) -> str:
        if self.weight == 0.0:
            return "At this point each of them has a partial that is zero."
        if len(self.paths) == self.count:
            return "These are all."
        listed = sum([path.value or 0.0 for path in self.paths])
        share = f" and carry {self.share:.1%} of the weight of all" if self.share is not None else ""
        return f"The {len(self.paths)} heaviest add up to {listed:.6g}{share}."

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON; nodes are numbered as in `graph.nodes`, an edge is (source, target, argument slot)."""
        number = {node: i for i, node in enumerate(self.graph.nodes)}
        return {
            "output": self.output,
            "input": self.input,
            "paths": self.count if self.count <= EXACT else digits_of(self.count),
            "derivative": json_number(self.derivative),
            "weight": json_number(self.weight),
            "share": self.share,
            "listed": [
                {
                    "value": json_number(path.value),
                    "text": path.text,
                    "edges": [[number[edge.source], number[edge.target], edge.slot] for edge in path.edges],
                }
                for path in self.paths
            ],
        }


def why(
    graph: Graph,
    output: Name,
    input: Name,  # noqa: A002 (its name)
    at: Point | None = None,
    k: int = 10,
    *,
    names: Mapping[str, str] | None = None,
) -> Why:
    """Explain why `output` depends on `input`: the number of paths, and the k heaviest at the point `at`.

    The value of a path is the product of the partials along it; over all paths these add up to the derivative. All
    numbers come from sweeps over the nodes, without a list of paths, so that 10^20 of them are no obstacle.

    Parameters
    ----------
    graph : Graph
        Where they are.
    output, input : str or Node
        Names of an output and an input, or of nodes named by `cg.with_name`, or nodes.
    at : mapping of str to float, optional
        {input: number} for all inputs. Without it, the k shortest paths are listed.
    k : int
        How many paths to list.
    names : mapping of str to str, optional
        {name in the graph: what a person calls it}, such as `dynamics.display_names(model)`: shown, and taken beside
        the graph's, as in `why(graph, "tau.knee", "q.hip", names=..)`.

    Returns
    -------
    Why
        `print` it for the explanation.

    Raises
    ------
    GraphError
        If the graph has no node or several nodes of a name, or the derivative is not finite.
    ValueError
        If a number in `at` is not finite, or k is negative.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> print(cg.why(cg.Graph([x], {"y": x * x + cg.sin(x)}), "y", "x", at={"x": 0.0}))
    y depends on x along 3 paths.
    d y / d x = 1, the sum over all of them.
      +1  x -> sin(x) -> y
    The 1 heaviest add up to 1 and carry 100.0% of the weight of all.
    """
    require_graph("why", graph)
    known = Names(graph, names)
    if not isinstance(k, int) or isinstance(k, bool) or k < 0:
        raise ValueError(f"k must be a whole number of paths, at least 0, got {k!r}")
    source, sink = known.one(input, "input"), known.output(output, "output")
    to, origin = known.called(output), known.called(input)
    nodes = between(graph.nodes, [source], [sink])
    edges = [edge for edge in edges_among(nodes) if edge.target is not source]
    count = path_count(nodes, edges, source, sink) if nodes else 0
    if at is None:
        shortest = best_paths(nodes, edges, [source], [sink], k) if count else []
        return Why(
            graph, to, origin, count, tuple(_told_apart(known, [_path(known, to, path, None) for path in shortest]))
        )
    partials = values_of(graph.inputs, [edge.partial for edge in edges], checked_point(known, at) if edges else {})
    slopes = dict(zip(edges, map(float, partials), strict=True))
    edges = _contributing(known, nodes, edges, slopes, sink)
    derivative, weight = _path_sums(nodes, edges, slopes, source, sink)
    # The largest |product| of partials has the least sum of -log |partial|.
    heaviest = best_paths(nodes, edges, [source], [sink], k, lambda edge: -math.log(abs(slopes[edge]))) if count else []
    paths = [_path(known, to, path, math.prod([slopes[edge] for edge in path])) for path in heaviest]
    return Why(graph, to, origin, count, tuple(_told_apart(known, paths)), derivative, weight)


def _contributing(
    names: Names, nodes: Sequence[Node], edges: Sequence[Edge], slopes: dict[Edge, float], sink: Node
) -> list[Edge]:
    """The edges with a nonzero partial from which a path of such edges leads to the sink.

    What lies behind a zero, such as the branch that `where` does not take, may have no derivative: zero wins.
    """
    live, kept = {sink}, set[Edge]()
    incoming = by_target(edges)
    for node in reversed(nodes):
        for edge in incoming.get(node, ()) if node in live else ():
            slope = slopes[edge]
            if slope == 0.0:
                continue
            if not math.isfinite(slope):
                raise GraphError(f"the derivative of {names.line(node)} by {names.text(edge.source)} is {slope} here")
            live.add(edge.source)
            kept.add(edge)
    return [edge for edge in edges if edge in kept]


def _path_sums(
    nodes: Sequence[Node], edges: Sequence[Edge], slopes: dict[Edge, float], source: Node, sink: Node
) -> tuple[float, float]:
    """Sum over all paths of the product of partials, and of its absolute value, by forward accumulation.

    s_source = 1, s_y = sum over edges (x, y) of (dy/dx) s_x; weights with |dy/dx|.
    """
    sums = dict.fromkeys(nodes, 0.0)
    weights = dict.fromkeys(nodes, 0.0)
    sums[source] = weights[source] = 1.0
    for edge in edges:
        sums[edge.target] += slopes[edge] * sums[edge.source]
        weights[edge.target] += abs(slopes[edge]) * weights[edge.source]
    return sums.get(sink, 0.0), weights.get(sink, 0.0)


def _path(names: Names, output: str, edges: tuple[Edge, ...], value: float | None) -> Path:
    if not edges:
        return Path(edges, value, output)
    inner = [
        edge.target for edge in edges if edge.target.name or not columns(edge.target.op).signs
    ]  # sums hand the value on
    start, end = names.text(edges[0].source), [] if inner and names.text(inner[-1]) == output else [output]
    text = " -> ".join([start, *[names.text(node) for node in inner], *end])
    tags = sorted({tag for node in inner for tag in node.tags})
    if len(text) > LONGEST_PATH:
        text = " -> ".join([start, *_route(names, inner), *end])
    elif tags:
        text += f"  [{', '.join(tags)}]"
    lines = lines_text(inner)
    return Path(edges, value, f"{text}  {lines}" if lines else text)


def _route(names: Names, nodes: Sequence[Node]) -> list[str]:
    """A long path by names, tags and operations: neighbors with the same tags count as one step."""
    steps: list[tuple[str, list[str]]] = []
    for node in nodes:
        if node.name:
            steps.append((names.text(node), []))
        else:
            tags = f" [{', '.join(sorted(node.tags))}]" if node.tags else ""
            if not steps or steps[-1][0] != tags:
                steps.append((tags, []))
            steps[-1][1].append(f"{node.op.name} %{names.number[node]}")
    return [" ".join(ops) + name for name, ops in steps]


def _told_apart(names: Names, paths: Sequence[Path]) -> list[Path]:
    """The paths; of those that read the same, with all their sums, and by which argument each operation is reached."""
    times, result = Counter([path.text for path in paths]), []
    for path in paths:
        edges = " ".join([f"%{names.number[edge.target]}.{edge.slot + 1}" for edge in path.edges])
        result.append(replace(path, text=f"{path.text}  ({edges})") if times[path.text] > 1 else path)
    return result


def digits_of(count: int) -> str:
    """A whole number beyond 10^15 as text, such as `3.21e+41`."""
    shift = max(0, count.bit_length() - 64)
    log = math.log10(count >> shift) + shift * math.log10(2.0)
    mantissa = 10.0 ** (log % 1.0)
    return f"{mantissa:.3g}e+{math.floor(log)}"


def _weight(path: Path) -> str:
    return "" if path.value is None else f"{path.value:+.4g}"


@dataclass(frozen=True, eq=False)
class WhyNot:
    """Independence of an output from an input; made by `why_not`. `str` of it is the explanation.

    Attributes
    ----------
    graph : Graph
        Where they are.
    output, input : str
        Their names.
    reached : frozenset of Node
        The descendants of the input.
    made_from : frozenset of Node
        The ancestors of the output; no node is in both sets.
    meetings : tuple of Node
        The first descendants of the input that also use an ancestor of the output: there the two are nearest.
    outputs : tuple of str
        Names of the outputs that depend on the input.
    inputs : tuple of str
        Names of the inputs that the output depends on.
    names : mapping of str to str
        {name in the graph: what a person calls it}.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.why_not(cg.Graph([x, y], {"f": cg.sin(x), "g": x * y}), "f", "y").outputs
    ('g',)
    """

    graph: Graph
    output: str
    input: str
    reached: frozenset[Node]
    made_from: frozenset[Node]
    meetings: tuple[Node, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    names: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        names = Names(self.graph, self.names)
        number = len(self.reached) - 1
        lines = [f"{self.output} does not depend on {self.input}."]
        if number:
            lines.append(
                f"{self.input} reaches {counted(number, 'other node')}, and of the outputs {joined(self.outputs)}."
            )
        elif self.outputs:
            lines.append(f"{self.input} is the output {joined(self.outputs)}; no operation uses it.")
        else:
            lines.append(f"Nothing uses {self.input}.")
        lines.append(f"{self.output} is made from {joined(self.inputs, 12) or 'constants'}.")
        if self.meetings:
            shown = "; ".join([names.line(node) for node in self.meetings[:3]])
            lines.append(f"The two meet where {self.output} does not look: {shown}.")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return html_lines(str(self))

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON; nodes are numbered as in `graph.nodes`."""
        nodes = self.graph.nodes
        return {
            "output": self.output,
            "input": self.input,
            "reached_outputs": list(self.outputs),
            "made_from_inputs": list(self.inputs),
            "reached": [i for i, node in enumerate(nodes) if node in self.reached],
            "made_from": [i for i, node in enumerate(nodes) if node in self.made_from],
            "meetings": [i for i, node in enumerate(nodes) if node in set(self.meetings)],
        }


def why_not(
    graph: Graph,
    output: Name,
    input: Name,  # noqa: A002 (its name)
    *,
    names: Mapping[str, str] | None = None,
) -> WhyNot:
    """Explain why `output` does not depend on `input`: the input's reach, and what the output is made from.

    Parameters
    ----------
    graph : Graph
        Where they are.
    output, input : str or Node
        Names of an output and an input, or of nodes named by `cg.with_name`, or nodes.
    names : mapping of str to str, optional
        {name in the graph: what a person calls it}, as `why` takes them.

    Returns
    -------
    WhyNot
        `print` it for the explanation.

    Raises
    ------
    GraphError
        If the output does depend on the input, or the graph has no node or several nodes of a name.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> print(cg.why_not(cg.Graph([x, y], {"f": cg.sin(x), "g": x * y}), "f", "y"))
    f does not depend on y.
    y reaches 1 other node, and of the outputs g.
    f is made from x.
    The two meet where f does not look: %2 = x * y.
    """
    require_graph("why_not", graph)
    known = Names(graph, names)
    source, sink = known.one(input, "input"), known.output(output, "output")
    reached, made_from = descendants(graph.nodes, [source]), ancestors([sink])
    to, origin = known.called(output), known.called(input)
    if sink in reached:
        raise GraphError(f"{to} depends on {origin}; cg.why lists the paths")
    return WhyNot(
        graph,
        to,
        origin,
        reached=frozenset(reached),
        made_from=frozenset(made_from),
        meetings=_first_meetings(graph, reached, made_from),
        outputs=tuple([known.shown(name) for name, node in graph.outputs.items() if node in reached]),
        inputs=tuple([known.text(node) for node in graph.inputs if node in made_from]),
        names=names or {},
    )


def _first_meetings(graph: Graph, reached: set[Node], made_from: set[Node]) -> tuple[Node, ...]:
    """Nodes of `reached` with an argument, not a constant, in `made_from`; none of them a descendant of another."""
    met: set[Node] = set()
    first = []
    for node in graph.nodes:
        if node in reached:
            if any([arg in met for arg in node.args]):
                met.add(node)
            elif any([arg in made_from and arg.value is None for arg in node.args]):
                met.add(node)
                first.append(node)
    return tuple(first)
