"""Singular nodes: operations whose slope is unbounded, or that have no value, somewhere in a box of inputs."""

from collections.abc import Mapping

from ...core.evaluation import box_interval
from ...core.graph import Graph
from ...core.node import CONSTANT, VARIABLE, Node
from ...operations.bounds import REAL_LINE, value_of
from ...operations.operation import Interval, Op, columns
from ...util.json_type import Json, json_number
from ...util.require import require_mapping
from ..names import Names
from .finding import Finding

Box = Mapping[str, float | tuple[float, float]]


def intervals(graph: Graph, box: Box) -> dict[Node, Interval]:
    """Bounds of the value of every node for inputs in the box; an input that it leaves out is any number.

    box: {input: (low, high) or a number}. The bounds hold, but may be wide: an interval forgets which values belong
    together. Raises GraphError for an unknown input, ValueError for what is no interval.
    """
    given = _given(Names(graph), box)
    found: dict[Node, Interval] = {}
    for node in graph.nodes:
        if node.op is VARIABLE:
            found[node] = given.get(str(node.name), REAL_LINE)
        elif node.op is CONSTANT:
            assert node.value is not None
            found[node] = (node.value, node.value)
        else:
            same = len(node.args) == 2 and node.args[0] is node.args[1]
            found[node] = value_of(columns(node.op), [found[arg] for arg in node.args], same=same)
    return found


def singular_at(op: Op, arguments: list[Interval]) -> str | None:
    """Words on where in the arguments' intervals the operation has no bounded slope; None if nowhere."""
    if op.singular is not None:
        return op.singular(*arguments)
    return None if op.interval is not None else f"{op.name}, of which no bounds are known"


def singular_nodes(names: Names, box: Box) -> list[Finding]:
    """The operations that could meet a singular point of theirs for inputs in the box."""
    bounds = intervals(names.graph, _given(names, box))
    findings = []
    for node in names.graph.nodes:
        reason = singular_at(columns(node.op), [bounds[arg] for arg in node.args]) if node.args else None
        if reason is not None:
            arguments = {names.text(arg): bounds[arg] for arg in node.args if arg.value is None}
            within = " and ".join(
                [f"{name} is within [{low:.4g}, {high:.4g}]" for name, (low, high) in arguments.items()]
            )
            data: dict[str, Json] = {
                "number": names.number[node],
                "operation": node.op.name,
                "tags": sorted(node.tags),
                "reason": reason,
                "arguments": {name: [json_number(end) for end in bound] for name, bound in arguments.items()},
            }
            text = f"{names.line(node)}: {reason}" + (f"; {within}." if within else ".")
            findings.append(Finding("singular", text, (node,), data=data))
    return findings


def _given(names: Names, box: Box) -> dict[str, Interval]:
    """The box by the graph's names. Raises as `intervals` does."""
    known = names.inputs_of("box", require_mapping("box", box, "input: interval"))
    return {name: box_interval(names.shown(name), value) for name, value in known.items()}
