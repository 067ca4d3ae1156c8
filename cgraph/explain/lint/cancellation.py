"""Cancellation, sums that lose digits at a point, by a running bound of rounding; and operations singular in a box."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ...core.evaluation import box_interval
from ...core.graph import Graph
from ...core.node import Node
from ...operations.bounds import intervals
from ...operations.operation import Interval, Op, columns
from ...simplification.rounding_growth import error_bounds
from ...util.explain_failure import explain_failure
from ...util.json_type import Json, json_number
from ...util.require import require_mapping
from ..names import Names, Point, checked_point
from .finding import Finding

ROUNDOFF = 2.0**-53  # relative error of one rounding
ROUNDING = 2.0**-48  # of bounds, relative
Box = Mapping[str, float | tuple[float, float]]


@dataclass(frozen=True)
class Rounded:
    """The value of each node at a point, and a bound of its absolute rounding error, to first order."""

    values: dict[Node, float]
    errors: dict[Node, float]

    def digits(self, node: Node) -> float:
        """Decimal digits of the value that the bound leaves certain, 0 to 16; infinite where nothing was rounded."""
        error, size = self.errors[node], abs(self.values[node])
        if error == 0.0:
            return math.inf
        return max(0.0, -math.log10(error / size)) if size else 0.0


def rounded(names: Names, at: Point) -> Rounded:
    """Values and error bounds: each input is off by half a unit in the last place, as a decimal number would be."""
    values, errors = error_bounds(names.graph.nodes, checked_point(names, at), ROUNDOFF, of_inputs=ROUNDOFF)
    return Rounded(*[{node: float(each[node]) for node in names.graph.nodes} for each in (values, errors)])


@explain_failure
def certain_digits(graph: Graph, at: Point) -> dict[str, float]:
    """Decimal digits of the outputs that rounding leaves certain at a point, {output: digits}, by a running bound.

    at: {input: value}, each taken to be off by half a unit in the last place. The bound is to first order; digits are 0
    to 16, infinite where nothing was rounded, NaN where there is no bound. Raises GraphError for an input that is
    missing or unknown, ValueError for a value that is not finite.

    >>> import cgraph as cg
    >>> from cgraph.extend import certain_digits
    >>> x, y = cg.variables("x y")
    >>> {k: round(d) for k, d in certain_digits(cg.Graph([x, y], {"f": x - y}), {"x": 1.0, "y": 0.999999}).items()}
    {'f': 10}
    """
    found = rounded(Names(graph), at)
    return {name: found.digits(node) for name, node in graph.outputs.items()}


def cancellations(names: Names, found: Rounded, threshold: float) -> list[Finding]:
    """The sums and differences that lose `threshold` digits or more by themselves at the point."""
    findings = []
    for node in names.graph.nodes:
        if len(columns(node.op).signs) != 2 or not math.isfinite(found.errors[node]):
            continue
        before = min([found.digits(arg) for arg in node.args])
        inherited = sum([found.errors[arg] for arg in node.args])
        size = abs(found.values[node])
        after = (max(0.0, -math.log10(inherited / size)) if size else 0.0) if inherited else math.inf
        lost = before - after if math.isfinite(after) else 0.0
        if lost >= threshold:
            findings.append(_finding(names, node, found, lost, after))
    return findings


def _finding(names: Names, node: Node, found: Rounded, lost: float, left: float) -> Finding:
    a, b = (found.values[arg] for arg in node.args)
    first, second = (f"{value:.{min(17, math.ceil(lost) + 2)}g}" for value in (a, b))
    sign = "+" if columns(node.op).signs[1] > 0 else "-"
    text = (
        f"{names.line(node)}: {first} {sign} {f'({second})' if b < 0 else second} leaves {found.values[node]:.3g}; "
        f"{lost:.0f} digits are lost here, {left:.0f} remain."
    )
    data: dict[str, Json] = {
        "number": names.number[node],
        "tags": sorted(node.tags),
        "value": found.values[node],
        "arguments": [a, b],
        "digits_lost": lost,
        "digits_left": left,
    }
    return Finding("cancellation", text, (node,), data=data)


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
