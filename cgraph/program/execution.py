"""Execution: what the rules of statements in Python run with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..core.evaluation import Array
from ..core.graph import Graph
from .statement import Lengths, Statement, row_of


@dataclass(frozen=True)
class Execution:
    """What the rules of statements in Python call: graphs at points, and other statements.

    Attributes
    ----------
    lengths : mapping of str to int
        Of the registers.
    values : callable
        (graph, x): the outputs of a graph of the program at a point.
    batch : callable
        (graph, points): the outputs at points (inputs, N), (outputs, N).
    many : int
        How many memories run side by side; -1: one alone.
    """

    lengths: Lengths
    values: Callable[[Graph, Sequence[float]], Sequence[float]]
    batch: Callable[[Graph, Array], Array]
    many: int = -1

    def run(self, statements: Sequence[Statement], state: dict[str, Any]) -> None:
        """Statements, one after another."""
        for statement in statements:
            row = row_of(statement)
            rule = row.run if self.many < 0 else row.beside
            assert rule is not None, "Runner.run_many has asked"
            rule(statement, state, self)
