"""Taylor series: the coefficients of a solution of xdot = f(x, t), from the graph of f.

Sums, products, quotients and the piecewise operations have recurrences of their own. For every other operation the
table's partials are the recurrence: with y = op(a, b), ydot = (dy/da) adot + (dy/db) bdot, so coefficient k of y is

    y_k = (1/k) sum over arguments a, sum i = 1..k, of  i a_i g_{k-i},     g the series of the node dy/da.

Only g_0 .. g_{k-1} are asked for, so g may depend on y itself, as for exp, tan or the pair sine and cosine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from operator import mul

from cgraph import Graph, Node
from cgraph.extend import OPS, Op, as_node, columns, topological

from ..systems.arguments import TIME
from .flint_numbers import Number, sign, value

Push = Callable[[int], None]  # appends coefficient k of one series, those of its arguments being there
Key = tuple[object, ...]


class Series:
    """The recurrences of a state equation, and its coefficients at a point.

    graph: inputs the states, then others; outputs the rates in the order of `states`.
    constants: {name of an input: number} for all inputs but the states and t.
    number: the constructor of numbers, at the precision at which the series will be used.

    switches: {piecewise node: series whose sign chooses its piece}.  forced: {piecewise node: that sign}, imposed in
    the next expansion where the value at the point does not tell, as just after a switch.
    """

    def __init__(
        self, graph: Graph, states: Sequence[str], constants: Mapping[str, object], number: Callable[[object], Number]
    ) -> None:
        self.number = number
        self.coefficients: list[list[Number]] = []  # of each series; those of the last expansion
        self.switches: dict[int, int] = {}
        self.forced: dict[int, int] = {}
        self.sides: dict[int, int] = {}  # {piecewise node: the sign that it took}
        self._number_of: dict[Key, int] = {}  # (operation, arguments): which series
        self._of_node: dict[Node, int] = {}
        self._moving: list[bool] = []  # whether a series depends on the state or on t
        self._slopes: dict[int, list[Number]] = {}  # series: i a_i for i = 1, 2, ..
        self._push: list[Push] = []
        for name in graph.input_names:
            self._append(("variable", name), number(constants[name]) if name in constants else None)
        self._states = [self._number_of["variable", name] for name in states]
        self._time = self._number_of.get(("variable", TIME))
        self._rates = [self._intern(node) for node in graph.outputs.values()]

    def expand(self, x: Sequence[Number], t: Number, order: int) -> list[list[Number]]:
        """Coefficients 0 .. order >= 1 of each state, around the state x at time t."""
        while True:
            self._run(x, t, order)
            wrong = {
                node: side
                for node, switch in self.switches.items()
                if node not in self.forced and (side := self._side(switch)) != self.sides[node]
            }
            if not wrong:
                return [self.coefficients[i] for i in self._states]
            self.forced |= wrong

    def rate(self, x: Sequence[Number], t: Number) -> list[Number]:
        """f(x, t)."""
        self.forced = {}
        return [coefficients[1] for coefficients in self.expand(x, t, 1)]

    def _side(self, switch: int) -> int:
        """The sign of a series just after the point: that of its first coefficient that is not zero."""
        return next((side for each in self.coefficients[switch] if (side := sign(each))), 0)

    def _run(self, x: Sequence[Number], t: Number, order: int) -> None:
        for moving, coefficients in zip(self._moving, self.coefficients, strict=True):
            if moving:
                coefficients.clear()
        for slopes in self._slopes.values():
            slopes.clear()
        for i, number in zip(self._states, x, strict=True):
            self.coefficients[i].append(number)
        for k in range(order):
            if self._time is not None:
                self.coefficients[self._time].append(t if k == 0 else self.number(int(k == 1)))
            for push in self._push:
                push(k)
            for i, rate in zip(self._states, self._rates, strict=True):
                self.coefficients[i].append(self.get(rate, k) / (k + 1))

    def get(self, i: int, k: int) -> Number:
        """Coefficient k of series i; a constant has one coefficient only."""
        return self.coefficients[i][k] if k == 0 or self._moving[i] else self.number(0)

    def moving(self, i: int) -> bool:
        """Whether series i depends on the state or on t."""
        return self._moving[i]

    def shared(self, op: Op, *args: int) -> int:
        """The series of an operation on series, made when it is not there."""
        key = (op.name, *args)
        if key in self._number_of:
            return self._number_of[key]
        if not any(self._moving[i] for i in args):
            return self._append(key, value(op)(*[self.coefficients[i][0] for i in args]))
        if op.piece is not None:
            switch = self.shared(OPS["sub"], *args) if len(args) == 2 else args[0]
            i = self._append(key, None)
            self.switches[i] = switch
            self._push.append(_piecewise(self, i, op, switch, *args))
        else:
            i = self._append(key, None)
            self._push.append(self._recurrence(i, op, *args))
        return i

    def _recurrence(self, i: int, op: Op, *args: int) -> Push:
        own, rule, known = self.coefficients[i], op.series, [self.coefficients[arg] for arg in args]
        assert rule is not None
        return lambda k: own.append(rule(k, own, *known))

    def slopes(self, i: int) -> list[Number]:
        """The list of k a_k, k = 1, 2, .., of series i."""
        if i not in self._slopes:
            own, result = self.coefficients[i], self._slopes.setdefault(i, [])
            self._push.append(lambda k: result.append(k * own[k]) if k else None)
        return self._slopes[i]

    def _intern(self, root: Node) -> int:
        """The series of a node, with all it needs. Nothing is folded: a folded constant would be rounded to float64."""
        waiting = [root]
        while waiting:
            for node in topological([waiting.pop()]):
                if node not in self._of_node:
                    self._of_node[node] = self._made(node, waiting)
        return self._of_node[root]

    def _made(self, node: Node, waiting: list[Node]) -> int:
        name, args = node.op.name, [self._of_node[arg] for arg in node.args]
        if name == "variable":
            return self._number_of["variable", node.name]
        if name == "constant":
            made = self._number_of.get(("constant", node.value))
            return self._append(("constant", node.value), self.number(node.value)) if made is None else made
        if columns(node.op).series or columns(node.op).piece or not any(self._moving[i] for i in args):
            return self.shared(columns(node.op), *args)
        if columns(node.op).jumps is not None:
            raise NotImplementedError(f"a reference solution needs Taylor series, and {name} of what moves jumps")
        key = (name, *args)
        if key not in self._number_of:
            if (rewrite := columns(node.op).rewrite) is not None:
                self._number_of[key] = self._intern(rewrite(*node.args))
            else:
                self._integral(self._append(key, None), node, args, waiting)
        return self._number_of[key]

    def _append(self, key: Key, still: Number | None) -> int:
        i = self._number_of[key] = len(self.coefficients)
        self._moving.append(still is None)
        self.coefficients.append([] if still is None else [still])
        return i

    def _integral(self, i: int, node: Node, args: Sequence[int], waiting: list[Node]) -> None:
        """The recurrence by the table's partials. They may depend on the node itself, so they are made after it."""
        self._of_node[node] = i
        own, at_point = self.coefficients[i], value(columns(node.op))
        at = [self.coefficients[arg] for arg in args]
        terms = []
        for arg, partial in zip(args, map(as_node, node.op.partials(node, *node.args)), strict=True):
            if self._moving[arg]:
                terms.append((self.slopes(arg), partial))
                waiting.append(partial)
        slopes = [slope for slope, _ in terms]
        series: list[int] = []

        def push(k: int) -> None:
            if k == 0:
                own.append(at_point(*[coefficients[0] for coefficients in at]))
                return
            if not series:
                series.extend([self._of_node[partial] for _, partial in terms])
            total = self.number(0)
            for slope, j in zip(slopes, series, strict=True):
                if self._moving[j]:
                    total = sum(map(mul, slope, self.coefficients[j][k - 1 :: -1]), total)
                else:
                    total += slope[k - 1] * self.coefficients[j][0]
            own.append(total / k)

        self._push.append(push)


def _piecewise(s: Series, i: int, op: Op, switch: int, *args: int) -> Push:
    own, piece = s.coefficients[i], op.piece
    assert piece is not None

    def push(k: int) -> None:
        if k == 0:
            s.sides[i] = s.forced[i] if i in s.forced else sign(s.coefficients[switch][0])
        slot, factor = piece(s.sides[i])
        if slot is None:
            own.append(s.number(0 if k else factor))
        else:
            coefficient = s.get(args[slot], k)
            own.append(coefficient if factor == 1 else factor * coefficient)

    return push
