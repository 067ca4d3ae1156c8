"""Batches in blocks, which threads share."""

from __future__ import annotations

from collections.abc import Callable

from ...core.evaluation import Array
from ...util.threads import share


def write_batch(
    width: int, columns: Callable[[Array, Array], None], points: Array, result: Array, threads: int
) -> None:
    """What `columns` writes, (n_out, N), of points, (n_in, N), in blocks of that width."""

    def block(start: int) -> None:
        stop = start + width
        columns(points[:, start:stop], result[:, start:stop])

    # Blocks begin where they begin whatever `threads` is, so that each column always has the same neighbours.
    total = points.shape[1]
    share(block, range(0, total, width), min(threads, total // width))
