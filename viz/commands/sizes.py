"""Sizes of both forms of the equations of motion: nodes, edges, depth and width, as a table and as data."""

from __future__ import annotations

from collections.abc import Mapping

from cgraph import Graph
from dynamics.equations.both_forms import HAMILTON, LAGRANGE, VELOCITIES_ALONE, form_sizes
from dynamics.experiments.text_table import table

SIZES = ("nodes", "edges", "depth", "width")
WORDS = {
    LAGRANGE: f"{LAGRANGE}, of (q, qd)",
    HAMILTON: f"{HAMILTON}, of (q, p), p = dL/dqd",
    VELOCITIES_ALONE: f"  the {VELOCITIES_ALONE}",
}


def size_data(forms: Mapping[str, Graph]) -> dict[str, dict[str, int]]:
    """{name of a form: {"nodes": .., "edges": .., "depth": .., "width": ..}}.  forms: as of `both_forms`."""
    return {name: {size: getattr(counts, size) for size in SIZES} for name, counts in form_sizes(forms).items()}


def size_table(sizes: Mapping[str, Mapping[str, int]]) -> str:
    """A line for each form of `size_data`, under a header."""
    return "\n".join(table(("", *SIZES), [(WORDS[name], *map(str, each.values())) for name, each in sizes.items()]))
