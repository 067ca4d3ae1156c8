"""Jets: the Taylor coefficients of a solution of xdot = f(x, t), order by order, as two graphs.

Coefficient k of a node is linear in coefficients k of its arguments, with coefficients 0 as factors, and in sums over
0 < j < k of products of earlier ones (`operations.series`). So one graph computes all values at order 0, and one, the
same for all k > 0, the rest, from those sums, which run over many nodes at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..core.builder import Builder, folded
from ..core.checks import check_name
from ..core.graph import Graph
from ..core.label import Label
from ..core.node import CONSTANT, Node, as_node, constant, variable
from ..core.row import Row
from ..core.scope import building
from ..operations.operation import columns
from ..operations.series import Kind, by_partials
from ..operations.table import equal, where
from ..simplification.simplify import simplify
from ..util.require import require_flag, require_graph, require_whole
from ..writing.naming import variables


class Jets(NamedTuple):
    """The Taylor coefficients of a solution, as graphs.

    start: (x, t, p) -> the rates (m), the zeros, and what decides the pieces.
    order: (the rates before (m), unit, k, zeros, sums, sides) -> coefficients k of x (m), of the rates (m), of both
    factors of the sums, and of what decides the pieces, by time over the unit.
    zeros, sums: how many numbers the orders hand on; sum i of order k is sum_{0<j<k} left_i[j] right_i[k - j].
    safe: whether zeros win in a sum over infinities.  pieces: piecewise nodes of `start`, each chosen by a sign.

    >>> import cgraph as cg
    >>> from cgraph.extend import jets
    >>> x = cg.variable("x")
    >>> jets(cg.Graph([x], {"rate": x * x})).sums
    1
    """

    start: Graph
    order: Graph
    zeros: int
    sums: int
    safe: tuple[bool, ...]
    pieces: tuple[Node, ...]


def _convolution(left: Sequence[Node], right: Sequence[Node]) -> Node:
    """The sum over 0 < j < k of left_j right_k-j; what needs the coefficients just before comes last."""
    products: list[Node] = [a * b for a, b in zip(left, reversed(right), strict=True)]
    if all(a is b for a, b in zip(left, right, strict=True)):
        half = len(products) // 2
        pairs = [2.0 * sum(products[1:half], products[0])] if half else []
        parts = [*pairs, *products[half : len(products) - half]]
        return sum(parts[1:], parts[0])
    outwards = sorted(range(1, len(products) - 1), key=lambda j: abs(2 * j + 1 - len(products)))
    early = [sum([products[j] for j in outwards[1:]], products[outwards[0]])] if outwards else []
    return sum([*products[1:][-1:], *early], products[0])


def straight(made: Jets, order: int) -> Graph:
    """All coefficients as one graph: (the rates (m), unit, zeros) -> coefficients 1 of x (m), 2, .., of that order.

    It repeats `made.order`, folded: what is 0 or constant in some orders takes no operations there. Jets that
    are `exact` have none.

    Of xdot = x, from x = 1:

    >>> import cgraph as cg
    >>> from cgraph.extend import jets, straight
    >>> x = cg.variable("x")
    >>> straight(jets(cg.Graph([x], {"rate": x})), 3).evaluate({"rate0": 1.0, "unit": 1.0})
    {'0': 1.0, '1': 0.5, '2': 0.16666666666666666}
    """
    if not isinstance(made, Jets):
        raise TypeError(f"straight needs the jets of a graph, got {type(made).__name__}: {made!r:.40}")
    order = require_whole("order", order, least=1)
    wanted, build, size = list(made.order.outputs.values()), Builder(), made.sums
    m = (len(wanted) - 2 * size) // 2
    inputs = [*made.order.inputs[: m + 1], *made.order.inputs[m + 2 : m + 2 + made.zeros]]
    rates, unit, zeros = inputs[:m], inputs[m], inputs[m + 1 :]
    left: list[list[Node]] = [[] for _ in range(size)]
    right: list[list[Node]] = [[] for _ in range(size)]
    coefficients: list[Node] = []
    for k in range(1, order + 1):
        with building(build):
            sums = [_convolution(a, b) if k > 1 else constant(0.0) for a, b in zip(left, right, strict=True)]
        values = [*rates, unit, constant(float(k)), *zeros, *sums]
        now = folded(wanted, build, dict(zip(made.order.inputs, values, strict=True)))
        coefficients += now[:m]
        rates = now[m : 2 * m]
        for row, each in zip((*left, *right), now[2 * m :], strict=True):
            row.append(each)
    return Graph(inputs, {f"{i}": node for i, node in enumerate(coefficients)})


ROUNDS = 100  # of partials of partials; those of the table come back to what is there after 2


class NoSeriesError(ValueError):
    """Equations without a Taylor series, for an operation that has none, or with too long a one."""


def jets(rate: Graph, time: str = "t", *, exact: bool = False) -> Jets:
    """The Taylor coefficients of a solution of xdot = f(x, t), as graphs.

    rate: f. Its first inputs are the states, one for each output; the others are constant, but for the one called
    `time`.
    exact: for numbers of any precision: nothing is folded, since a folded constant is rounded to float64, and a
    piecewise operation has the series of its piece.
    Raises NoSeriesError for an operation that jumps, or whose partials of partials never come back to what is there;
    unless `exact`, for a piecewise one, too.

    Of xdot = x, every coefficient is the one before over k:

    >>> import cgraph as cg
    >>> from cgraph.extend import jets
    >>> x = cg.variable("x")
    >>> made = jets(cg.Graph([x], {"rate": x}))
    >>> made.order.evaluate({"rate0": 1.0, "unit": 1.0, "order": 2.0})
    {'0': 0.5, '1': 0.5}
    """
    require_graph("jets", rate)
    if len(rate.outputs) > len(rate.inputs):
        raise ValueError(f"jets needs a state for each rate, got {len(rate.outputs)} rates, {len(rate.inputs)} inputs")
    return _Jets(rate, check_name("the time", time), require_flag("exact", exact)).graphs()


class _Shared:
    """Builds nodes as they are written, shared; what is folded of one argument alone, as -(-x), rounds nothing."""

    def __init__(self, graph: Graph) -> None:
        self._made: dict[tuple[str | int, ...], Node] = {}
        for node in graph.nodes:
            if node.args:
                self._made.setdefault(self._key(node.op, node.args), node)

    def __call__(self, op: Row, args: tuple[Node, ...], label: Label) -> Node:
        if len(args) == 1 and args[0].args and op.fold is not None and (node := op.fold(*args)) is not None:
            return node  # type: ignore[no-any-return]
        key = self._key(op, args)
        if key not in self._made:
            self._made[key] = Node(op, args, label)
        return self._made[key]

    def _key(self, op: Row, args: tuple[Node, ...]) -> tuple[str | int, ...]:
        return (op.name, *[repr(arg.value) if arg.op is CONSTANT else id(arg) for arg in args])


def _scaled(node: Node) -> tuple[Node | float, Node] | None:
    """A constant and what it multiplies, if a node is their product: it goes before a sum, which others then share."""
    if node.op.name == "neg":
        return -1.0, node.args[0]
    if node.op.name == "mul" and CONSTANT in (node.args[0].op, node.args[1].op):
        first, second = node.args
        return (first, second) if first.op is CONSTANT else (second, first)
    return None


class _Jets:
    """The orders of a series, for the rules of the operations."""

    def __init__(self, rate: Graph, time: str, exact: bool) -> None:
        self.rate, self.exact, m = rate, exact, len(rate.outputs)
        self.build = _Shared(rate) if exact else Builder()
        self.before = variables([f"rate{i}" for i in range(m)])
        self.unit, self.k = variables(["unit", "order"])
        self.of: dict[Node, Node | None] = {}  # {node: its coefficient k, None where it is constant}
        self.zeros: dict[Node, Node] = {}  # {node: the variable that holds its coefficient 0}
        self.sums: dict[tuple[Node, Node, Kind], Node] = {}  # {(a, b, kind): the sum of (j) a_j b_k-j}
        self.sides: dict[Node, Node] = {}  # {piecewise node: the variable that holds its side}
        self.switches: list[Node] = []  # what decides them
        self.rounds: dict[Node, int] = {}  # {partial: how many operations were differentiated one after another for it}
        self.round = 0
        with building(self.build):
            self.states = [before * (self.unit / self.k) for before in self.before]
            for k, node in enumerate(rate.inputs):
                moving = self.states[k] if k < m else None
                if node.name == time:
                    moving = where(equal(self.k, 1.0), self.unit, 0.0)
                self.of[node] = moving
            self.waiting = list(rate.outputs.values())
            while self.waiting:
                node = self.waiting.pop()
                self.round = self.rounds.get(node, 0)
                if self.round > ROUNDS:
                    endless = f"its partials need partials of new nodes, and those again, {ROUNDS} times over"
                    raise NoSeriesError(f"{node.op.name} has no Taylor series: {endless}")
                self.at(node)

    def graphs(self) -> Jets:
        """The two graphs."""
        with building(self.build):
            left = [self._number(a) * self.k if kind == "weighted" else self._number(a) for a, _, kind in self.sums]
            right = [self._number(b) for _, b, _ in self.sums]
            rates = [self._number(node) for node in self.rate.outputs.values()]
            wanted = [*self.states, *rates, *left, *right, *[self._number(node) for node in self.switches]]
        first = [*self.rate.outputs.values(), *self.zeros, *self.switches]
        inputs = [*self.before, self.unit, self.k, *self.zeros.values(), *self.sums.values(), *self.sides.values()]
        order = Graph(inputs, {f"{k}": node for k, node in enumerate(wanted)})
        start = Graph(self.rate.inputs, {f"{k}": node for k, node in enumerate(first)})
        safe = tuple([kind == "safe" for *_, kind in self.sums])
        start = start if self.exact else simplify(start)
        return Jets(start, order, len(self.zeros), len(self.sums), safe, tuple(self.sides))

    def _number(self, node: Node) -> Node:
        coefficient = self.of[node]
        return constant(0.0) if coefficient is None else coefficient

    def zero(self, node: Node) -> Node:
        """Coefficient 0 of a node."""
        if node.value is not None:
            return node
        return self.zeros.setdefault(node, variable(f"zero{len(self.zeros)}"))

    def sum(self, a: Node, b: Node, kind: Kind = "plain") -> Node:
        """The sum over 0 < j < k of a_j b_k-j, or one of another kind, see `Orders`."""
        for x in (a, b):
            if (scaled := _scaled(x)) is not None:
                factor, inner = scaled
                return factor * (self.sum(inner, b, kind) if x is a else self.sum(a, inner, kind))
        for node in (a, b):
            if node not in self.of:
                self.waiting.append(node)
                self.rounds.setdefault(node, self.round + 1)
        if kind != "weighted" and (b, a, kind) in self.sums:
            a, b = b, a
        return self.sums.setdefault((a, b, kind), variable(f"sum{len(self.sums)}"))

    def at(self, node: Node) -> Node | None:
        """Coefficient k of a node, after those of all that it is made from."""
        path = [node]
        while path:
            if missing := [arg for arg in path[-1].args if arg not in self.of]:
                path += missing
            elif (last := path.pop()) not in self.of:
                self.of[last] = self._coefficient(last)
        return self.of[node]

    def _coefficient(self, node: Node) -> Node | None:
        """Coefficient k of a node, those of its arguments being there; their partials are left to wait."""
        op, at = columns(node.op), [self.of[arg] for arg in node.args]
        if all(each is None for each in at):
            return None
        if op.signs:
            terms = [each if sign > 0 else -each for sign, each in zip(op.signs, at, strict=True) if each is not None]
            return sum(terms[1:], terms[0])
        if op.series is not None:
            coefficient: Node | None = op.series(self, node, *node.args)
            return coefficient
        if op.name == "where" and at[0] is None:
            condition, *branches = node.args
            return where(self.zero(condition), *[self._number(each) for each in branches])
        if op.piece is not None and self.exact:
            return self._piece(node)
        self._refuse(node)
        return by_partials(self, node, *node.args)

    def _piece(self, node: Node) -> Node:
        """Coefficient k of the piece that the side chooses."""
        piece, args = columns(node.op).piece, node.args
        assert piece is not None
        side = self.sides[node] = variable(f"side{len(self.sides)}")
        switch = args[0] - args[1] if len(args) == 2 else args[0]
        self.at(switch)
        self.switches.append(switch)
        below, zero, above = [
            constant(0.0) if slot is None else factor * self._number(args[slot])
            for slot, factor in map(piece, (-1, 0, 1))
        ]
        return where(side < 0.0, below, where(side > 0.0, above, zero))

    def _refuse(self, node: Node) -> None:
        op, partials = columns(node.op), [as_node(each).value for each in node.op.partials(node, *node.args)]
        if op.piece is not None or op.jumps is not None or all(value == 0.0 for value in partials):
            tagged = f", in what is tagged {', '.join(map(repr, sorted(node.tags)))}" if node.tags else ""
            raise NoSeriesError(f"{node.op.name} has no Taylor series{tagged}")
