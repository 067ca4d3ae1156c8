"""Decimal numbers of any precision: operations on them, with the functions that mpmath has, and graphs over them."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from functools import partial
from typing import TYPE_CHECKING, Any

from cgraph import Graph, Node
from cgraph._shared import columns, install
from cgraph.extend import Op, topological

if TYPE_CHECKING:
    from mpmath.ctx_mp import MPContext

GUARD = 5  # digits more in mpmath
ARITHMETIC = (operator.add, operator.sub, operator.mul, operator.truediv, operator.neg)
NAN = Decimal("nan")

Entry = tuple[int, Callable[..., Decimal], list[int]]  # where the result goes, of which function, of the numbers where


def working(digits: int) -> AbstractContextManager[Context]:
    """Arithmetic of so many digits, of any exponent, in which 0 / 0 is NaN."""
    return localcontext(Context(digits, Emin=MIN_EMIN, Emax=MAX_EMAX, traps=[]))


def number(value: object) -> Decimal:
    """A float or text as a number of the working precision."""
    return +Decimal(value)  # type: ignore[arg-type]


def mpmath_context(digits: int) -> MPContext:
    """mpmath with so many digits. Raises ImportError that names the extra."""
    try:
        from mpmath import MPContext
    except ImportError:
        raise ImportError(f"reference solutions need mpmath: {install('reference')}") from None
    mp = MPContext()
    mp.dps, mp.trap_complex = digits + GUARD, True
    return mp


def log10_size(x: Decimal) -> float:
    """log10 |x| of any exponent; -inf at zero, NaN when x is not finite."""
    if not x.is_finite():
        return math.nan
    return x.adjusted() + math.log10(abs(float(x.scaleb(-x.adjusted())))) if x else -math.inf


def sign(x: Decimal) -> int:
    """-1, 0 or 1; 0 of NaN."""
    return int(x > 0) - int(x < 0)


def value(op: Op, mp: MPContext) -> Callable[..., Decimal]:
    """The operation on numbers: by its row of the operation table, else mpmath's function of that name.

    It is NaN outside its domain. Raises NotImplementedError when there is neither.
    """
    if op.operator is not None and op.operator in ARITHMETIC:
        arithmetic: Callable[..., Any] = op.operator
        return arithmetic
    if op.precise is None and op.piece is not None:
        return partial(piece_of, op.piece, sign)
    function = op.precise or op.operator or getattr(mp, op.name, None)
    if function is None:
        raise NotImplementedError(
            f"{op.name} has no multiprecision value: its row of the operation table needs the column `precise`, a "
            "function of mpmath's numbers, which has none of that name"
        )

    def by_mpmath(*args: Decimal) -> Decimal:
        try:
            return number(str(function(*[mp.mpf(str(arg) if arg.is_finite() else float(arg)) for arg in args])))
        except (ArithmeticError, ValueError):
            return NAN

    return by_mpmath


def piece_of(piece: Callable[[int], tuple[int | None, int]], side: Callable[[Decimal], int], *args: Decimal) -> Decimal:
    """The value of a piecewise operation.  side: of a number that is zero where it switches."""
    slot, factor = piece(side(args[0] - args[1] if len(args) == 2 else args[0]))
    return Decimal(factor) if slot is None else factor * args[slot]


class GraphValues:
    """A graph over decimal numbers; what its constants alone decide is computed once.

    constants: {name of an input: number}; the other inputs are given in calls.  value_of: the function of a node.
    """

    def __init__(
        self,
        graph: Graph,
        constants: Mapping[str, object],
        value_of: Callable[[Node], Callable[..., Decimal]],
    ) -> None:
        self._numbers: list[Decimal] = []
        self._steps: list[Entry] = []
        places: dict[Node, int] = {}
        moving: set[int] = set()
        for node in (*graph.inputs, *topological(graph.outputs.values())):
            if node in places:
                continue
            k = places[node] = len(self._numbers)
            args = [places[arg] for arg in node.args]
            known = Decimal(0)  # until a call
            if node.value is not None:
                known = number(node.value)
            elif node.name in constants and not args:
                known = number(constants[str(node.name)])
            elif args and moving.isdisjoint(args):
                known = value_of(node)(*[self._numbers[arg] for arg in args])
            else:
                moving.add(k)
                self._steps += [(k, value_of(node), args)] if args else []
            self._numbers.append(known)
        self._inputs = [places[node] for node in graph.inputs if node.name not in constants]
        self._outputs = [places[node] for node in graph.outputs.values()]

    def __call__(self, inputs: Sequence[Decimal]) -> list[Decimal]:
        """The outputs, in their order."""
        numbers = self._numbers
        for k, each in zip(self._inputs, inputs, strict=True):
            numbers[k] = each
        for k, function, args in self._steps:
            numbers[k] = function(*[numbers[arg] for arg in args])
        return [numbers[k] for k in self._outputs]


def values_in_digits(graph: Graph, inputs: Sequence[float], digits: int) -> list[Decimal]:
    """The outputs, computed with so many digits. Raises ImportError without mpmath."""
    mp = mpmath_context(digits)
    with working(digits):
        return GraphValues(graph, {}, lambda node: value(columns(node.op), mp))([number(x) for x in inputs])
