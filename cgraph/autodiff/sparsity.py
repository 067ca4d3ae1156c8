"""Sparsity: which entries of a graph's Jacobian can be other than zero, known from the graph alone, and their nodes."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.builder import Builder
from ..core.forward import tangents
from ..core.graph import Graph
from ..core.node import Node, as_node, variable
from ..core.reverse import cotangents
from ..core.row import Row
from ..core.scope import building
from ..util.caches import OPERATIONS, memo
from ..util.extras import required
from ..util.require import require_graph

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Indices = NDArray[np.int64]
Indices32 = NDArray[np.int32]


class Pattern(NamedTuple):
    """Entries of a matrix, row by row and in each row from left to right.

    rows, columns: of the entries.  shape: of the matrix.
    """

    rows: Indices
    columns: Indices
    shape: tuple[int, int]

    def compressed(self) -> tuple[Indices32, Indices32]:
        """The columns of the entries, and where in them each row begins: SciPy's form of sparse rows."""
        starts = np.searchsorted(self.rows, np.arange(self.shape[0] + 1))
        return self.columns.astype(np.int32), starts.astype(np.int32)

    def by_row(self) -> list[list[int]]:
        """The columns of the entries in each row."""
        return _grouped(self.columns, self.rows, self.shape[0])

    def by_column(self) -> list[list[int]]:
        """The rows of the entries in each column."""
        order = np.lexsort((self.rows, self.columns))
        return _grouped(self.rows[order], self.columns[order], self.shape[1])


def _grouped(values: Indices, keys: Indices, count: int) -> list[list[int]]:
    """The values of each key 0 .. count - 1; keys ascend."""
    ends = np.searchsorted(keys, np.arange(count + 1)).tolist()
    flat = values.tolist()
    return [flat[begin:end] for begin, end in itertools.pairwise(ends)]


def sparsity(graph: Graph, wrt: str | Node | Sequence[str | Node] | None = None) -> csr_array:
    """Pattern of the Jacobian of a graph: entries that can be other than zero, whatever the values of the inputs.

    An entry that is left out is zero everywhere: no path leads from the input to the output, or each one passes an
    operation with the slope 0, such as `floor`. An entry that is there may be zero too, at some points or, where terms
    cancel, at all.

    Parameters
    ----------
    graph : Graph
        x (n) -> y (m).
    wrt : str, Node or sequence of these, optional
        The inputs x to differentiate by; by default all.

    Returns
    -------
    scipy.sparse.csr_array of bool, shape (m, n)
        True at the entries that can be other than zero; the indices of a row ascend.

    Raises
    ------
    GraphError
        If the graph has no such input.
    ImportError
        Without SciPy (extra `scipy`).

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y, z = cg.variables("x y z")
    >>> cg.sparsity(cg.Graph([x, y, z], {"f": x * y, "g": cg.sin(z), "h": cg.floor(x)})).toarray().astype(int)
    array([[1, 1, 0],
           [0, 0, 1],
           [0, 0, 0]])
    """
    require_graph("sparsity", graph)
    sparse = required("scipy.sparse", "sparsity needs SciPy", "scipy")
    entries = pattern(graph, graph.select_inputs(wrt))
    found: csr_array = sparse.csr_array(
        (np.ones(len(entries.rows), dtype=bool), *entries.compressed()), shape=entries.shape
    )
    return found


def pattern(graph: Graph, wrt: Sequence[Node]) -> Pattern:
    """The entries of the Jacobian by `wrt` that are not structurally zero."""
    outputs = set(graph.outputs.values())
    kept = {node: bits for node, bits in dependence(graph, wrt) if node in outputs}
    rows = [_places(kept[node]) for node in graph.outputs.values()]
    places = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    return Pattern(places, np.concatenate(rows), (len(rows), len(wrt)))


