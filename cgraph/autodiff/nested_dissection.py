"""Nested dissection of an elimination: its steps in pieces that do not wait for one another, halves within halves.

Steps form a tree, the elimination tree: the parent of a step is the first of the later steps that it leaves entries
with, whether by itself or through its children. Along a path from a leaf of the tree to its root the steps of one order
wait for one another. The path is cut in two near its middle, where the fewest unknowns cross, and the halves are cut
again. A branch off the path is dissected in the same way, within the piece that it joins.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

LEAF = (
    1.85  # variables of a last piece for each unknown that crosses, at least 2: longer are deeper, shorter more nodes
)
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
