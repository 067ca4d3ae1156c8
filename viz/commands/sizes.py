"""Sizes of both forms of the equations of motion: nodes, edges, depth and width, as a table and as data."""

from __future__ import annotations

from collections.abc import Mapping

import cgraph as cg

from . import library

SIZES = ("nodes", "edges", "depth", "width")


def size_data(forms: Mapping[str, cg.Graph]) -> dict[str, dict[str, int]]:
    """{name of a form: {"nodes": .., "edges": .., "depth": .., "width": ..}}.  forms: as of `both_forms`."""
    return {name: {size: getattr(counts, size) for size in SIZES} for name, counts in library.form_sizes(forms).items()}


def size_table(sizes: Mapping[str, Mapping[str, int]]) -> str:
    """A line for each form of `size_data`, under a header."""
    words = {
        library.LAGRANGE: f"{library.LAGRANGE}, of (q, qd)",
        library.HAMILTON: f"{library.HAMILTON}, of (q, p), p = dL/dqd",
        library.VELOCITIES_ALONE: f"  the {library.VELOCITIES_ALONE}",
    }
    rows = [(words[name], *map(str, each.values())) for name, each in sizes.items()]
    return "\n".join(library.table(("", *SIZES), rows))
