"""What an inspector shows: graphs that are versions of one another, a motion, tables."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cgraph import Graph, Node
from cgraph.extend import real_array

Array = np.ndarray[Any, np.dtype[np.float64]]
UNKNOWN = 0.5  # an input's value where none is given: a product with 0 would show nothing


@dataclass(frozen=True, eq=False)
class Version:
    """One of the graphs that the page switches among, and what to see in it.

    about: a sentence or two.  marked: nodes in the one color of what is wrong.
    at: {input: value (T,) along the motion, or one number}; an input without a value is `UNKNOWN`.
    """

    name: str
    graph: Graph
    about: str = ""
    marked: Collection[Node] = frozenset()
    at: Mapping[str, Any] = field(default_factory=dict)

    def rows(self, length: int) -> Array:
        """Values of the inputs, (length, number of inputs).

        Raises ValueError for a name that is no input, values that are not finite, or another length.
        """
        names = self.graph.input_names
        if unknown := [name for name in self.at if name not in names]:
            raise ValueError(f"version {self.name!r} has values for {unknown[0]!r}, which is not an input of its graph")
        if strange := set(self.marked) - set(self.graph.nodes):
            raise ValueError(f"version {self.name!r}: {next(iter(strange))!r} is marked, but not in its graph")
        table = np.full((length, len(names)), UNKNOWN)
        for i, name in enumerate(names):
            value = real_array(f"version {self.name!r}: input {name!r}", self.at.get(name, UNKNOWN))
            if value.shape not in ((), (length,)) or not np.isfinite(value).all():
                raise ValueError(
                    f"version {self.name!r}: input {name!r} needs one finite number or {length} of them, "
                    f"got shape {value.shape}"
                )
            table[:, i] = value
        return table


@dataclass(frozen=True, eq=False)
class Motion:
    """The instants that the page plays, and points that move, drawn beside the graph as sticks.

    t: (T,) [s].  points: (T, k, 2) [m], x to the right, y up, or None.  parents: (k,), the point each hangs on, or -1.
    """

    t: Array
    points: Array | None = None
    parents: Sequence[int] = ()

    def check(self) -> None:
        """Raises ValueError for shapes that do not fit, or values that are not finite."""
        if self.t.ndim != 1 or not len(self.t) or not np.isfinite(self.t).all():
            raise ValueError(f"a motion needs instants t (T,) that are finite, got shape {self.t.shape}")
        if self.points is None:
            return
        wanted = (len(self.t), len(self.parents), 2)
        if self.points.shape != wanted or not self.parents or not np.isfinite(self.points).all():
            raise ValueError(f"a motion needs finite points (T, k, 2) = {wanted}, got shape {self.points.shape}")
        if any(not -1 <= parent < i for i, parent in enumerate(self.parents)):
            raise ValueError(f"parents must be -1 or an earlier point, got {list(self.parents)}")


@dataclass(frozen=True)
class Table:
    """Texts in rows, below the graph; the first column is read to the left, the others to the right."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
