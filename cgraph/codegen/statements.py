"""Statements of C or JavaScript, one for each operation, in one function or several, and methods that call these."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from ..core.row import Row
from ..util.require import require_mapping

PART = 2000  # operations in a function: compilers take more than proportionally to its length


class Statements(NamedTuple):
    """direct: results that are inputs or constants.  parts: of each function.  size: of w, values that parts share.

    ops: the operations, in the order of their first use.
    """

    direct: list[str]
    parts: list[list[str]]
    size: int
    ops: list[Row]


def statements(
    graph: Graph,
    places: Sequence[str],
    results: Sequence[str],
    number: Callable[[float], str],
    operation: Callable[[Row], str],
    local: str,
    note: Callable[[Node], str] = lambda node: "",
) -> Statements:
    """The statements that compute a graph.

    places, results: of each input its place in x, and of each output in y.  number, operation: texts of a number
    and of an operation, with {0}, {1} for arguments.  local: declares a constant.  note: what follows a statement.

    A value that its own part alone needs is a local constant, numbered as in `Graph.listing`; places in w are used
    again once nothing needs their values.
    """
    nodes, outputs, known = graph.nodes, graph.outputs.values(), _known(graph.nodes)
    steps = [node for node in nodes if node not in known and node.op is not VARIABLE]
    text = {node: f"x[{place}]" for node, place in zip(graph.inputs, places, strict=True)}
    needed = {*[arg for node in steps for arg in node.args], *outputs}
    text |= {node: number(value) for node, value in known.items() if node in needed}
    stored: dict[Node, list[str]] = {}
    for place, node in zip(results, outputs, strict=True):
        stored.setdefault(node, []).append(place)
    listed = {node: i for i, node in enumerate([node for node in nodes if node.args], 1)}
    texts = {op: operation(op) for op in dict.fromkeys([node.op for node in steps])}
    last_use = {arg: i for i, node in enumerate(steps) for arg in node.args}
    direct = [f"y[{place}] = {text[node]};" for place, node in zip(results, outputs, strict=True) if node in text]
    parts: list[list[str]] = []
    free: list[int] = []
    read_last: dict[int, list[int]] = {}  # step: the places in w that nothing reads after it
    size = 0
    for i, node in enumerate(steps):
        if i % PART == 0:
            parts.append([])
        expression = texts[node.op].format(*[text[arg] for arg in node.args])
        free += read_last.pop(i, ())
        last = last_use.get(node, i)
        if last // PART == i // PART:
            text[node] = f"v{listed[node]}"
            target = f"{local} {text[node]}"
        else:
            if not free:
                free.append(size)
                size += 1
            read_last.setdefault(last, []).append(free[-1])
            text[node] = target = f"w[{free.pop()}]"
        parts[-1].append(f"{target} = {expression};{note(node)}")
        parts[-1] += [f"y[{place}] = {text[node]};" for place in stored.get(node, ())]
    return Statements(direct, parts, size, [*texts])


def _known(nodes: Sequence[Node]) -> dict[Node, float]:
    """Values of the nodes that no input reaches.

    As `evaluate` has them: a compiler that meets sin(0.3) rounds it correctly, the library that it links need not.
    """
    known: dict[Node, float] = {}
    for node in nodes:
        if node.op is CONSTANT:
            assert node.value is not None
            known[node] = node.value
        elif node.args and all([arg in known for arg in node.args]):
            known[node] = float(node.op.scalar(*[known[arg] for arg in node.args]))
    return known


class Tableau(Protocol):
    """The numbers of an explicit Runge-Kutta method, as `dynamics.integrators.Tableau` has them."""

    @property
    def c(self) -> tuple[float, ...]:
        """Times of the stages, the first 0."""

    @property
    def a(self) -> tuple[tuple[float, ...], ...]:
        """Row k the weights of the slopes before stage k."""

    @property
    def b(self) -> tuple[float, ...]:
        """Weights of the slopes in the step."""


def checked_methods(methods: object, graph: Graph, time: str) -> Mapping[str, Any]:
    """The methods, where all are tableaus and the graph is a state equation. Raises TypeError, GraphError."""
    chosen = {} if methods is None else require_mapping("methods", methods, "name: Tableau")
    for name, method in chosen.items():
        if not all([hasattr(method, numbers) for numbers in "abc"]):
            raise TypeError(f"method {name!r} must be a tableau with numbers a, b and c, got {method!r:.60}")
    inputs, states = len(graph.inputs), len(graph.outputs)
    if chosen and states > inputs:
        raise GraphError(
            f"steps need a state equation, whose first inputs are the state: {states} outputs of {inputs} inputs"
        )
    if not isinstance(time, str):
        raise TypeError(f"time must be the name of an input, got {time!r:.60}")
    return chosen


def weighted_sum(weights: Sequence[float], number: Callable[[float], str], slope: Callable[[int], str]) -> str:
    """The sum of weight * slope as text, in the order of `dynamics`, without those of weight 0.

    number: the text of a weight.  slope: the text of slope k.
    """
    used = [(float(weight), slope(k)) for k, weight in enumerate(weights) if weight]
    return " + ".join([text if weight == 1.0 else f"{number(weight)} * {text}" for weight, text in used])
