"""Explicit Runge-Kutta methods, as generated code takes them: their numbers, and what is checked of them."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from ..core.checks import GraphError
from ..core.graph import Graph
from ..util.require import require_mapping


class Tableau(Protocol):
    """The numbers of an explicit Runge-Kutta method, as `dynamics.integrators.Tableau` has them."""

    @property
    def c(self) -> tuple[float, ...]:
        """Times of the stages, the first 0."""

    @property
    def a(self) -> tuple[tuple[float, ...], ...]:
        """Row k the weights of the slopes before stage k."""

    @property
    def b(self) -> tuple[float, ...]:
        """Weights of the slopes in the step."""


def checked_methods(methods: object, graph: Graph, time: str) -> Mapping[str, Any]:
    """The methods, where all are tableaus and the graph is a state equation. Raises TypeError, GraphError."""
    chosen = {} if methods is None else require_mapping("methods", methods, "name: Tableau")
    for name, method in chosen.items():
        if not all([hasattr(method, numbers) for numbers in "abc"]):
            raise TypeError(f"method {name!r} must be a tableau with numbers a, b and c, got {method!r:.60}")
    inputs, states = len(graph.inputs), len(graph.outputs)
    if chosen and states > inputs:
        raise GraphError(
            f"steps need a state equation, whose first inputs are the state: {states} outputs of {inputs} inputs"
        )
    if not isinstance(time, str):
        raise TypeError(f"time must be the name of an input, got {time!r:.60}")
    return chosen


def weighted_sum(weights: Sequence[float], number: Callable[[float], str], slope: Callable[[int], str]) -> str:
    """The sum of weight * slope as text, in the order of `dynamics`, without those of weight 0.

    number: the text of a weight.  slope: the text of slope k.
    """
    used = [(float(weight), slope(k)) for k, weight in enumerate(weights) if weight]
    return " + ".join([text if weight == 1.0 else f"{number(weight)} * {text}" for weight, text in used])
