"""The structure hash of a graph: a digest of what it computes, the same in every run, process and machine."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from hashlib import blake2b

from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from ..util.require import require_graph

_SIZE = 16  # bytes of a digest: equal ones by chance need some 2^64 nodes


def structure_hash(graph: Graph) -> str:
    """A digest that two graphs share when they compute the same outputs in the same way, in any process and machine.

    What counts: the names and order of inputs and outputs, and each output's operations, constants to the last bit
    and variables by name. What does not: tags, roles, names of operations, how often equal nodes are repeated, and the
    order of arguments that commute.

    Parameters
    ----------
    graph : Graph
        Any graph.

    Returns
    -------
    str
        32 hexadecimal digits.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.structure_hash(cg.Graph([x, y], {"f": x * y})) == cg.structure_hash(cg.Graph([x, y], {"f": y * x}))
    True
    """
    require_graph("structure_hash", graph)
    digests = node_hashes(graph.nodes)
    parts = [_text(name) for name in graph.input_names]
    parts += [_text(name) + digests[node] for name, node in graph.outputs.items()]
    return _digest(b"graph", struct.pack("<QQ", len(graph.inputs), len(graph.outputs)), *parts).hex()


def node_hashes(nodes: Iterable[Node], atoms: Mapping[Node, str] | None = None) -> dict[Node, bytes]:
    """The digest of every node, in topological order: of its operation and of its arguments' digests.

    atoms: {node: name}, nodes that count as the variable of that name, whatever they compute.
    """
    atoms = atoms or {}
    digests: dict[Node, bytes] = {}
    for node in nodes:
        if node in atoms or node.op is VARIABLE:
            digests[node] = _digest(b"variable", _text(atoms.get(node) or str(node.name)))
        elif node.op is CONSTANT:
            digests[node] = _digest(b"constant", struct.pack("<d", node.value))
        else:
            arguments = [digests[arg] for arg in node.args]
            ordered = sorted(arguments) if node.op.commutative else arguments
            digests[node] = _digest(b"node", _text(node.op.name), *ordered)
    return digests


def _digest(*parts: bytes) -> bytes:
    return blake2b(b"".join(parts[1:]), digest_size=_SIZE, person=parts[0]).digest()


def _text(text: str) -> bytes:
    """A text with its length before it, so that no two sequences of texts read the same."""
    data = text.encode()
    return struct.pack("<Q", len(data)) + data
