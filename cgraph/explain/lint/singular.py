"""Singular nodes: operations whose slope is unbounded, or that have no value, somewhere in a box of inputs."""

from collections.abc import Mapping

from ...core.evaluation import box_interval
from ...operations.bounds import intervals
from ...operations.operation import Interval, Op, columns
from ...util.json_type import Json, json_number
from ...util.require import require_mapping
from ..names import Names
from .finding import Finding

ROUNDING = 2.0**-48  # of bounds, relative
Box = Mapping[str, float | tuple[float, float]]


def singular_at(op: Op, arguments: list[Interval]) -> str | None:
    """Words on where in the arguments' intervals the operation has no bounded slope; None if nowhere."""
    if op.singular is not None:
        return op.singular(*arguments) or op.singular(*[_widened(*each) for each in arguments])
    return None if op.interval is not None else f"{op.name}, of which no bounds are known"


def _widened(low: float, high: float) -> Interval:
    """An interval with the rounding of its ends; zero and what is one number are exact."""
    return (low, high) if low == high else (low - ROUNDING * abs(low), high + ROUNDING * abs(high))


def singular_nodes(names: Names, box: Box) -> list[Finding]:
    """The operations that could meet a singular point of theirs for inputs in the box.

    Raises GraphError for an unknown input, ValueError for what is no interval.
    """
    known = names.inputs_of("box", require_mapping("box", box, "input: interval"))
    given = {name: box_interval(names.shown(name), value) for name, value in known.items()}
    bounds = intervals(names.graph.nodes, given)
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