def dependence(graph: Graph, wrt: Sequence[Node]) -> Iterator[tuple[Node, int]]:
    """Every node, arguments first, and the inputs that it depends on, as the bits of an integer."""
    place = {node: j for j, node in enumerate(wrt)}
    uses = Counter([arg for node in graph.nodes for arg in node.args])
    bits: dict[Node, int] = {}
    for node in graph.nodes:
        depends = 1 << place[node] if node in place else 0
        for arg in slopes(node):
            depends |= bits[arg]
        yield node, depends
        bits[node] = depends
        for arg in node.args:  # a set is kept until its last use
            uses[arg] -= 1
            if not uses[arg]:
                del bits[arg]


def symmetric(entries: Pattern) -> Pattern:
    """The entries and their mirror images."""
    if full(entries):
        return entries
    i, j = np.concatenate([entries.rows, entries.columns]), np.concatenate([entries.columns, entries.rows])
    n = entries.shape[1]
    rows, columns = np.divmod(np.unique(i * n + j), max(n, 1))
    return Pattern(rows, columns, entries.shape)


def full(entries: Pattern) -> bool:
    """Whether no entry is left out."""
    return len(entries.rows) == entries.shape[0] * entries.shape[1]


def _places(bits: int) -> Indices:
    """The places of the bits that are set, from the lowest."""
    if not bits:
        return np.zeros(0, dtype=np.int64)
    lowest = (bits & -bits).bit_length() - 1
    bits >>= lowest
    octets = np.frombuffer(bits.to_bytes(-(-bits.bit_length() // 8), "little"), dtype=np.uint8)
    return lowest + np.flatnonzero(np.unpackbits(octets, bitorder="little"))


def slopes(node: Node) -> Collection[Node]:
    """The arguments in which a node's partial derivative is not the constant zero."""
    if not node.args:
        return ()
    special = any([arg.value is not None for arg in node.args])
    return [node.args[slot] for slot in (_sloping_slots(node) if special else _usual_slots(node.op))]


def _sloping_slots(node: Node) -> list[int]:
    """The slots in which a node has a slope."""
    with building(Builder()):
        partials = [as_node(each) for each in node.op.partials(node, *node.args)]
    return [slot for slot, partial in enumerate(partials) if partial.value != 0.0]


@memo(OPERATIONS)
def _usual_slots(op: Row) -> list[int]:
    """The slots in which an operation on variables has a slope."""
    return _sloping_slots(Node(op, tuple([variable(f"argument{slot}#") for slot in range(op.arity)])))


def written_sizes(graph: Graph, wrt: Sequence[Node]) -> tuple[int, int, int]:
    """Operations to differentiate: once, in all sweeps over columns, and in all sweeps over rows."""
    once = columns = rows = 0
    active: set[Node] = set()
    for node, bits in dependence(graph, wrt):
        if bits and node.args:
            active.add(node)
            once, columns = once + 1, columns + bits.bit_count()
    reached: dict[Node, int] = {}
    for i, node in enumerate(graph.outputs.values()):
        reached[node] = reached.get(node, 0) | 1 << i
    for node in reversed(graph.nodes):
        bits = reached.pop(node, 0)
        if bits and node in active:
            rows += bits.bit_count()
            for arg in slopes(node):
                reached[arg] = reached.get(arg, 0) | bits
    return once, columns, rows


def entry_graph(graph: Graph, wrt: Sequence[Node], entries: Pattern, by_row: bool) -> Graph:
    """x -> the entries of the Jacobian by `wrt`, in their order: a sweep a row or a column, over what it reaches."""
    zero, one, build = as_node(0.0), as_node(1.0), Builder()
    outputs = list(graph.outputs.values())
    values: dict[tuple[int, int], Node] = {}
    if by_row:
        for i, row in enumerate(entries.by_row()):
            bars = cotangents({outputs[i]: one}, [wrt[j] for j in row], build) if row else []
            values |= {(i, j): bar for j, bar in zip(row, bars, strict=True)}
    else:
        for j, column in enumerate(entries.by_column()):
            dots = tangents({wrt[j]: one}, [outputs[i] for i in column], build)
            values |= {(i, j): dots.get(outputs[i], zero) for i in column}
    order = zip(entries.rows.tolist(), entries.columns.tolist(), strict=True)
    return Graph(graph.inputs, {f"e{k}": values[place] for k, place in enumerate(order)})
