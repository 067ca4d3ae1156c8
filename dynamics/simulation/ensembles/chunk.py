"""Chunks: some trajectories of an ensemble, before they are run and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cgraph.extend import Array

from .ensemble import Counts


@dataclass(frozen=True)
class Chunk:
    """Trajectories first, first + 1, ..: their starts x (k, m) and the values p (k, ..) of the problem's parameters."""

    first: int
    x: Array
    p: Array


@dataclass(frozen=True)
class Part:
    """What a chunk gives: rows (k, T, m), NaN from where a trajectory stopped on; then its `status` says so."""

    first: int
    rows: Array
    steps: Counts
    rejected: Counts
    evaluations: Counts
    dt: Array  # (k,) s, the largest steps
    status: list[str]  # empty while all is well


def empty(chunk: Chunk, rows: Array) -> Part:
    """The part of a chunk before its first step."""
    k = len(chunk.x)
    steps, rejected, evaluations = np.zeros((3, k), dtype=np.int64)
    return Part(chunk.first, rows, steps, rejected, evaluations, np.zeros(k), [""] * k)
