"""Numbers of a C program, double or float: their texts, those of operations on them, and errors of rounding."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.checks import GraphError
from ...core.evaluation import Array, Value, box_interval
from ...core.graph import Graph
from ...core.node import VARIABLE, Node
from ...core.row import Row
from ...operations.operation import columns
from ...simplification.rounding_growth import output_bounds
from ...util.require import require_mapping

POINTS = 1000
_ROOM = 4_000_000  # numbers that are kept at once

_MATH = frozenset(  # functions of real numbers in <math.h> of C99
    """acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma
    fmax fmin fmod hypot ldexp lgamma log log10 log1p log2 logb nan nearbyint nextafter pow remainder rint round scalbn
    sin sinh sqrt tan tanh tgamma trunc""".split()
)
_CALL = re.compile(r"(?<![\w}])([A-Za-z_]\w*)(?=\()")
_LITERAL = re.compile(
    r"(?<![\w.])(?:0[xX][0-9a-fA-F.]+[pP][+-]?\d+|(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)(?![\w.])"
)


@dataclass(frozen=True)
class CNumbers:
    """The numbers that a C program computes with: `double`, or `float` with functions and constants of its own."""

    type: str  # the word for them in C
    dtype: str  # the name of NumPy for them
    unit: float  # the largest relative error of a rounding

    def stored(self, value: float) -> float:
        """The number as the program has it; a constant too small to be there is the smallest normal one, not 0.

        Raises ValueError for a number that is too large.
        """
        if self.type == "double" or not math.isfinite(value):
            return value
        with np.errstate(over="ignore", under="ignore"):
            near = float(np.float32(value))
        if math.isinf(near):
            raise ValueError(f"the constant {value!r} is beyond float32, whose largest number is 3.4e38")
        return near if near or not value else math.copysign(float(np.finfo(np.float32).tiny), value)

    def text(self, value: float) -> str:
        """The number, exactly; in parentheses if it has a sign."""
        size = abs(self.stored(value))
        suffix = "f" * (self.type == "float")
        if math.isnan(value):
            text = f"({self.type})NAN"
        elif math.isinf(value):
            text = f"({self.type})INFINITY"
        elif size < 1e6 and size.is_integer():
            text = f"{size}{suffix}"
        else:
            text = f"{re.sub('[.]?0*p', 'p', size.hex())}{suffix} /* {abs(value)!r} */"
        return text if math.copysign(1.0, value) > 0 else f"(-{text})"

    def operation(self, op: Row) -> str:
        """C expression of the operation, with {0}, {1} for arguments. Raises ValueError where there is none."""
        row = columns(op)
        call = re.fullmatch(r"(\w+)\([^()]*\)", row.c)
        if call and call[1] == row.library and row.library not in _MATH and not row.c_helper:
            raise ValueError(
                f"operation {row.name!r} has no text in C, and <math.h> has no function {row.library}: "
                "its row needs the column `c`, with `c_helper` for a function that it calls"
            )
        return self.adapted(row.c)

    def adapted(self, text: str) -> str:
        """A text of doubles in these numbers."""
        if self.type == "double":
            return text
        text = _CALL.sub(lambda found: found[1] + "f" * (found[1] in _MATH), text)
        return _LITERAL.sub(lambda found: f"{found[0]}f", re.sub(r"\bdouble\b", self.type, text))


NUMBERS = {"float64": CNumbers("double", "float64", 2.0**-53), "float32": CNumbers("float", "float32", 2.0**-24)}

Box = Mapping[str, float | tuple[float, float]]


def checked_box(graph: Graph, box: object) -> dict[str, tuple[float, float]]:
    """{input: (low, high)} of all inputs, -1 .. 1 for those left out. Raises GraphError, ValueError."""
    given = {} if box is None else require_mapping("box", box, "input: interval")
    names = graph.input_names
    if unknown := [name for name in given if name not in names]:
        raise GraphError(f"box: the graph has no input {unknown[0]} (it has {', '.join(names) or 'none'})")
    found = {name: box_interval(name, given.get(name, (-1.0, 1.0))) for name in names}
    if unbounded := [name for name, ends in found.items() if not np.all(np.isfinite(ends))]:
        raise ValueError(f"box: input {unbounded[0]!r} needs finite numbers, got {found[unbounded[0]]!r}")
    return found


class Errors(NamedTuple):
    """Of an output in float: the largest bound of its error, NaN where there is none, and the largest error seen."""

    bound: float
    seen: float


def largest_errors(graph: Graph, box: Mapping[str, tuple[float, float]], numbers: CNumbers) -> dict[str, Errors]:
    """{output: bound of its error to first order, and error of the same operations each rounded}, at POINTS points.

    Half of the points are uniform in the box, half are corners of it, where bounds often are largest. Inputs and
    constants are rounded to the numbers of the program, too.
    """
    rng = np.random.default_rng(0)
    ends = np.array([*box.values()], dtype=float).reshape(-1, 2)
    share = rng.uniform(size=(len(ends), POINTS))
    share[:, POINTS // 2 :] = share[:, POINTS // 2 :].round()
    points = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share
    worst = np.zeros((len(graph.outputs), 2))
    at_once = max(1, _ROOM // max(1, len(graph.nodes)))
    for start in range(0, POINTS, at_once):
        here = dict(zip(box, points[:, start : start + at_once], strict=True))
        outputs = [*graph.outputs.values()]
        values, bounds = output_bounds(graph.nodes, outputs, here, numbers.unit, numbers.unit, numbers.stored)
        rounded = _rounded(graph, here, numbers)
        for k, node in enumerate(outputs):
            bound = np.where(np.isfinite(values[node]), bounds[k], np.nan)
            with np.errstate(invalid="ignore"):
                seen = np.abs(rounded[node] - values[node])
            worst[k] = np.maximum(worst[k], (np.max(bound), np.max(seen)))  # NaN stays
    worst[~np.isfinite(worst)] = np.nan
    return {name: Errors(*map(float, row)) for name, row in zip(graph.outputs, worst, strict=True)}


def _rounded(graph: Graph, points: Mapping[str, Array], numbers: CNumbers) -> dict[Node, Array]:
    """Values of all nodes, every operation rounded to the numbers of the program; of + - * / and sqrt exactly so."""
    found: dict[Node, Array] = {}
    with np.errstate(all="ignore"):
        for node in graph.nodes:
            if node.op is VARIABLE:
                value: Value = points[str(node.name)]
            else:
                value = node.value if node.value is not None else node.op.array(*[found[arg] for arg in node.args])
            found[node] = np.asarray(value).astype(numbers.dtype).astype(float)
    return found
