"""Solving with a Hessian without forming it: edge pushing with early elimination."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..core.graph import Graph
from ..core.label import ADJOINT, TANGENT
from ..core.node import Node, Scalar, as_node
from ..core.scope import building
from ..core.traversal import topological
from ..simplify.builder import Builder
from .elimination_order import Step, steps
from .ldl_solve import SingularError, first_not_positive
from .rotation_pairs import Rotation, rotations
from .second_order import second_partials

ZERO, ONE = as_node(0.0), as_node(1.0)


def hessian_solve(
    graph: Graph, wrt: str | Node | Sequence[str | Node], rhs: Sequence[Scalar], *, check: bool = False
) -> list[Node]:
    """Nodes x with (d2f/dw2) x = rhs, for the one output f of `graph` and the inputs w of `wrt`.

    rhs: one node or number for each of `wrt`. The Hessian is not formed: for f summed along a chain or a tree, such as
    the energy of its bodies, the result has a number of nodes proportional to that of f.

    There is no pivoting: the Hessian has to be definite. With `positive`, one more node follows x: 0 where the Hessian
    is positive definite, else 1 + the index of a variable whose pivot is zero, negative or NaN, the first to be met;
    x means nothing there. It costs two operations and a constant for each variable. A pivot that should be zero and by
    rounding is a little more counts as positive; then x is huge.

    Raises GraphError for a graph with several outputs, ValueError for a wrong number of right-hand sides, and
    SingularError, with the index of the variable, when a pivot is the constant zero, or with `positive` a negative one.
    """
    chosen = graph.select_inputs(wrt)
    if len(rhs) != len(chosen):
        raise ValueError(f"rhs needs one entry for each of the {len(chosen)} variables, got {len(rhs)}")
    return solve_nodes(graph.only_output(), chosen, [as_node(each) for each in rhs], check=check)


def solve_nodes(
    output: Node,
    wrt: Sequence[Node],
    rhs: Sequence[Node],
    build: Builder | None = None,
    *,
    at: Mapping[Node, Node] | None = None,
    check: bool = False,
) -> list[Node]:
    """As `hessian_solve`, on nodes.

    at: {node z: b_z}, right-hand sides at nodes that depend on w, which stand for (dz/dw)^T b_z more at w, but are
    carried to w by the elimination itself: fewer nodes, and no large sums at w that it then has to undo.

    The tangents t of all nodes that depend on w make f's second differential stationary: W t = b, with W the symmetric
    second-order adjoint and b = rhs at w. Walking the nodes from the output down, an operation hands its row of W and
    its entry of b to its arguments through its partials p (t = sum p t_arg), and adds its adjoint times its second
    partials; a variable, once all its uses are behind, is eliminated as by Gauss. One forward sweep then
    gives the tangents, and those of w are x. For a tree of bodies this is the articulated-body algorithm.
    """
    build = build or Builder()
    order = _dependent([output, *(at or ())], wrt)
    with building(build) as labelled:
        walk = _Walk(build, output, dict(zip(wrt, rhs, strict=True)), at or {}, order)
        plan = steps(walk.arguments(order), walk.rotations)
        for step in plan:
            labelled(_of(step).label.derived(ADJOINT))
            walk.take(step)
        for step in reversed(plan):
            labelled(_of(step).label.derived(TANGENT))
            walk.find_tangents(step)
        x = [walk.dots[node] for node in wrt]
        if check:
            labelled(output.label.derived(ADJOINT))
            x.append(first_not_positive({walk.index(node): solved.pivot for node, solved in walk.solved.items()}))
    return x


class _Solved(NamedTuple):
    """x_i = alone - sum_j gain_j t_j, the row of a variable at its elimination, and the pivot that divided it."""

    pivot: Node
    alone: Node
    gains: dict[Node, Node]


class _Walk:
    """The state of the walk from the output down: adjoints, W and b of the live nodes, and what was eliminated."""

    def __init__(
        self, build: Builder, output: Node, rhs: dict[Node, Node], at: Mapping[Node, Node], order: Sequence[Node]
    ) -> None:
        self.build = build
        self.depends = set(order)
        self.position = {node: i for i, node in enumerate(rhs)}
        self.bars: dict[Node, Node] = {output: ONE}
        self.rhs = dict(rhs)
        for node, inner in at.items():
            self.rhs[node] = self.rhs.get(node, ZERO) + inner
        self.rows: dict[Node, dict[Node, Node]] = {}  # W, both halves
        self.solved: dict[Node, _Solved] = {}
        self.sums = _sums(order, self.position)
        found = [r for r in rotations(order, self.depends, at) if not {r.first, r.second} & self.sums.keys()]
        self.rotations = {r.first: r for r in found}
        self.dots: dict[Node, Node] = {}  # tangents
        self.partials: dict[Node, dict[Node, Node]] = {}  # of each operation, by argument that depends on w

    def arguments(self, order: Sequence[Node]) -> dict[Node, list[Node]]:
        """What each node hands down to; not in it are nodes that are done with another."""
        firsts = {r.second: r.first for r in self.rotations.values()}
        inside = {node for r in self.rotations.values() for node in r.products}
        inside |= {each.variable for each in self.sums.values()} | firsts.keys()
        found = {}
        for node in order:
            if node not in inside:
                args: Sequence[Node] = node.args
                if node in self.sums:
                    args = (self.sums[node].other,)
                elif node in self.rotations:
                    args = self.rotations[node].x, self.rotations[node].y
                found[node] = list(dict.fromkeys([firsts.get(arg, arg) for arg in args if arg in self.depends]))
        return found

    def _take(self, node: Node) -> tuple[Node, dict[Node, Node]]:
        """W of a node with itself and with the others; the node leaves W."""
        row = self.rows.pop(node, {})
        pivot = row.pop(node, ZERO)
        for other in row:
            del self.rows[other][node]
        return pivot, row

    def _add(self, a: Node, b: Node, value: Node) -> None:
        if value.value == 0.0:
            return
        row = self.rows.setdefault(a, {})
        total = row[b] + value if b in row else value
        row[b] = total
        self.rows.setdefault(b, {})[a] = total

    def take(self, step: Step) -> None:
        """A step from the output down: what it takes out of W t = b."""
        if isinstance(step, list):
            self.turn_back(step)
        elif step in self.sums:
            self.eliminate_sum(step)
        elif step in self.position:
            self.eliminate(step)
        else:
            self.hand_down(step)

    def find_tangents(self, step: Step) -> None:
        """The same step in the sweep back up: its tangents, by those of the steps taken after it."""
        dots = self.dots
        if isinstance(step, list):
            for r in step:
                dots[r.first] = r.sign_x * (r.cos * dots[r.x] + r.sin * dots[r.y])
                dots[r.second] = r.sign_y * (r.cos * dots[r.y] - r.sin * dots[r.x])
        elif step in self.solved:
            solved = self.solved[step]
            dot = solved.alone
            for other, gain in solved.gains.items():
                dot = dot - gain * dots[other]
            dots[step] = dot
            if step in self.sums:
                variable, other, p, p_other = self.sums[step]
                rest = dot if other not in dots else dot - p_other * dots[other]
                dots[variable] = p * rest  # p is 1 or -1
        else:
            dots[step] = _total([p * dots[arg] for arg, p in self.partials[step].items()])

    def eliminate(self, node: Node) -> None:
        """A variable whose uses are all behind: its row of W t = b gives it in terms of the live nodes."""
        self._reduce(node, self.rhs[node])

    def _reduce(self, node: Node, rhs: Node) -> None:
        pivot, row = self._take(node)
        if pivot.value == 0.0:
            raise SingularError(self.index(node))
        gains = {other: value / pivot for other, value in row.items()}
        others = list(row)
        for i, a in enumerate(others):
            for b in others[: i + 1]:
                self._add(a, b, -(gains[a] * row[b]))
            self.rhs[a] = self.rhs.get(a, ZERO) - gains[a] * rhs
        self.solved[node] = _Solved(pivot, rhs / pivot, gains)

    def index(self, node: Node) -> int:
        """The place among `wrt` of an eliminated variable, or of the one in an eliminated sum."""
        return self.position[self.sums[node].variable if node in self.sums else node]

    def eliminate_sum(self, node: Node) -> None:
        """A sum z = p_w w + p a with the only use of a variable w: z is as free as w, and is eliminated in its place.

        Handed down to w and a first, W_zz would be in the rows of both, for the elimination to take out of a's again:
        a difference that keeps nothing where W_zz is much larger than what a has of its own.
        """
        variable, other, p, p_other = self.sums[node]
        bar, own, applied = self.bars.pop(node, ZERO), self.rhs.pop(node, ZERO), p * self.rhs[variable]
        self._reduce(node, own + applied)
        if other in self.depends:
            self.bars[other] = self.bars.get(other, ZERO) + p_other * bar
            self.rhs[other] = self.rhs.get(other, ZERO) - p_other * applied

    def turn_back(self, group: Sequence[Rotation]) -> None:
        """Rotations by one angle, done at once: with c^2 + s^2 = 1 their blocks of W cost half of product by product.

        The adjoints and W of x and y are those of the sums turned back, by x = c p - s q, y = s p + c q.
        """
        signs = {r.first: r.sign_x for r in group} | {r.second: r.sign_y for r in group}
        within: dict[tuple[Node, Node], Node] = {}
        others: dict[Node, dict[Node, Node]] = {}
        for node, sign in signs.items():
            for other, value in self.rows.get(node, {}).items():
                if other in signs:
                    within[node, other] = sign * signs[other] * value
                else:
                    others.setdefault(other, {})[node] = sign * value
        for node in signs:
            self._take(node)
        for i, r in enumerate(group):
            p, q, x, y, c, s = r[:6]
            for table in (self.bars, self.rhs):
                a, b = r.sign_x * table.pop(p, ZERO), r.sign_y * table.pop(q, ZERO)
                table[x] = table.get(x, ZERO) + (c * a - s * b)
                table[y] = table.get(y, ZERO) + (s * a + c * b)
            for other, row in others.items():
                a, b = row.get(p, ZERO), row.get(q, ZERO)
                self._add_both(x, other, c * a - s * b)
                self._add_both(y, other, s * a + c * b)
            for r2 in group[:i]:
                p2, q2, x2, y2 = r2[:4]
                pp, pq, qp, qq = (within.get(pair, ZERO) for pair in ((p, p2), (p, q2), (q, p2), (q, q2)))
                u = s * (pp - qq) + c * (pq + qp)
                self._add_both(x, x2, pp - s * u)
                self._add_both(y, y2, qq + s * u)
                self._add_both(x, y2, c * u - qp)
                self._add_both(y, x2, c * u - pq)
            pp, pq, qq = (within.get(pair, ZERO) for pair in ((p, p), (p, q), (q, q)))
            u = s * (pp - qq) + 2.0 * c * pq
            self._add(x, x, pp - s * u)
            self._add(y, y, qq + s * u)
            self._add(x, y, c * u - pq)

    def _add_both(self, a: Node, b: Node, value: Node) -> None:
        """An entry of W and the one across, which are one where a is b."""
        self._add(a, b, 2.0 * value if a is b else value)

    def hand_down(self, node: Node) -> None:
        """An operation: t = sum p t_arg takes it out of W t = b, and its curvature goes to its arguments."""
        pivot, row = self._take(node)
        bar, rhs = self.bars.pop(node, ZERO), self.rhs.pop(node, ZERO)
        partials: dict[Node, Node] = {}
        for arg, partial in zip(node.args, node.op.partials(node, *node.args), strict=True):
            if arg in self.depends:
                partials[arg] = partials[arg] + partial if arg in partials else as_node(partial)
        self.partials[node] = partials
        for arg, p in partials.items():
            self.bars[arg] = self.bars.get(arg, ZERO) + bar * p
            self.rhs[arg] = self.rhs.get(arg, ZERO) + p * rhs
            for other, value in row.items():
                self._add_both(arg, other, p * value)
        self._curve(partials, pivot)
        if bar.value != 0.0:
            self._bend(node, bar)

    def _curve(self, partials: dict[Node, Node], pivot: Node) -> None:
        """The node's own second-order adjoint, through its partials: p_j p_k W."""
        if pivot.value != 0.0:
            args = list(partials)
            for i, a in enumerate(args):
                scaled = pivot * partials[a]
                for b in args[: i + 1]:
                    self._add(a, b, scaled * partials[b])

    def _bend(self, node: Node, bar: Node) -> None:
        """The node's adjoint times its second partials; both orders of two slots that hold one argument count."""
        for j, k, second in second_partials(node, self.build):
            a, b = node.args[j], node.args[k]
            if a in self.depends and b in self.depends:
                self._add(a, b, 2.0 * (bar * second) if a is b and j != k else bar * second)


