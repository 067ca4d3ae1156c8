"""Elimination on a Hessian that is never formed: edges are pushed, and variables leave by their Schur complements.

The unknowns t are the tangents of all nodes z that depend on the variables w. With the adjoints zbar = df/dz, the
second-order adjoint W and the right-hand side b, an operation z with partials p_k = dz/da_k leaves the equations by

    t_z = sum_k p_k t_k                                                (its tangent)
    abar_k += p_k zbar                                                 (adjoints)
    b_k += p_k b_z                                                     (right-hand side)
    W_kj += p_k W_zj                for every other node j             (second-order adjoint, off the diagonal)
    W_kj += p_k p_j W_zz + zbar d2z/(da_k da_j)                        (its diagonal, and the operation's own Hessian)

and a variable w, once all nodes that use it have left, by Gaussian elimination: from the output down, rotations by one
angle together.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from heapq import heappop, heappush
from typing import NamedTuple

from ..core.builder import Builder
from ..core.forward import ReachedNodes, tangents
from ..core.node import Node, as_node, variable
from ..core.row import Row
from ..core.scope import building
from ..core.traversal import topological
from ..util.caches import OPERATIONS, memo
from .rotation_pairs import Rotation, rotations
from .symmetric_elimination import ZERO, SymmetricElimination

ONE = as_node(1.0)
EliminationStep = Node | list[Rotation]


class EdgePushing(SymmetricElimination):
    """The equations W t = b while nodes leave them, from the output down, and the tangents on the way back.

    rhs: {variable: entry of b}.  at: right-hand sides at inner nodes.  order: nodes that depend on the variables,
    arguments first.
    """

    def __init__(
        self, build: Builder, output: Node, rhs: dict[Node, Node], at: Mapping[Node, Node], order: Sequence[Node]
    ) -> None:
        self.build = build
        self.order = order
        self.depends = set(order)
        self.position = {node: i for i, node in enumerate(rhs)}
        self.sums = _variable_sums(order, self.position)
        in_sums = {node: self.position[terms.variable] for node, terms in self.sums.items()}
        super().__init__(dict(rhs), self.position | in_sums)
        self.bars: dict[Node, Node] = {output: ONE}  # adjoints
        for node, value in at.items():
            self.rhs[node] = self.rhs.get(node, ZERO) + value
        pairs = [r for r in rotations(order, self.depends, at) if not {r.first, r.second} & self.sums.keys()]
        self.rotations = {r.first: r for r in pairs}
        self.reached = ReachedNodes(dict.fromkeys([output, *at]))
        self.dots: dict[Node, Node] = {}  # tangents
        self.partials: dict[Node, dict[Node, Node]] = {}  # of each operation, by argument that depends on w

    def arguments(self, rows: Mapping[Node, Sequence[Node]]) -> dict[Node, list[Node]]:
        """The nodes that each step's equation passes to; nodes that leave with another are no key.

        rows: {multiplier: variables that its row holds}; the equation of each of these passes to it.
        """
        firsts = {r.second: r.first for r in self.rotations.values()}
        absorbed = {node for r in self.rotations.values() for node in r.products}
        absorbed |= {terms.variable for terms in self.sums.values()} | firsts.keys()
        result = {}
        for node in self.order:
            if node not in absorbed:
                args: Sequence[Node] = node.args
                if node in self.sums:
                    args = (self.sums[node].other,)
                elif node in self.rotations:
                    args = self.rotations[node].x, self.rotations[node].y
                result[node] = list(dict.fromkeys([firsts.get(arg, arg) for arg in args if arg in self.depends]))
        leaves_at = {terms.variable: node for node, terms in self.sums.items()}
        for multiplier, variables in rows.items():
            for w in variables:
                result[leaves_at.get(w, w)].append(leaves_at.get(multiplier, multiplier))
        return result

    def unknown(self, node: Node) -> Node:
        """Unknown that a node stands for in the step at hand."""
        return node

    def reduce(self, step: EliminationStep) -> None:
        """Take the nodes of a step out of W t = b."""
        if isinstance(step, list):
            self.push_rotations(step)
        elif step in self.sums:
            self.eliminate_sum(step)
        elif step in self.position:
            self.eliminate(step)
        else:
            self.push_adjoint(step)

    def substitute(self, step: EliminationStep) -> None:
        """The tangents of a step's nodes, from those of the steps that were reduced after it."""
        dots = self.dots
        if isinstance(step, list):  # (p, q) = R (x, y), R = [[c, s], [-s, c]]
            for r in step:
                x, y = dots[self.unknown(r.x)], dots[self.unknown(r.y)]
                dots[r.first] = r.sign_x * (r.cos * x + r.sin * y)
                dots[r.second] = r.sign_y * (r.cos * y - r.sin * x)
        elif step in self.pivot_rows:
            if step not in dots:  # as is one that waited
                dots[step] = self.solution(step, dots)
            dot = dots[step]
            if step in self.sums:  # z = p w + p' a, so t_w = p (t_z - p' t_a), as p = 1 / p
                variable, other, p, p_other = self.sums[step]
                rest = dot if other not in self.depends else dot - p_other * dots[self.unknown(other)]
                dots[variable] = p * rest
        else:  # t_z = sum_k p_k t_k
            terms = [self.product(step, p, dots[self.unknown(arg)]) for arg, p in self.partials[step].items()]
            dots[step] = sum(terms[1:], start=terms[0])

    def finish(self) -> None:
        """Take out the unknowns that wait, and give them their tangents."""
        for node in self.eliminate_waiting():
            self.dots[node] = self.solution(node, self.dots)

    def eliminate_sum(self, node: Node) -> None:
        """A sum z = p w + p' a with the only use of w, eliminated in place of w: the unknowns (w, a) become (z, a).

        With w = p (z - p' a): b_z += p b_w, b_a -= p' p b_w, abar += p' zbar. Pushed to w and a first, W_zz would leave
        the rows of both as a difference in which digits are lost.
        """
        variable, other, p, p_other = self.sums[node]
        bar, at_variable = self.bars.pop(node, ZERO), p * self.rhs[variable]
        self.rhs[node] = self.rhs.get(node, ZERO) + at_variable  # b_z += p b_w
        self.eliminate(node)  # W_jk -= W_zj W_zk / W_zz
        if other in self.depends:
            self.bars[other] = self.bars.get(other, ZERO) + p_other * bar
            other = self.unknown(other)  # b_a -= p' p b_w
            self.rhs[other] = self.rhs.get(other, ZERO) - p_other * at_variable

    def push_rotations(self, group: Sequence[Rotation]) -> None:
        """Rotations (p, q) = R (x, y) by one angle: R^T to adjoints and b, R^T W R to W, with R = [[c, s], [-s, c]].

        By c^2 + s^2 = 1 a 2 x 2 block of R^T W R takes half of the products that term by term it would.
        """
        signs = {r.first: r.sign_x for r in group} | {r.second: r.sign_y for r in group}
        inner: dict[tuple[Node, Node], Node] = {}  # W between nodes of the group
        outer: dict[Node, dict[Node, Node]] = {}  # W of other nodes with those of the group
        for node, sign in signs.items():
            for other, value in self.matrix.row(node).items():
                if other in signs:
                    inner[node, other] = sign * signs[other] * value
                else:
                    outer.setdefault(other, {})[node] = sign * value
        for node in signs:
            self.matrix.pop(node)
        called = [r._replace(x=self.unknown(r.x), y=self.unknown(r.y)) for r in group]
        for i, r in enumerate(called):
            p, q, _, _, c, s = r[:6]
            for table, (x, y) in ((self.bars, group[i][2:4]), (self.rhs, r[2:4])):  # (x, y) += R^T (p, q)
                a, b = r.sign_x * table.pop(p, ZERO), r.sign_y * table.pop(q, ZERO)
                table[x] = table.get(x, ZERO) + (c * a - s * b)
                table[y] = table.get(y, ZERO) + (s * a + c * b)
            for other, row in outer.items():  # (W_xj, W_yj) += R^T (W_pj, W_qj)
                a, b = row.get(p, ZERO), row.get(q, ZERO)
                self.matrix.add_both(x, other, c * a - s * b)
                self.matrix.add_both(y, other, s * a + c * b)
            for earlier in called[:i]:
                self._push_block(r, earlier, inner)
            self._push_diagonal_block(r, inner)

    def _push_block(self, r: Rotation, r2: Rotation, inner: Mapping[tuple[Node, Node], Node]) -> None:
        """R^T B R for the block B of W between (p, q) and (p2, q2).

        With u = s (B_pp - B_qq) + c (B_pq + B_qp) it is [[B_pp - s u, c u - B_qp], [c u - B_pq, B_qq + s u]].
        """
        p, q, x, y, c, s = r[:6]
        p2, q2, x2, y2 = r2[:4]
        pp, pq, qp, qq = (inner.get(pair, ZERO) for pair in ((p, p2), (p, q2), (q, p2), (q, q2)))
        u = s * (pp - qq) + c * (pq + qp)
        self.matrix.add_both(x, x2, pp - s * u)
        self.matrix.add_both(y, y2, qq + s * u)
        self.matrix.add_both(x, y2, c * u - qp)
        self.matrix.add_both(y, x2, c * u - pq)

    def _push_diagonal_block(self, r: Rotation, inner: Mapping[tuple[Node, Node], Node]) -> None:
        """R^T B R as in `_push_block` for the symmetric block of (p, q) with itself."""
        p, q, x, y, c, s = r[:6]
        pp, pq, qq = (inner.get(pair, ZERO) for pair in ((p, p), (p, q), (q, q)))
        u = s * (pp - qq) + 2.0 * c * pq
        self.matrix.add(x, x, pp - s * u)
        self.matrix.add(y, y, qq + s * u)
        self.matrix.add(x, y, c * u - pq)

    def push_adjoint(self, node: Node) -> None:
        """An operation z leaves W t = b: abar_k += p_k zbar, b_k += p_k b_z, W_kj += p_k W_zj."""
        diagonal, row = self.matrix.pop(node)
        bar, rhs = self.bars.pop(node, ZERO), self.rhs.pop(node, ZERO)
        partials: dict[Node, Node] = {}
        for arg, partial in zip(node.args, map(as_node, node.op.partials(node, *node.args)), strict=True):
            if arg in self.depends:
                partials[arg] = partials[arg] + partial if arg in partials else partial
                if partial.value != 0.0:
                    self.reached.pass_on(node.op, node, arg, partial)
        self.partials[node] = partials
        for arg, p in partials.items():  # z = sum_k p_k a_k in W t = b: abar_k, b_k and row k take p_k times z's
            a = self.unknown(arg)
            self.bars[arg] = self.bars.get(arg, ZERO) + self.product(node, bar, p)
            self.rhs[a] = self.rhs.get(a, ZERO) + self.product(node, p, rhs)
            for other, value in row.items():
                self.matrix.add_both(a, other, self.product(node, p, value))
        self.push_second_order(node, partials, diagonal)
        if bar.value != 0.0:
            self.add_local_hessian(node, bar)

    def product(self, node: Node, a: Node, b: Node) -> Node:
        """a * b for a partial of the operation `node`; 0 where f does not depend on it, though a slope is infinite."""
        return self.reached.product(node.op, node, a, b)

    def push_second_order(self, node: Node, partials: Mapping[Node, Node], diagonal: Node) -> None:
        """W_kj += p_k p_j W_zz."""
        if diagonal.value != 0.0:
            args = list(partials)
            for i, a in enumerate(args):
                scaled = self.product(node, diagonal, partials[a])
                for b in args[: i + 1]:
                    self.matrix.add(self.unknown(a), self.unknown(b), self.product(node, scaled, partials[b]))

    def add_local_hessian(self, node: Node, bar: Node) -> None:
        """W_kj += zbar d2z/(da_k da_j); an argument in two slots gets both mixed terms."""
        for j, k, second in _second_partials(node, self.build):
            a, b = node.args[j], node.args[k]
            if a in self.depends and b in self.depends:
                term = self.product(node, bar, second)
                self.matrix.add(self.unknown(a), self.unknown(b), 2.0 * term if a is b and j != k else term)


