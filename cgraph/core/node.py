"""Nodes: constants, named variables, and operations on other nodes."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable
from functools import partial
from itertools import count
from typing import Any, NoReturn, SupportsFloat

import numpy as np

from .checks import check_name
from .html_text import render_html
from .label import INPUT, UNLABELLED, Interned, Label, SourceLine, label
from .row import BY_UFUNC, ROWS, Row
from .scope import current, formulating

VARIABLE, CONSTANT = [Row(name, 0, float, float, lambda *_: ()) for name in ("variable", "constant")]


def _operators(name: str) -> tuple[Callable[[Node, Scalar], Node], Callable[[Node, Scalar], Node]]:
    """The methods of an operation on a node and another operand, and on that and the node."""

    def operate(self: Node, other: Scalar) -> Node:
        return _binary(name, self, other)

    def operate_turned(self: Node, other: Scalar) -> Node:
        return _binary(name, other, self)

    return operate, operate_turned


def _unary(name: str) -> Callable[[Node], Node]:
    return lambda self: apply(ROWS[name], self)


class Node:
    """A node of a computational graph: a constant, a named variable or an operation.

    Fields cannot be assigned, and operation, arguments and value never change; but the `Builder` that made a node may
    widen its label, or give it a first name, when it is to make the same again. Nodes compare and hash by identity.
    Arithmetic with nodes and numbers makes new nodes, kept as written; `<`, `<=`, `>`, `>=` make comparison nodes (1.0
    or 0.0) for `cg.where`; `cg.equal` compares values.

    Attributes
    ----------
    op : Row
        Its row of the operation table; `VARIABLE` or `CONSTANT` for a leaf.
    args : tuple of Node
        Its arguments.
    value : float or None
        The number of a constant.
    name : str or None
        The name of a variable, or the one that `with_name` gave an operation.
    tags : frozenset of str
        Set by `cg.tag`.
    roles : frozenset of str
        "input": a variable; "primal": made outside differentiation; "adjoint", "tangent": by reverse, by forward mode;
        "smooth": a comparison across which value and slope of what it chooses go on, as in a smooth table of `interp`.
    lines : frozenset of SourceLine
        Where it was written, if `cg.recording_lines` was on.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> y = 2.0 * cg.sin(x)
    >>> y, y.args
    (<node mul>, (<node 2.0>, <node sin>))
    """

    __slots__ = ("args", "block", "label", "name", "op", "place")
    op: Row
    args: tuple[Node, ...]
    name: str | None
    label: Label
    block: int  # of the nodes made one after another, 256 a block; they share this object
    place: int  # in its block, below 256: Python keeps an object of each such number
    value: float | None = None

    def __init__(
        self, op: Row, args: tuple[Node, ...] = (), label: Label = UNLABELLED, *, name: str | None = None
    ) -> None:
        _set_op(self, op)
        _set_args(self, args)
        _set_label(self, label)
        _set_name(self, name)
        serial = next(_serials)
        block = _last[0]
        if block != serial >> 8:
            _last[0] = block = serial >> 8
        _set_block(self, block)
        _set_place(self, serial & 255)

    def __setattr__(self, key: str, value: object) -> NoReturn:
        raise AttributeError(f"a Node is immutable: cannot set {key!r}")

    def __delattr__(self, key: str) -> NoReturn:
        raise AttributeError(f"a Node is immutable: cannot delete {key!r}")

    @property
    def serial(self) -> int:
        """Larger than those of all nodes made before, of the arguments too."""
        return self.block << 8 | self.place

    @property
    def tags(self) -> frozenset[str]:
        """Tags given by `cg.tag` where the node, or the node it derives from, was written."""
        return self.label.tags

    @property
    def roles(self) -> frozenset[str]:
        """Among "input", "primal", "adjoint", "tangent", "smooth"; several after a merge or a second derivative."""
        return self.label.roles

    @property
    def lines(self) -> frozenset[SourceLine]:
        """Source lines where the node, or its origin, was written; empty unless `cg.recording_lines` was on."""
        return self.label.lines

    def __repr__(self) -> str:
        if self.op is CONSTANT:
            return f"<node {self.value!r}>"
        inner = f" {self.name}" if self.name is not None else ""
        return f"<node {self.op.name}{inner}>"

    def _repr_html_(self) -> str | None:
        """The formula that a notebook shows, when a drawing package is installed (extra `viz`)."""
        return render_html("node", self)

    def __bool__(self) -> NoReturn:
        raise TypeError("a Node has no truth value before it is evaluated; choose by cg.where, or in data by cg.interp")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Node) and formulating.get() and isinstance(other, numbers.Real):
            raise TypeError(
                "a Node equals no number before it is evaluated; cg.equal compares values, cg.where chooses"
            )
        return True if self is other else NotImplemented

    __hash__ = object.__hash__

    def __float__(self) -> float:
        if self.value is None:
            raise TypeError(f"{self!r} has no value before it is evaluated; cg.cos, cg.where, cg.interp, .. take nodes")
        return self.value

    def __copy__(self) -> Node:
        return self

    def __deepcopy__(self, memo: object) -> Node:
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError("pickle a cg.Graph, not a Node: a node alone does not say which inputs it has")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """`np.sin(node)`, `np.float64(2) * node`, and element by element for arrays of nodes."""
        if ufunc in _TURNED:
            ufunc, inputs = _TURNED[ufunc], inputs[::-1]
        op = BY_UFUNC.get(ufunc) or BY_UFUNC.get(ufunc.__name__)
        if op is None or method != "__call__" or kwargs:
            return NotImplemented
        return elementwise(op, *inputs)

    # Operators look the row up by name, so that the table stays the one place that knows operations.
    __add__, __radd__ = _operators("add")
    __sub__, __rsub__ = _operators("sub")
    __mul__, __rmul__ = _operators("mul")
    __truediv__, __rtruediv__ = _operators("div")
    __pow__, __rpow__ = _operators("pow")
    __lt__, __gt__ = _operators("less")
    __le__, __ge__ = _operators("less_equal")
    __neg__, __abs__, __floor__, __ceil__, __round__ = map(_unary, ("neg", "abs", "floor", "ceil", "round"))
    __pos__ = __copy__


class Leaf(Node):
    """A constant or a variable, of which there is one for each number or name: a weak table finds it."""

    __slots__ = ("__weakref__", "value")

    def __init__(
        self, op: Row, label: Label = UNLABELLED, *, value: float | None = None, name: str | None = None
    ) -> None:
        super().__init__(op, (), label, name=name)
        object.__setattr__(self, "value", value)


Leaf.__name__ = Node.__name__  # messages name what a user knows
# The setters of the fields, which Node.__setattr__ does not stop; in half the time of object.__setattr__.
_set_args, _set_block, _set_label, _set_name, _set_op, _set_place = [vars(Node)[f].__set__ for f in Node.__slots__]
_serials, _last = count(), [0]  # and the block of the last node, whose object those of the same block share
Scalar = Node | float
_constants: Interned[tuple[float, float], Node] = Interned()
_variables: Interned[str, Node] = Interned()


def constant(value: SupportsFloat) -> Node:
    """The node of a number; equal numbers share one node, and 0.0 and -0.0 stay apart.

    Parameters
    ----------
    value : float
        A real number, finite or infinite.

    Returns
    -------
    Node
        The constant.

    Raises
    ------
    TypeError
        If it is not a real number.
    ValueError
        If it is NaN or too large for float64.

    Examples
    --------
    >>> import cgraph as cg
    >>> cg.constant(2)
    <node 2.0>
    """
    if type(value) is not float:
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value.item()
        if not isinstance(value, numbers.Real):
            raise TypeError(f"expected a Node or a real number, got {type(value).__name__}: {value!r:.60}")
        try:
            value = float(value)
        except OverflowError:
            raise ValueError(f"a constant must fit float64, got {value!r:.20}...") from None
    if value != value:
        raise ValueError("a constant must not be NaN")
    key = (value, math.copysign(1.0, value))
    node = _constants.get(key)
    return _constants.get_or_make(key, lambda: Leaf(CONSTANT, value=value)) if node is None else node


def variable(name: str) -> Node:
    """The variable of a name; asking twice gives the same node.

    Parameters
    ----------
    name : str
        Up to 1000 printable characters without white space; a label, which need not be an identifier of any language.

    Returns
    -------
    Node
        The variable.

    Raises
    ------
    TypeError
        If the name is not a string.
    ValueError
        If it is empty or too long, or has white space or characters that cannot be printed.

    Examples
    --------
    >>> import cgraph as cg
    >>> cg.variable("q0")
    <node variable q0>
    """
    node = _variables.get(name) if type(name) is str else None
    if node is None:
        name = check_name("a variable", name, spaces=False)
        node = _variables.get_or_make(name, lambda: Leaf(VARIABLE, label(roles=frozenset({INPUT})), name=name))
    return node


def as_node(value: Scalar) -> Node:
    """The node itself, or the constant of a number.

    >>> from cgraph.extend import as_node
    >>> as_node(1.0)
    <node 1.0>
    """
    return value if isinstance(value, Node) else constant(value)


def named_node(what: str, value: Scalar) -> Node:
    """The node of a value, as of `as_node`; an error says what the value is."""
    try:
        return as_node(value)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{what}: {error}") from None


def apply(op: Row, *args: Scalar) -> Node:
    """A new node of this operation, built as the current scope says."""
    if len(args) != op.arity:
        raise TypeError(f"{op.name} takes {op.arity} argument(s), got {len(args)}")
    return _built(op, tuple([arg if isinstance(arg, Node) else constant(arg) for arg in args]))


def _built(op: Row, args: tuple[Node, ...]) -> Node:
    scope = current.get()
    node: Node = (scope.build or Node)(op, args, scope.label)
    return node


def _binary(name: str, a: Scalar, b: Scalar) -> Node:
    if type(b) is float:
        b = constant(b)
    elif type(a) is float:
        a = constant(a)
    if isinstance(a, Node) and isinstance(b, Node):
        return _built(ROWS[name], (a, b))
    for operand in (a, b):
        if not isinstance(operand, (Node, numbers.Real, np.ndarray)):
            return NotImplemented  # type: ignore[no-any-return]  # Python then asks the other operand, or raises
    node: Node = elementwise(ROWS[name], a, b)
    return node


_TURNED = {np.greater: np.less, np.greater_equal: np.less_equal}  # a > b is b < a


def elementwise(op: Row, *args: Any) -> Any:
    """A node; or an array of nodes, when an argument is an array with dimensions."""
    if any([isinstance(each, np.ndarray) and each.ndim for each in args]):
        return np.frompyfunc(partial(apply, op), op.arity, 1)(*[np.asarray(each, dtype=object) for each in args])
    return apply(op, *[each.item() if isinstance(each, np.ndarray) else each for each in args])
