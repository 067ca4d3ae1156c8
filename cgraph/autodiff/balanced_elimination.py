"""Elimination by nested dissection: pieces of W t = b that leave at the same time, each seen from its two ends only.

A node z that other pieces use is there once more for them: a copy c with t_c = t_z, held by a multiplier m,

    [[W_cc, 1], [1, 0]] in the rows of (c, m),   W_zm = -1.

So every piece can be eliminated by itself. Of what lies between its ends there remain, at its copies c and at the
multipliers m of its nodes: the inertia J that it shows the one, the mobility C that it shows the other, W_mm = -C, and
what it passes on, W_mc. Two pieces meet in the pairs (c, m) between them: with both gone, so are the pieces. The pivots
[[J, u], [u, -C]] of positive definite parts have the determinant -(J C + u^2) < 0. For a chain of bodies that is the
divide and conquer of Featherstone (1999), in inertias and mobilities.

Steps form a tree, the elimination tree: the parent of a step is the first of the later steps that it leaves entries
with, whether by itself or through its children. Along a path from a leaf of the tree to its root the steps of one order
wait for one another. The path is cut in two near its middle, where the fewest unknowns cross, and the halves are cut
again. A branch off the path is dissected in the same way, within the piece that it joins.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from heapq import heapify, heappop, heappush

from ..core.builder import Builder
from ..core.node import Node, as_node, variable
from .schur_elimination import ONE, EdgePushing, EliminationStep, nodes_of
from .symmetric_elimination import ZERO, PivotRow

# Variables of a last piece for each unknown that crosses, at least 2: longer are deeper, shorter more nodes.
LEAF = 1.85
NEAR_MIDDLE = 0.2  # of the variables of a piece: how far from its middle a cut may be


class Piece:
    """Steps that are eliminated on their own: those of two halves, or a last piece; and the branches that join it.

    above: what it is a half of, or joins.  last: the place of its last step.
    """

    def __init__(self, above: Piece | None, last: int) -> None:
        self.above, self.last = above, last
        self.depth: int = above.depth + 1 if above else 0

    def common(self, other: Piece) -> Piece | None:
        """The smallest piece that holds both."""
        a: Piece | None = self
        b: Piece | None = other
        while a is not b:
            if a is not None and (b is None or a.depth >= b.depth):
                a = a.above
            elif b is not None:
                b = b.above
        return a


def dissect(rows: Sequence[Collection[int]], variables: Sequence[bool], unknowns: Sequence[int]) -> list[Piece]:
    """The smallest piece of every step.

    rows: the later steps that each step leaves entries with.  variables: which steps eliminate a variable.  unknowns:
    how many nodes each step eliminates.
    """
    n, filled = len(rows), _filled(rows)
    parents = [min(row, default=n) for row in filled]
    crossing = [sum([unknowns[k] for k in row]) for row in filled]
    children: list[list[int]] = [[] for _ in range(n + 1)]
    weight = [*map(int, variables), 0]
    for k, parent in enumerate(parents):
        children[parent].append(k)
        weight[parent] += weight[k]
    pieces: dict[int, Piece] = {}
    roots: list[tuple[int, Piece | None]] = [(root, None) for root in children[n]]
    while roots:
        root, above = roots.pop()
        path = [root]
        while children[path[-1]]:
            path.append(max(children[path[-1]], key=lambda k: (weight[k], k)))
        path.reverse()
        for piece, steps in _halves(path, variables, crossing, above):
            for k in steps:
                pieces[k] = piece
        for heavy, k in zip([-1, *path], path, strict=False):
            roots += [(child, pieces[k]) for child in children[k] if child != heavy]
    return [pieces[k] for k in range(n)]


def _filled(rows: Sequence[Collection[int]]) -> list[set[int]]:
    """The later steps that each step or what was eliminated below it leaves entries with."""
    result: list[set[int]] = []
    left: dict[int, set[int]] = {}  # by children, at their parent
    for k, row in enumerate(rows):
        filled = left.pop(k, set()) | set(row)
        filled.discard(k)
        result.append(filled)
        if filled:
            left.setdefault(min(filled), set()).update(filled)
    return result


def _halves(
    path: Sequence[int], variables: Sequence[bool], crossing: Sequence[int], above: Piece | None
) -> Iterator[tuple[Piece, Sequence[int]]]:
    """The pieces of a path that are not cut, with their steps."""
    piece = Piece(above, path[-1])
    count = [0]  # of variables before a place
    for k in path:
        count.append(count[-1] + variables[k])
    whole = count[-1]

    def best(middle: float) -> int | None:
        near = [i for i in range(1, len(path)) if abs(count[i] - middle) <= NEAR_MIDDLE * whole]
        return min(near, key=lambda i: (crossing[path[i - 1]], abs(count[i] - middle)), default=None)

    cut = best(whole / 2)
    leaves = 1 if cut is None else round(whole / (LEAF * max(2, crossing[path[cut - 1]])))
    cut = best(whole * (leaves // 2) / leaves) if leaves > 1 else None
    if cut is None:
        yield piece, path
    else:
        yield from _halves(path[:cut], variables, crossing, piece)
        yield from _halves(path[cut:], variables, crossing, piece)


class BalancedElimination(EdgePushing):
    """EdgePushing in pieces.

    plan: the steps.  rows: the unknowns that each step leaves entries with, see `written_rows`.
    copies: {node: its stand-in in other pieces, and the multiplier that holds it there}.
    """

    def __init__(
        self,
        build: Builder,
        output: Node,
        rhs: dict[Node, Node],
        at: Mapping[Node, Node],
        order: Sequence[Node],
        plan: Sequence[EliminationStep],
        rows: Sequence[Collection[Node]],
    ) -> None:
        super().__init__(build, output, rhs, at, order)
        place = {node: k for k, step in enumerate(plan) for node in nodes_of(step)}
        for node, terms in self.sums.items():
            place[terms.variable] = place[node]
        later = [{place[node] for node in row if place[node] > k} for k, row in enumerate(rows)]
        variables = [not isinstance(step, list) and (step in self.sums or step in self.position) for step in plan]
        pieces = dissect(later, variables, [len(nodes_of(step)) for step in plan])
        self._piece = {node: pieces[k] for node, k in place.items()}
        self.copies: dict[Node, tuple[Node, Node]] = {}
        self._leaving: dict[int, list[Node]] = {}  # the nodes whose copies leave after the step at a place
        self._cut(plan, rows, pieces)
        self._place = place
        self._here = pieces[0] if pieces else None
        self._after: dict[int, list[Node]] = {}  # what left after the step at a place
        self._depths: dict[Node, int] = {}

    def _cut(self, plan: Sequence[EliminationStep], rows: Sequence[Collection[Node]], pieces: Sequence[Piece]) -> None:
        """Copies of the nodes that steps of other pieces pass to, and where they leave."""
        within: dict[Node, Piece | None] = {}  # the piece that holds the node and all that pass to it
        for step, row, piece in zip(plan, rows, pieces, strict=True):
            for node in self._passed_to(step):
                here = self._piece[node]
                if node in row and piece.common(here) is not here:
                    wider = within.get(node, here)
                    within[node] = wider and wider.common(piece)
        for node, whole in within.items():
            if whole is not None:
                i = len(self.copies)
                self.copies[node] = variable(f"copy{i}#"), variable(f"multiplier{i}#")
                self._leaving.setdefault(whole.last, []).append(node)
        for nodes in self._leaving.values():
            nodes.sort(key=lambda node: -(within[node] or pieces[0]).depth)

    def _passed_to(self, step: EliminationStep) -> Iterable[Node]:
        if isinstance(step, list):
            return [node for r in step for node in (r.x, r.y)]
        return [arg for arg in step.args if arg in self.depends]

    def unknown(self, node: Node) -> Node:
        """The node, or its copy where the step at hand is of another piece."""
        copy, _ = self.copies.get(node, (node, node))
        here = self._piece[node]
        return node if copy is node or self._here is None or self._here.common(here) is here else copy

    def reduce(self, step: EliminationStep) -> None:
        """Take the nodes of a step out, and after it the pairs between pieces that are done."""
        nodes = nodes_of(step)
        self._here, k = self._piece[nodes[0]], self._place[nodes[0]]
        for node in nodes:
            if node in self.copies:
                copy, multiplier = self.copies[node]
                self.matrix.add(node, multiplier, as_node(-1.0))  # t_copy - t_node = 0, the multiplier's row
                self.matrix.add(copy, multiplier, ONE)
        super().reduce(step)
        before = len(self.pivot_rows)
        for node in self._leaving.get(k, ()):
            self.eliminate_tied(*self.copies[node])
            self.retry()
        self._after[k] = list(self.pivot_rows)[before:]

    def substitute(self, step: EliminationStep) -> None:
        """The tangents of what left with a step."""
        nodes = nodes_of(step)
        self._here, k = self._piece[nodes[0]], self._place[nodes[0]]
        for unknown in reversed(self._after[k]):
            self.dots[unknown] = self.solution(unknown, self.dots)
        super().substitute(step)

    def eliminate_tied(self, i: Node, j: Node) -> None:
        """Take out a copy i and its multiplier j at once, by the pivot [[W_ii, W_ij], [W_ij, W_jj]]."""
        a, row_i = self.matrix.pop(i)
        u = row_i.pop(j)
        e, row_j = self.matrix.pop(j)
        rhs_i, rhs_j = self.rhs.pop(i, ZERO), self.rhs.pop(j, ZERO)
        det = a * e - u * u  # K = [[W_ii, u], [u, W_jj]], of inertia J and mobility C: -(J C + u^2) < 0
        jj, ij, ii = a / det, -(u / det), e / det  # of the inverse
        others = list(dict.fromkeys([*row_i, *row_j]))
        # g = K^-1 W_(ij)k;  W_km -= g_k^T W_(ij)m,  b_k -= g_k^T b_(ij)
        gains_i = {k: ii * row_i.get(k, ZERO) + ij * row_j.get(k, ZERO) for k in others}
        gains_j = {k: ij * row_i.get(k, ZERO) + jj * row_j.get(k, ZERO) for k in others}
        for n, k in enumerate(others):
            for m in others[: n + 1]:
                self.matrix.add(k, m, -(gains_i[k] * row_i.get(m, ZERO) + gains_j[k] * row_j.get(m, ZERO)))
            self.rhs[k] = self.rhs.get(k, ZERO) - (gains_i[k] * rhs_i + gains_j[k] * rhs_j)
        last = next((k for k in reversed(self.pivot_rows) if k in self.place), None)
        self.place[i] = self.place[j] = 0 if last is None else self.place[last]
        self.pivot_rows[i] = PivotRow(det, ii * rhs_i + ij * rhs_j, gains_i)
        self.pivot_rows[j] = PivotRow(as_node(-1.0), ij * rhs_i + jj * rhs_j, gains_j)

    def solution(self, i: Node, known: Mapping[Node, Node]) -> Node:
        """Solution as of the base class, the shallowest terms first."""
        _, constant, gains = self.pivot_rows[i]
        terms = [(constant, False), *[(gain * known[other], True) for other, gain in gains.items()]]
        heap = [(self._depth(node), n, node, negative) for n, (node, negative) in enumerate(terms)]
        heapify(heap)
        n = len(heap)
        while len(heap) > 1:
            _, _, a, negative = heappop(heap)
            _, _, b, other_negative = heappop(heap)
            total = a + b if negative == other_negative else b - a if negative else a - b
            n += 1
            heappush(heap, (self._depth(total), n, total, negative and other_negative))
        _, _, total, negative = heap[0]
        return -total if negative else total

    def info(self, negative: Collection[Node] = ()) -> Node:
        """Info as of the base class; a pair that has not one positive eigenvalue counts as the variable before it."""
        return super().info({*negative, *[unknown for pair in self.copies.values() for unknown in pair]})

    def depth_of(self, solved: EdgePushing, wrt: Sequence[Node]) -> int:
        """Depth of the solution of some equations."""
        return max([self._depth(solved.dots[node]) for node in wrt], default=0)

    def _depth(self, node: Node) -> int:
        """The edges of the longest path to a node."""
        waiting = [node]
        while waiting:
            last = waiting[-1]
            deeper = [arg for arg in last.args if arg not in self._depths]
            waiting += deeper
            if not deeper:
                self._depths[waiting.pop()] = max([self._depths[arg] + 1 for arg in last.args], default=0)
        return self._depths[node]


def written_rows(equations: EdgePushing, plan: Sequence[EliminationStep]) -> list[set[Node]]:
    """The unknowns that each step leaves entries of W with, when all leave in the order of the plan."""
    rows = []
    for step in plan:
        equations.matrix.written = set()
        equations.reduce(step)
        rows.append(equations.matrix.written)
    return rows
