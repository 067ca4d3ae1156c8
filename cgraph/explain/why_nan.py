"""Where a number that is not finite comes from: the first operation whose value, or whose partial, is none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..core.evaluation import real_number
from ..core.graph import Edge, Graph, values_of
from ..core.html_text import html_lines
from ..core.node import Node, constant
from ..core.reverse import cotangents
from ..util.json_type import Json, json_number
from ..util.require import require_graph, require_mapping
from .names import Name, Names, joined
from .paths import between, edges_among

SHOWN = 8  # inputs, and operations on the way, that the text has


@dataclass(frozen=True, eq=False)
class WhyNan:
    """Origin of a number that is not finite; made by `why_nan`. `str` of it is the explanation.

    Attributes
    ----------
    graph : Graph
        Where it is.
    what : str
        The output, or "d y / d x"; empty where all that was asked for is finite.
    value : float
        Of it; NaN or infinite.
    node : Node or None
        The first operation, in the order of evaluation, that is not finite while its arguments are; or the input that
        is not; or whose partial is not finite. None where all is finite.
    slot : int or None
        The argument by which the partial is not finite; None where the value itself is not.
    result : float
        The value or the partial of the node.
    arguments : mapping of str to float
        Values of the node's arguments, by name or as `%2 = x * y`.
    inputs : mapping of str to float
        The inputs that the node depends on.
    at : mapping of str to float
        All inputs: the point that was asked for.
    line : str
        The node as in the listing, with its tags, such as its body, and its lines if they are known.
    way : tuple of str
        From the node to the output.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> cg.why_nan(cg.Graph([x], {"y": 2.0 * cg.log(x)}), {"x": 0.0}).arguments
    {'x': 0.0}
    """

    graph: Graph
    what: str = ""
    value: float = 0.0
    node: Node | None = None
    slot: int | None = None
    result: float = 0.0
    arguments: Mapping[str, float] = field(default_factory=dict)
    inputs: Mapping[str, float] = field(default_factory=dict)
    at: Mapping[str, float] = field(default_factory=dict)
    line: str = ""
    way: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _repr_html_(self) -> str:
        return html_lines(str(self))

    def _lines(self) -> list[str]:
        if self.node is None and not self.what:
            return ["All values and derivatives are finite here."]
        lines = [f"{self.what} is {self.value}{f' at {_pairs(self.at)}' if self.at else ''}."]
        if self.node is None:
            return [*lines, "All values and partials are finite: it is the product of partials that overflows."]
        if not self.node.args:
            return [*lines, f"The input {self.line} is {self.result} itself."]
        of = "" if self.slot is None else "the partial of "
        by = "" if self.slot is None else f" by its argument {self.slot + 1}"
        values = {name: value for name, value in self.arguments.items() if f"{value:.6g}" != name}  # numbers are told
        lines.append(f"It begins with {of}{self.line}{by}, which is {self.result}, where {_pairs(values)}.")
        if self.inputs not in (self.arguments, self.at):
            lines.append(f"That depends on {_pairs(self.inputs) or 'no input'}.")
        way = self.way if len(self.way) <= SHOWN else [*self.way[: SHOWN - 2], "..", self.way[-1]]
        return [*lines, f"On its way: {' -> '.join(way)}."] if len(way) > 1 else lines

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON; the node is numbered as in `graph.nodes`, its number in the listing is in `line`."""
        number = {node: i for i, node in enumerate(self.graph.nodes)}
        return {
            "what": self.what,
            "value": str(self.value),
            "node": None if self.node is None else number.get(self.node),
            "slot": self.slot,
            "result": str(self.result),
            "arguments": {name: json_number(value) for name, value in self.arguments.items()},
            "inputs": {name: json_number(value) for name, value in self.inputs.items()},
            "at": {name: json_number(value) for name, value in self.at.items()},
            "line": self.line,
            "way": list(self.way),
        }