def elimination_steps(
    arguments: Mapping[Node, Collection[Node]], rotations: Mapping[Node, Rotation], *, fewest: bool = False
) -> list[EliminationStep]:
    """Steps from the output down: a node, or rotations by one angle, once all nodes that use them are done.

    arguments: {node: those that its row of W t = b passes to}, arguments first. A rotation is there once, by its first
    sum, and wherever either sum is an argument.

    Of the nodes that are ready the one last in `arguments` is next; with a rotation, all ready ones by its angle. To
    take the one that leaves the fewest live, `fewest`, saves an eighth of the nodes of a planar chain, but more of them
    wait for one another, and the machine code takes longer. Between bodies fewer unknowns are left.
    """
    ordered = list(arguments)
    position = {node: i for i, node in enumerate(ordered)}
    users: dict[Node, list[Node]] = {node: [] for node in ordered}
    for node, args in arguments.items():
        for arg in args:
            users[arg].append(node)
    uses = {node: len(by) for node, by in users.items()}  # by nodes that are not done
    new = {node: len(args) for node, args in arguments.items()}  # arguments that are not live
    live: set[Node] = set()  # what a node that is done passes to
    by_angle: dict[object, dict[Node, None]] = {r.angle: {} for r in rotations.values()}  # rotations that are ready
    heap: list[tuple[int, int]] = []

    def push(node: Node) -> None:
        heappush(heap, (new[node] - (node in live) if fewest else 0, -position[node]))

    def make_ready(node: Node) -> None:
        push(node)
        if node in rotations:
            by_angle[rotations[node].angle][node] = None

    def pass_to(arg: Node) -> None:
        if fewest and arg not in live:
            live.add(arg)
            for user in users[arg]:
                new[user] -= 1
                if not uses[user] and user not in done:
                    push(user)
        uses[arg] -= 1
        if not uses[arg]:
            make_ready(arg)

    done: set[Node] = set()
    result: list[EliminationStep] = []
    for node in ordered:
        if not uses[node]:
            make_ready(node)
    while heap:
        node = ordered[-heappop(heap)[1]]
        if node in done:  # with another rotation by its angle, or by a better place
            continue
        batch = [node]
        if node in rotations:
            same_angle = by_angle[rotations[node].angle]
            batch = list(same_angle)
            same_angle.clear()
            result.append([rotations[first] for first in batch])
        else:
            result.append(node)
        done.update(batch)
        for finished in batch:
            for arg in arguments[finished]:
                pass_to(arg)
    return result


