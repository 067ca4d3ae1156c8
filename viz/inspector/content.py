"""Contents of an inspector: graphs that are versions of one another, their one state, a motion, tables."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cgraph import Edge, Graph, Node
from cgraph._shared import Array, real_array

UNKNOWN = 0.5  # an input's value where none is given: a product with 0 would show nothing


class Step(NamedTuple):
    """A step of what the page explains.  words: what is done.  nodes: computed in it.  value: its result.

    joint: the number of the velocity that it is about, whose joint the picture of the motion shows; -1 for none.
    """

    words: str
    nodes: Sequence[Node]
    value: Node
    joint: int = -1


@dataclass(frozen=True, eq=False)
class Version:
    """One of the graphs that the page switches among.

    about: a sentence or two.  marked, blamed: nodes and edges in the color of what is wrong.  off: wrong outputs.
    steps: to be gone through one by one.  rows: {title: nodes} of the rows from the bottom; default the sweeps.
    flawed: whether the version is wrong.  excess: a graph of what its outputs have too much.
    group: versions of one share a picture and its places.
    """

    name: str
    graph: Graph
    about: str = ""
    marked: Collection[Node] = frozenset()
    steps: Sequence[Step] = ()
    rows: Mapping[str, Collection[Node]] = field(default_factory=dict)
    blamed: Collection[Edge] = frozenset()
    flawed: bool = False
    off: Collection[str] = ()
    excess: Graph | None = None
    group: str = ""

    def check(self) -> None:
        """Raises ValueError for a marked node, or one of a step, that is not in the graph."""
        known = set(self.graph.nodes)
        if unknown := [name for name in self.off if name not in self.graph.outputs]:
            raise ValueError(f"version {self.name!r}: {unknown[0]!r} is off, but no output of its graph")
        stepped = {node for step in self.steps for node in (*step.nodes, step.value)}
        for what, nodes in (("marked", set(self.marked)), ("in a step", stepped)):
            if strange := nodes - known:
                raise ValueError(f"version {self.name!r}: {next(iter(strange))!r} is {what}, but not in its graph")


@dataclass(frozen=True, eq=False)
class State:
    """The one state of all versions: values of inputs, and how to compute the inputs that only some versions have.

    at: {input: value (T,) along the motion, or one number}; an input without a value is `UNKNOWN`.
    derived: a graph from inputs of the state to inputs of versions, such as q0_old = q0 - dt qd0; these have no value.
    """

    at: Mapping[str, float | Array]
    derived: Graph | None = None

    def inputs(self, graphs: Sequence[Graph]) -> list[str]:
        """Names of the inputs whose values the state holds: all inputs of the graphs but the derived ones.

        Raises ValueError for a derived name that is no input of any graph, and a value for what is not in the state.
        """
        computed = set(self.derived.outputs) if self.derived is not None else set()
        needed = dict.fromkeys([name for graph in graphs for name in graph.input_names])
        if strange := computed - set(needed):
            raise ValueError(f"{min(strange)!r} is derived, but is no input of any version")
        first = self.derived.input_names if self.derived is not None else ()
        names = [name for name in dict.fromkeys([*first, *needed]) if name not in computed]
        if unknown := [name for name in self.at if name not in names]:
            raise ValueError(f"there is a value for {unknown[0]!r}, which is not an input of any version")
        return names

    def rows(self, names: Sequence[str], length: int) -> Array:
        """Values of the inputs of these names, (length, number of names).

        Raises ValueError for values that are not finite, or of another length.
        """
        table = np.full((length, len(names)), UNKNOWN)
        for i, name in enumerate(names):
            value = real_array(f"input {name!r}", self.at.get(name, UNKNOWN))
            if value.shape not in ((), (length,)) or not np.isfinite(value).all():
                raise ValueError(f"input {name!r} needs one finite number or {length} of them, got shape {value.shape}")
            table[:, i] = value
        return table


@dataclass(frozen=True, eq=False)
class Motion:
    """The instants that the page plays, and points that move, drawn beside the graph as sticks.

    t: (T,) [s].  points: (T, k, 2) [m], x to the right, y up, or None.  parents: (k,), the point each hangs on, or -1.
    places: the points as a graph, outputs x0, y0, x1, ..  joints: for every velocity the point of its joint.
    turns: 1 counterclockwise, -1 clockwise, 0 for no turn.  radii: of spheres [m].
    surfaces: (T, m, 2) [m]: center and a mark of each sphere, then a point and two directions of each plane.
    """

    t: Array
    points: Array | None = None
    parents: Sequence[int] = ()
    places: Graph | None = None
    joints: Sequence[int] = ()
    turns: Sequence[int] = ()
    radii: Sequence[float] = ()
    surfaces: Array | None = None

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
        if any(not 0 <= joint < len(self.parents) for joint in self.joints):
            raise ValueError(f"joints must be points, 0 to {len(self.parents) - 1}, got {list(self.joints)}")
        if self.turns and (len(self.turns) != len(self.joints) or set(self.turns) - {-1, 0, 1}):
            raise ValueError(f"turns must be 1, -1 or 0 for {len(self.joints)} joints, got {list(self.turns)}")
        surfaces = np.zeros((len(self.t), 0, 2)) if self.surfaces is None else self.surfaces
        m = surfaces.shape[1] if surfaces.ndim == 3 else 0
        planes = m - 2 * len(self.radii)
        if surfaces.shape != (len(self.t), m, 2) or planes < 0 or planes % 3 or not np.isfinite(surfaces).all():
            needed = f"m two for each of {len(self.radii)} spheres and three for each plane"
            raise ValueError(f"surfaces must be finite (T, m, 2), {needed}, got shape {surfaces.shape}")
        wanted_names = [f"{axis}{i}" for i in range(len(self.parents) + m) for axis in "xy"]
        if self.places is not None and list(self.places.outputs) != wanted_names:
            raise ValueError(f"places must have the outputs x0, y0, .. of {len(self.parents) + m} points")


@dataclass(frozen=True, eq=False)
class StateTable:
    """A table of numbers that follow the state: outputs of a graph of its inputs.

    header: of the columns of numbers.  rows: {name of an output of the versions: outputs of the graph, a column each}.
    """

    caption: str
    graph: Graph
    header: Sequence[str]
    rows: Mapping[str, Sequence[str]]

    def check(self, state: Sequence[str]) -> None:
        """Raises ValueError for an input that is not in the state, and a row that does not fit header and graph."""
        if unknown := [name for name in self.graph.input_names if name not in state]:
            raise ValueError(f"table {self.caption!r}: {unknown[0]!r} is not an input of the state")
        for row, outputs in self.rows.items():
            if len(outputs) != len(self.header) or set(outputs) - set(self.graph.outputs):
                raise ValueError(
                    f"table {self.caption!r}: row {row!r} needs {len(self.header)} outputs of its graph, got {outputs}"
                )