class _SumOf(NamedTuple):
    """A sum p variable + p_other other."""

    variable: Node
    other: Node
    p: float
    p_other: float


def _sums(order: Sequence[Node], position: Mapping[Node, int]) -> dict[Node, _SumOf]:
    """The sums and differences with the only use of a variable; of two, the later one."""
    uses: dict[Node, int] = {}
    for node in order:
        for arg in node.args:
            uses[arg] = uses.get(arg, 0) + 1
    found = {}
    for node in order:
        if node.op.name in ("add", "sub"):
            signs = (1.0, 1.0 if node.op.name == "add" else -1.0)
            free = [k for k, each in enumerate(node.args) if each in position and uses[each] == 1]
            if free:
                k = max(free, key=lambda k: position[node.args[k]])
                found[node] = _SumOf(node.args[k], node.args[1 - k], signs[k], signs[1 - k])
    return found


def _of(step: Step) -> Node:
    """The node of a step, of rotations the first."""
    return step[0].first if isinstance(step, list) else step


def _dependent(outputs: Sequence[Node], wrt: Sequence[Node]) -> list[Node]:
    """The nodes that depend on `wrt`, arguments first, each variable just before its first use."""
    depends = set(wrt)
    order = []
    for node in topological(outputs):
        if node in depends or any([arg in depends for arg in node.args]):
            depends.add(node)
            order.append(node)
    met = set(order)
    return [node for node in wrt if node not in met] + order


def _total(terms: list[Node]) -> Node:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
