"""Colorings: which columns, or rows, of a sparse matrix one sweep of a derivative may share, so that few sweeps do.

Columns of one color have no row in common, so a product with the sum of their unit vectors holds all their entries
(Curtis, Powell and Reid 1974). The smallest number of colors is hard to find; greedy choices in a good order come close
(Gebremedhin, Manne and Pothen 2005). They are made here with sets of colors as the bits of integers, a set for each
row: time is proportional to the number of entries, where the graph of columns that share a row, which a library of
graph algorithms would color, has a number of edges that grows with the squares of the rows.
"""

import functools
import math
import operator
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .sparsity import Pattern, full

NONE = -1  # the color of what takes part in no sweep


class Coloring(NamedTuple):
    """Sweeps that give a matrix: every entry from a forward sweep, over columns, or from a reverse one, over rows.

    columns, rows: the color of each, NONE for one that no sweep takes.  by_row: of each entry whether a reverse sweep
    gives it.
    """

    columns: list[int]
    rows: list[int]
    by_row: np.ndarray[tuple[int], np.dtype[np.bool_]]

    @property
    def counts(self) -> tuple[int, int]:
        """The numbers of directions, forward and reverse."""
        return 1 + max(self.columns, default=NONE), 1 + max(self.rows, default=NONE)

    def vectors(self, lanes: int) -> int:
        """Sweeps over vectors of directions, and one more for each way, forward and reverse, beyond the first."""
        return _cost(self.counts, lanes)[0] - 1


def jacobian_coloring(entries: Pattern, lanes: int) -> Coloring:
    """The cheapest of some colorings of a Jacobian: of its columns, of its rows, and of both.

    A few dense rows make all columns clash; reverse sweeps for these leave few colors (Coleman and Verma 1998).
    """
    m, n = entries.shape
    best, least = Coloring([NONE] * n, [NONE] * m, np.zeros(len(entries.rows), dtype=bool)), (math.inf, 0)
    for turned in (False, True):
        lists, width, places = (entries.by_row(), n, entries.rows)
        if turned:
            lists, width, places = (entries.by_column(), m, entries.columns)
        order = sorted(range(len(lists)), key=lambda k: -len(lists[k]))
        for size in (0, *(2**k for k in range(len(lists).bit_length()))):
            taken = set(order[:size])  # these lists, a direction each or less; the others, by what they hold
            bound = len(lists[order[size]]) if size < len(lists) else 0
            if _cost((bound, bool(taken)), lanes) >= least:
                continue
            across = _greedy([[] if k in taken else each for k, each in enumerate(lists)], width)
            along = _greedy(_turned([each if k in taken else [] for k, each in enumerate(lists)], width), len(lists))
            inside = np.isin(places, list(taken))
            found = Coloring(along, across, ~inside) if turned else Coloring(across, along, inside)
            if (cost := _cost(found.counts, lanes)) < least:
                best, least = found, cost
    return best


def column_coloring(entries: Pattern) -> Coloring:
    """Colors of the columns alone."""
    m, n = entries.shape
    return Coloring(_greedy(entries.by_row(), n), [NONE] * m, np.zeros(len(entries.rows), dtype=bool))


def _cost(directions: tuple[int, int], lanes: int) -> tuple[int, int]:
    """Sweeps over vectors of directions, with what stands before them; and directions."""
    return sum([1 - count // -lanes for count in directions if count]), sum(directions)


def _greedy(groups: Sequence[Sequence[int]], count: int) -> list[int]:
    """Colors of 0 .. count - 1 that differ within every group; of those that are in no group, NONE.

    The better of two orders: as they come, which suits bands, and those with the most company first.
    """
    member = _turned(groups, count)
    bound = max(map(len, groups), default=0)
    orders = [range(count), sorted(range(count), key=lambda k: -sum([len(groups[g]) for g in member[k]]))]
    best: list[int] = []
    for order in orders:
        used = [0] * len(groups)  # colors, as bits
        colors = [NONE] * count
        for k in order:
            if member[k]:
                free = _lowest_free(functools.reduce(operator.or_, [used[g] for g in member[k]]))
                colors[k] = free
                for g in member[k]:
                    used[g] |= 1 << free
        if not best or max(colors) < max(best):
            best = colors
        if max(best, default=NONE) < bound:
            break
    return best


def star_coloring(entries: Pattern) -> list[int]:
    """Colors of the columns of a symmetric matrix, such that of every entry (i, j) one of two things holds.

    Either j is the only column of its color with an entry in row i, or i the only one of its with an entry in row j:
    with its mirror image every entry is in a product. Neighbors differ, and no path over four columns has two colors
    (algorithm 4.1 of Gebremedhin, Manne and Pothen, with what it searches kept as sets). An arrow needs two. The better
    of two orders: as the columns come, and those with the most entries first.
    """
    n = entries.shape[1]
    if full(entries):
        return list(range(n))
    neighbors = [[j for j in row if j != i] for i, row in enumerate(entries.by_row())]
    orders = [range(n), sorted(range(n), key=lambda k: -len(neighbors[k]))]
    return min([_star(neighbors, order) for order in orders], key=lambda colors: max(colors, default=NONE))


def _star(neighbors: Sequence[Sequence[int]], order: Sequence[int]) -> list[int]:
    n = len(neighbors)
    colors = [NONE] * n
    around = [0] * n  # the colors of the neighbors, as bits
    ends = [0] * n  # of a w with a color: those of its neighbors x that have another neighbor of w's color
    alike: list[dict[int, list[int]]] = [{} for _ in range(n)]  # {color: the neighbors that have it}
    for v in order:
        taken = 0
        for w in neighbors[v]:
            taken |= around[w] if colors[w] == NONE else ends[w] | 1 << colors[w]
        color = colors[v] = _lowest_free(taken)
        for same in alike[v].values():  # v is such an x
            if len(same) > 1:
                for w in same:
                    ends[w] |= 1 << color
        for x in neighbors[v]:
            around[x] |= 1 << color
            same = alike[x].setdefault(color, [])
            same.append(v)
            if len(same) > 1 and colors[x] != NONE:
                for w in same if len(same) == 2 else (v,):
                    ends[w] |= 1 << colors[x]
    return colors


def _lowest_free(taken: int) -> int:
    return (~taken & (taken + 1)).bit_length() - 1


def _turned(groups: Sequence[Sequence[int]], count: int) -> list[list[int]]:
    """The groups that each of 0 .. count - 1 is in."""
    member: list[list[int]] = [[] for _ in range(count)]
    for g, group in enumerate(groups):
        for k in group:
            member[k].append(g)
    return member
