"""Names of nodes: several variables at once, operations with a name, and names that are not taken."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from .node import Node, as_node, variable


def variables(names: str | Sequence[str]) -> list[Node]:
    """Several variables.

    Parameters
    ----------
    names : str or sequence of str
        Names, in one string with spaces or commas between them, or one by one.

    Returns
    -------
    list of Node
        The variables, in this order.

    Examples
    --------
    >>> import cgraph as cg
    >>> cg.variables("q0 q1")
    [<node variable q0>, <node variable q1>]
    """
    split = names.replace(",", " ").split() if isinstance(names, str) else names
    return [variable(name) for name in split]


def with_name(node: Node, name: str) -> Node:
    """A copy of an operation with a name, for listings, drawings and explanations.

    Parameters
    ----------
    node : Node
        An operation. A leaf is returned as it is: a variable has its name already, and a constant is shared.
    name : str
        What to call it.

    Returns
    -------
    Node
        The copy.

    Examples
    --------
    >>> import cgraph as cg
    >>> m, v = cg.variables("m v")
    >>> cg.with_name(m * v, "p")
    <node mul p>
    """
    node = as_node(node)
    return Node(node.op, node.args, node.label, name=name) if node.args else node


def free_suffix(suffix: str, taken: Collection[str], names: Sequence[str]) -> str:
    """`suffix`, numbered if need be, so that no name + suffix is taken."""
    candidate, number = suffix, 1
    while any(name + candidate in taken for name in names):
        number += 1
        candidate = f"{suffix}{number}"
    return candidate