def why_nan(
    graph: Graph,
    at: Mapping[str, float],
    output: Name | None = None,
    input: Name | None = None,  # noqa: A002 (its name)
    *,
    names: Mapping[str, str] | None = None,
) -> WhyNan:
    """Where NaN or infinity comes from: the first operation whose value, or else whose partial, is not finite.

    Parameters
    ----------
    graph : Graph
        What is evaluated.
    at : mapping of str to float
        {input: number} for all inputs; one may be NaN or infinite, and is then the origin.
    output : str or Node, optional
        The output that is not finite, by default any: the first that is not.
    input : str or Node, optional
        By which an output is differentiated, where its derivative is not finite though its value is; by default any.
    names : mapping of str to str, optional
        {name in the graph: what a person calls it}, as of `why`.

    Returns
    -------
    WhyNan
        `print` it for the explanation; its `node` is None where all is finite.

    Raises
    ------
    GraphError
        For an input without value, and a name that is none.
    TypeError
        For what is no graph or no number.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> slant = cg.Graph([x, y], {"r": cg.sqrt(x * x - y) + 1.0})
    >>> print(cg.why_nan(slant, {"x": 1.0, "y": 5.0}))
    r is nan at x = 1 and y = 5.
    It begins with %3 = sqrt(%2), which is nan, where %2 = x * x - y = -4.
    On its way: %3 -> %4 -> r.
    >>> print(cg.why_nan(slant, {"x": 1.0, "y": 1.0}))
    d r / d x is inf at x = 1 and y = 1.
    It begins with the partial of %3 = sqrt(%2) by its argument 1, which is inf, where %2 = x * x - y = 0.
    On its way: %3 -> %4 -> r.
    """
    require_graph("why_nan", graph)
    known = Names(graph, names)
    given = known.inputs_of("at", require_mapping("at", at, "input: value"), all_of_them=True)
    point = {name: real_number(f"at: input {known.shown(name)!r}", value) for name, value in given.items()}
    sinks = dict(graph.outputs)
    if output is not None:
        sink = known.output(output, "output")
        sinks = {known.called(output): sink}
    nodes = list(dict.fromkeys([*graph.inputs, *graph.nodes]))
    values = dict(zip(nodes, map(float, values_of(graph.inputs, nodes, point)), strict=True))
    for name, sink in sinks.items():
        if not math.isfinite(values[sink]):
            way = _way(graph, values, sink, point)
            return _found(known, values, known.shown(name), values[sink], way, None, values[way[0]])
    sources = list(graph.inputs) if input is None else [known.one(input, "input")]
    for name, sink in sinks.items():
        bars = map(float, values_of(graph.inputs, cotangents({sink: constant(1.0)}, sources), point))
        for source, bar in zip(sources, bars, strict=True):
            if not math.isfinite(bar):
                what = f"d {known.shown(name)} / d {known.text(source)}"
                if (found := _partial(graph, source, sink, point)) is not None:
                    return _found(known, values, what, bar, *found)
                return WhyNan(graph, what, bar, at={known.shown(name): value for name, value in point.items()})
    return WhyNan(graph)


def _way(graph: Graph, values: Mapping[Node, float], sink: Node, point: Mapping[str, float]) -> list[Node]:
    """The way to the sink, by values that are not finite, from the first node with none behind it.

    What an operation does not take, such as a branch of `where`, has the partial 0, and is not behind it.
    """
    way: dict[Node, Node | None] = {sink: None}
    stack, ends = [sink], list[Node]()
    while stack:
        node = stack.pop()
        bad = [slot for slot, arg in enumerate(node.args) if not math.isfinite(values[arg])]
        slopes = values_of(graph.inputs, [Edge(node.args[slot], node, slot).partial for slot in bad], point)
        behind = [node.args[slot] for slot, slope in zip(bad, slopes, strict=True) if slope != 0.0]
        behind = behind or [node.args[slot] for slot in bad]  # 0 times NaN
        if not behind:
            ends.append(node)
        for arg in behind:
            if arg not in way:
                way[arg] = node
                stack.append(arg)
    order = {node: i for i, node in enumerate(graph.nodes)}
    steps = [min(ends, key=lambda node: order.get(node, -1))]
    while (after := way[steps[-1]]) is not None:
        steps.append(after)
    return steps


def _partial(
    graph: Graph, source: Node, sink: Node, point: Mapping[str, float]
) -> tuple[list[Node], int, float] | None:
    """The way from the first operation between the two with a partial that is not finite, by which argument, and it."""
    edges = edges_among(between(graph.nodes, [source], [sink]))
    slopes = map(float, values_of(graph.inputs, [edge.partial for edge in edges], point))
    for edge, slope in zip(edges, slopes, strict=True):
        if not math.isfinite(slope):
            way = [edge.target]
            while way[-1] is not sink:
                way.append(next(each.target for each in edges if each.source is way[-1]))
            return way, edge.slot, slope
    return None


def _found(
    names: Names,
    values: Mapping[Node, float],
    what: str,
    value: float,
    way: Sequence[Node],
    slot: int | None,
    result: float,
) -> WhyNan:
    node = way[0]
    behind = set(between(names.graph.nodes, names.graph.inputs, [node])) if node.args else set()
    steps = [*[names.short(each) for each in way], what.partition(" / ")[0].removeprefix("d ")]
    return WhyNan(
        names.graph,
        what,
        value,
        node,
        slot,
        result,
        {_told(names, arg): values[arg] for arg in node.args},
        {names.text(each): values[each] for each in names.graph.inputs if each in behind},
        {names.text(each): values[each] for each in names.graph.inputs},
        names.line(node),
        tuple(dict.fromkeys(steps)),
    )


def _told(names: Names, node: Node) -> str:
    """`x`, or `%2 = x * x`."""
    return names.short(node) if not node.args or node.name else f"{names.short(node)} = {names.text(node)}"


def _pairs(numbers: Mapping[str, float]) -> str:
    return joined([f"{name} = {value:g}" for name, value in numbers.items()], SHOWN)