def nodes_of(step: EliminationStep) -> list[Node]:
    """The nodes of a step."""
    return [node for r in step for node in (r.first, r.second)] if isinstance(step, list) else [step]


class _VariableSum(NamedTuple):
    """The terms of z = p variable + p_other other, where z can be eliminated in place of the variable; p is 1 or -1."""

    variable: Node
    other: Node
    p: float
    p_other: float


def _variable_sums(order: Sequence[Node], position: Mapping[Node, int]) -> dict[Node, _VariableSum]:
    """The sums and differences with the only use of a variable; where both terms are such, the later variable's.

    order: nodes, arguments first.  position: {variable: its place among all}.
    """
    uses = Counter([arg for node in order for arg in node.args])
    sums = {}
    for node in order:
        if node.op.name in ("add", "sub"):
            signs = (1.0, 1.0 if node.op.name == "add" else -1.0)
            free = [k for k, arg in enumerate(node.args) if arg in position and uses[arg] == 1]
            if free:
                k = max(free, key=lambda k: position[node.args[k]])
                sums[node] = _VariableSum(node.args[k], node.args[1 - k], signs[k], signs[1 - k])
    return sums


def _second_partials(node: Node, build: Builder) -> list[tuple[int, int, Node]]:
    """(j, k, d2y / da_j da_k) for y = node and its arguments a, j >= k, where it is not zero; nodes made by `build`.

    Arguments count as independent, also where one node stands in two slots.
    """
    output, arguments, seconds = _seconds_of(node.op)
    result = []
    for j, k, nodes in seconds:
        new = dict(zip(arguments, node.args, strict=True))
        new[output] = node
        for placeholder in nodes:  # put the operation's arguments in place of a, its output in place of y
            if placeholder not in new:
                args = tuple([new[arg] for arg in placeholder.args])
                new[placeholder] = build(placeholder.op, args, node.label) if args else placeholder
        if new[nodes[-1]].value != 0.0:
            result.append((j, k, new[nodes[-1]]))
    return result


@memo(OPERATIONS)
def _seconds_of(op: Row) -> tuple[Node, list[Node], list[tuple[int, int, list[Node]]]]:
    """Placeholders for the output y and the arguments a of an operation, and its second partials over them.

    These as (j, k, nodes of d2y / da_j da_k, arguments first, the result last).
    """
    output = variable("output#")
    arguments = [variable(f"argument{i}#") for i in range(op.arity)]
    build = Builder()
    with building(build):
        first = [as_node(partial) for partial in op.partials(output, *arguments)]
    one = as_node(1.0)
    # d2y/da_j da_k is the tangent of the partial dy/da_k in direction a_j; y itself moves by dy/da_j.
    seconds = []
    for j in range(op.arity):
        for k in range(j + 1):
            dots = tangents({arguments[j]: one, output: first[j]}, first, build)
            if first[k] in dots:
                seconds.append((j, k, topological([dots[first[k]]])))
    return output, arguments, seconds
