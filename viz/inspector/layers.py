"""Places of nodes in layers: arguments below their uses, neighbors near one another."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

STEP, GAP = 52.0, 8.0  # pixels from layer to layer, and between two nodes of a layer
SWEEPS = 8


class Layout(NamedTuple):
    """Centres of nodes in pixels, y downward, and the size of the whole."""

    x: list[float]
    y: list[float]
    width: float
    height: float


def layered(widths: Sequence[float], edges: Sequence[tuple[int, int]]) -> Layout:
    """Places of nodes 0.. of these widths; edges lead from an earlier node to a later one.

    A layer that would be much wider than the whole is high is broken into several.
    """
    below: list[list[int]] = [[] for _ in widths]
    above: list[list[int]] = [[] for _ in widths]
    for source, target in edges:
        below[target].append(source)
        above[source].append(target)
    near = [[*a, *b] for a, b in zip(above, below, strict=True)]
    layers = _broken(_layers(below, above), widths)
    place = [0.0] * len(widths)
    for layer in layers:
        _set(place, layer, widths, [float(i) for i in range(len(layer))])
    for sweep in range(SWEEPS):
        for layer in layers if sweep % 2 else reversed(layers):
            wish = [_mean([place[i] for i in near[node]], place[node]) for node in layer]
            order = sorted(range(len(layer)), key=wish.__getitem__)
            layer[:] = [layer[i] for i in order]
            _set(place, layer, widths, [wish[i] for i in order])
    left = min([place[i] - widths[i] / 2 for i in range(len(widths))], default=0.0)
    right = max([place[i] + widths[i] / 2 for i in range(len(widths))], default=0.0)
    y = [0.0] * len(widths)
    for height, layer in enumerate(reversed(layers)):
        for node in layer:
            y[node] = (height + 0.5) * STEP
    return Layout([at - left for at in place], y, right - left, len(layers) * STEP)


def _layers(below: Sequence[Sequence[int]], above: Sequence[Sequence[int]]) -> list[list[int]]:
    """Nodes by the length of the longest way to them; one without arguments here is just below its first use."""
    rank = [0] * len(below)
    for node, args in enumerate(below):
        rank[node] = max([rank[arg] + 1 for arg in args], default=0)
    for node, args in enumerate(below):
        if not args and above[node]:
            rank[node] = min([rank[user] for user in above[node]]) - 1
    layers: list[list[int]] = [[] for _ in range(max(rank, default=-1) + 1)]
    for node, height in enumerate(rank):
        layers[height].append(node)
    return layers


def _broken(layers: Sequence[list[int]], widths: Sequence[float]) -> list[list[int]]:
    total = sum(widths) + GAP * len(widths)
    limit = max(240.0, 1.3 * math.sqrt(total * STEP))
    rows: list[list[int]] = []
    for layer in layers:
        parts = math.ceil(sum([widths[node] + GAP for node in layer]) / limit)
        size = math.ceil(len(layer) / parts) if parts else 1
        rows += [layer[i : i + size] for i in range(0, len(layer), size)]
    return rows


def _set(place: list[float], layer: Sequence[int], widths: Sequence[float], wish: Sequence[float]) -> None:
    """Put the nodes of a layer, in order, where they wish to be, as far as they do not overlap.

    The least squares of the ways they are off, by pooling: nodes that touch move together.
    """
    offset, pools = 0.0, list[tuple[float, int]]()  # of each pool the mean wish for its left end, and its size
    offsets = []
    for node, at in zip(layer, wish, strict=True):
        offset += widths[node] / 2
        offsets.append(offset)
        mean, size = at - offset, 1
        while pools and pools[-1][0] >= mean:
            other, others = pools.pop()
            mean, size = (mean * size + other * others) / (size + others), size + others
        pools.append((mean, size))
        offset += widths[node] / 2 + GAP
    starts = [mean for mean, size in pools for _ in range(size)]
    for node, start, at in zip(layer, starts, offsets, strict=True):
        place[node] = start + at


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise
