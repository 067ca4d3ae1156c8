"""Taylor series: the coefficients of a solution of xdot = f(x, t) in numbers of any precision, by its jets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import mul

from cgraph import Graph, Node
from cgraph.extend import NoSeriesError, columns, jets, topological

from ..systems.arguments import TIME
from .flint_numbers import Number, sign, value

Step = tuple[int, Callable[..., Number], list[int]]  # where the result goes, of which function, of the numbers where


class Series:
    """The series of a state equation, and its coefficients at a point.

    graph: inputs the states, then others; outputs the rates in the order of `states`.
    constants: {name of an input: number} for all inputs but the states and t.
    number: the constructor of numbers, at the precision at which the series will be used.

    switches: of each piecewise operation, coefficients 0, 1, .. of what chooses its piece by its sign.  sides: that
    sign.  forced: {piecewise operation: the sign}, imposed in the next expansion where the value at the point does not
    tell, as just after a switch.
    """

    def __init__(
        self, graph: Graph, states: Sequence[str], constants: Mapping[str, object], number: Callable[..., Number]
    ) -> None:
        self.number, self._m = number, len(states)
        try:
            self._jets = jets(graph, TIME, exact=True)
        except NoSeriesError as error:
            raise NotImplementedError(f"a reference solution needs Taylor series, and {error}") from None
        self._pieces = {node: k for k, node in enumerate(self._jets.pieces)}
        self.switches: list[list[Number]] = [[] for _ in self._pieces]
        self.sides = [0] * len(self._pieces)
        self.forced: dict[int, int] = {}
        self._start = _Evaluation(self._jets.start, constants, number, self._value)
        self._order = _Evaluation(self._jets.order, {}, number, self._value)
        self._timed = TIME in graph.input_names

    def _value(self, node: Node) -> Callable[..., Number]:
        """The value of an operation; of a piecewise one, of the piece of its side, which it chooses here."""
        if node not in self._pieces:
            return value(columns(node.op))
        k, piece = self._pieces[node], columns(node.op).piece
        assert piece is not None

        def chosen(*args: Number) -> Number:
            side = sign(args[0] - args[1] if len(args) == 2 else args[0])
            self.sides[k] = side = self.forced.get(k, side)
            slot, factor = piece(side)
            return self.number(factor) if slot is None else args[slot] if factor == 1 else factor * args[slot]

        return chosen

    def expand(self, x: Sequence[Number], t: Number, order: int) -> list[list[Number]]:
        """Coefficients 0 .. order >= 1 of each state, around the state x at time t."""
        while True:
            coefficients = self._run(x, t, order)
            wrong = {
                k: side
                for k, switch in enumerate(self.switches)
                if k not in self.forced and (side := _side(switch)) != self.sides[k]
            }
            if not wrong:
                return coefficients
            self.forced |= wrong

    def rate(self, x: Sequence[Number], t: Number) -> list[Number]:
        """f(x, t)."""
        self.forced = {}
        return [coefficients[1] for coefficients in self.expand(x, t, 1)]

    def _run(self, x: Sequence[Number], t: Number, order: int) -> list[list[Number]]:
        m, sums = self._m, self._jets.sums
        first = self._start([*x, t] if self._timed else x)
        rates, zeros = first[:m], first[m : m + self._jets.zeros]
        coefficients = [[each] for each in x]
        self.switches = [[each] for each in first[m + self._jets.zeros :]]
        left: list[list[Number]] = [[] for _ in range(sums)]
        right: list[list[Number]] = [[] for _ in range(sums)]
        for k in range(1, order + 1):
            for row, rate in zip(coefficients, rates, strict=True):
                row.append(rate / k)
            if k == order:
                break
            known = map(self._sum, left, right, self._jets.safe)
            now = self._order([*rates, self.number(1), self.number(k), *zeros, *known, *map(self.number, self.sides)])
            rates = now[m : 2 * m]
            for row, each in zip((*left, *right, *self.switches), now[2 * m :], strict=True):
                row.append(each)
        return coefficients

    def _sum(self, left: Sequence[Number], right: Sequence[Number], safe: bool) -> Number:
        """The sum over 0 < j < k of left_j right_k-j."""
        if safe:
            return sum([a * b for a, b in zip(left, right[::-1], strict=True) if a != 0 and b != 0], self.number(0))
        return sum(map(mul, left, right[::-1]), self.number(0))


def _side(switch: Sequence[Number]) -> int:
    """The sign of a series just after the point: that of its first coefficient that is not zero."""
    return next((side for each in switch if (side := sign(each))), 0)


class _Evaluation:
    """A graph over numbers of any precision; what its constants alone decide is computed once."""

    def __init__(
        self,
        graph: Graph,
        constants: Mapping[str, object],
        number: Callable[..., Number],
        value_of: Callable[[Node], Callable[..., Number]],
    ) -> None:
        self._numbers: list[Number] = []
        self._steps: list[Step] = []
        places: dict[Node, int] = {}
        moving: set[int] = set()
        for node in (*graph.inputs, *topological(graph.outputs.values())):
            if node in places:
                continue
            k = places[node] = len(self._numbers)
            args = [places[arg] for arg in node.args]
            known = None
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

    def __call__(self, inputs: Sequence[Number]) -> list[Number]:
        numbers = self._numbers
        for k, each in zip(self._inputs, inputs, strict=True):
            numbers[k] = each
        for k, function, args in self._steps:
            numbers[k] = function(*[numbers[arg] for arg in args])
        return [numbers[k] for k in self._outputs]
