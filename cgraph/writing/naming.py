"""Names: several variables at once, operations with a name, names that are not taken, and remarks on a graph."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import chain, count
from typing import NamedTuple

from ..core.checks import check_name
from ..core.graph import Edge, Graph
from ..core.node import Node, as_node, variable


def variables(names: str | Sequence[str]) -> list[Node]:
    """Variables of several names.

    Parameters
    ----------
    names : str or sequence of str
        Names, in one string with spaces or commas between them, or one by one.

    Returns
    -------
    list of Node
        The variables, in this order.

    Raises
    ------
    TypeError
        If it is no string and no sequence of strings.
    ValueError
        If a name cannot be a variable's, see `variable`.

    Examples
    --------
    >>> import cgraph as cg
    >>> cg.variables("q0 q1")
    [<node variable q0>, <node variable q1>]
    """
    if isinstance(names, str):
        split = names.replace(",", " ").split()
        if not split:
            raise ValueError(f"variables needs at least one name, got {names!r}")
        names = split
    elif not isinstance(names, Iterable):
        raise TypeError(f"variables takes names, in a string or a sequence, got {type(names).__name__}: {names!r:.60}")
    return [variable(name) for name in names]


def with_name(node: Node, name: str) -> Node:
    """A copy of an operation with a name, for listings, drawings and explanations.

    Parameters
    ----------
    node : Node
        An operation. A leaf is returned as it is: a variable has its name already, and a constant is shared.
    name : str
        What to call it, up to 1000 printable characters.

    Returns
    -------
    Node
        The copy.

    Raises
    ------
    TypeError
        If the node is neither a node nor a number, or the name is not a string.
    ValueError
        If the name is empty or too long, or has characters that cannot be printed.

    Examples
    --------
    >>> import cgraph as cg
    >>> m, v = cg.variables("m v")
    >>> cg.with_name(m * v, "p")
    <node mul p>
    """
    node, name = as_node(node), check_name("a node", name)
    return Node(node.op, node.args, node.label, name=name) if node.args else node


def free_suffix(suffix: str, taken: Collection[str], names: Sequence[str]) -> str:
    """`suffix`, numbered if need be, so that no name + suffix is taken."""
    known, numbered = set(taken), (f"{suffix}{number}" for number in count(2))
    return next(each for each in chain([suffix], numbered) if known.isdisjoint([name + each for name in names]))


class Remarks(NamedTuple):
    """Remarks on a graph.

    names: {name in the graph: what a person calls it}.  words: a paragraph.  nodes, edges, and outputs by their names:
    to be painted as wrong.
    """

    names: Mapping[str, str]
    words: str = ""
    nodes: Collection[Node] = frozenset()
    edges: Collection[Edge] = frozenset()
    outputs: Collection[str] = ()


def remarked(graph: Graph, remarks: Callable[[Graph], Remarks]) -> Graph:
    """The graph, which from now on has these remarks, made when a drawing asks for them; what is made of it has not."""
    graph.__dict__["_remarks"] = remarks
    return graph


def remarks_of(graph: Graph) -> Remarks:
    """The remarks on a graph, none on most."""
    made: Callable[[Graph], Remarks] | None = graph.__dict__.get("_remarks")
    return made(graph) if made is not None else Remarks({})
