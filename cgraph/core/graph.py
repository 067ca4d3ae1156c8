"""The graph: named inputs to named outputs, and the nodes that the outputs reach."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from .check import check
from .checks import GraphError, check_name
from .counts import Counts, count
from .evaluation import Value, evaluate
from .html_text import render_html
from .inputs import chosen_inputs, input_values
from .listing import listing
from .node import VARIABLE, Node, Scalar, as_node
from .traversal import rebuild, topological


class Edge(NamedTuple):
    """One use of a node by another.

    Attributes
    ----------
    source, target : Node
        The argument, and the operation that uses it.
    slot : int
        Which argument of the target it is, from 0.
    partial : Node
        d target / d source through this slot alone.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.Edge(x, x * y, 0).partial
    <node variable y>
    """

    source: Node
    target: Node
    slot: int

    @property
    def partial(self) -> Node:
        """d target / d source through this slot alone, as a node."""
        return as_node(self.target.op.partials(self.target, *self.target.args)[self.slot])


class Graph:
    """A computational graph from named inputs to named outputs.

    Parameters
    ----------
    inputs : sequence of Node
        Variables, in the order in which arrays of values are read; they may be unused.
    outputs : mapping of str to Node or float
        {name: node}, in the order in which arrays of results are written.

    Attributes
    ----------
    inputs, outputs : tuple of Node, dict of str to Node
        The variables, and the results.
    nodes : tuple of Node
        All nodes that the outputs reach, arguments first.

    Raises
    ------
    GraphError
        If there are no outputs, an input is repeated, or an output needs a variable that is not an input.
    TypeError
        If an input is not a variable, an output is not a node, or its name is not a string.
    ValueError
        If an output's name is empty or too long, or has characters that cannot be printed.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> graph = cg.Graph([x, y], {"r": cg.sqrt(x * x + y * y)})
    >>> graph
    <Graph (x, y) -> (r): 6 nodes, 7 edges>
    >>> graph.evaluate({"x": 3.0, "y": 4.0})
    {'r': 5.0}
    """

    inputs: tuple[Node, ...]
    outputs: dict[str, Node]
    nodes: tuple[Node, ...]

    def __init__(self, inputs: Sequence[Node], outputs: Mapping[str, Scalar]) -> None:
        self.inputs = _checked_inputs(inputs)
        self.outputs = _checked_outputs(outputs)
        self.nodes = tuple(topological(self.outputs.values()))
        known = set(self.inputs)
        if free := [node.name for node in self.nodes if node.op is VARIABLE and node not in known]:
            listed = ", ".join(repr(name) for name in sorted(map(str, free)))
            names = ", ".join(self.input_names) or "none"
            raise GraphError(f"the outputs need {listed}, not among the inputs ({names})")

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs, in order."""
        return tuple([str(node.name) for node in self.inputs])

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """The uses of nodes by others, in the order of `nodes`."""
        return tuple([Edge(arg, node, slot) for node in self.nodes for slot, arg in enumerate(node.args)])

    def select_inputs(self, wrt: str | Node | Sequence[str | Node] | None) -> tuple[Node, ...]:
        """The inputs that `wrt` names, by a name or a variable or several; None for all.

        Raises GraphError if the graph has no such input or one is named twice, TypeError for anything else.
        """
        return self.inputs if wrt is None else chosen_inputs(self.inputs, wrt)

    def only_output(self) -> Node:
        """The one output. Raises GraphError if there are several."""
        if len(self.outputs) != 1:
            raise GraphError(f"this needs a graph with one output, got {len(self.outputs)}: {', '.join(self.outputs)}")
        return next(iter(self.outputs.values()))

    def __call__(self, *args: Scalar, **named: Scalar) -> dict[str, Node]:
        """The outputs as nodes, with nodes or numbers in place of the inputs, in order or by name."""
        if len(args) > len(self.inputs):
            raise TypeError(f"the graph has {len(self.inputs)} inputs, got {len(args)} arguments")
        replace = dict(zip(self.inputs, map(as_node, args), strict=False))
        for name, value in named.items():
            (node,) = self.select_inputs(name)
            if node in replace:
                raise TypeError(f"input {name!r} is given twice")
            replace[node] = as_node(value)
        if missing := [str(node.name) for node in self.inputs if node not in replace]:
            raise TypeError(f"no value for input {', '.join(missing)}")
        new = rebuild(self.outputs.values(), replace, lambda n, args: Node(n.op, args, n.label, name=n.name))
        return {name: new[node] for name, node in self.outputs.items()}

    def evaluate(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Values of the outputs, in IEEE float64: out of a function's domain NaN or infinite, without an error.

        Parameters
        ----------
        values : mapping of str to float or array
            A value for every input; arrays broadcast.

        Returns
        -------
        dict of str to float or ndarray
            Floats where every input is a number, else arrays of the common shape.

        Raises
        ------
        GraphError, TypeError
            If an input is missing or unknown, or shapes do not broadcast; and if a value is not real.
        """
        return evaluate(self.nodes, self.outputs, input_values(self.input_names, values))

    def values(self, values: Mapping[str, Value]) -> dict[Node, Value]:
        """{node: its value} of all nodes. Takes and raises what `evaluate` does."""
        found = Graph(self.inputs, {str(k): node for k, node in enumerate(self.nodes)}).evaluate(values)
        return dict(zip(self.nodes, found.values(), strict=True))

    def counts(self) -> Counts:
        """Nodes, edges, depth, width, and nodes by operation, tag and role."""
        return count(self.nodes)

    def listing(self) -> str:
        """The graph as text, a node a line, the same in every run."""
        return listing(self.input_names, self.nodes, self.outputs)

    def check(self) -> None:
        """Raise GraphError unless every node is well formed and the order is topological."""
        check(self.nodes, self.outputs)

    def __repr__(self) -> str:
        ends, edges = map(_short, (self.input_names, tuple(self.outputs))), sum(len(node.args) for node in self.nodes)
        return f"<Graph ({') -> ('.join(ends)}): {len(self.nodes)} nodes, {edges} edges>"

    def _repr_html_(self) -> str | None:
        """The drawing that a notebook shows, when a drawing package is installed (extra `viz`)."""
        return render_html("graph", self)


def _checked_inputs(inputs: Sequence[Node]) -> tuple[Node, ...]:
    if isinstance(inputs, Node) or not isinstance(inputs, Iterable):
        raise TypeError(f"inputs must be a sequence of variables, got {inputs!r:.60}; write [x]")
    nodes = tuple(inputs)
    if wrong := [node for node in nodes if not isinstance(node, Node) or node.op is not VARIABLE]:
        raise TypeError(f"an input must be a variable, got {wrong[0]!r:.60}")
    if twice := [name for name, count in Counter([node.name for node in nodes]).items() if count > 1]:
        raise GraphError(f"input {twice[0]!r} is listed more than once")
    return nodes


def _checked_outputs(outputs: Mapping[str, Scalar]) -> dict[str, Node]:
    if not isinstance(outputs, Mapping):
        raise TypeError(f"outputs must map names to nodes, got {type(outputs).__name__}")
    if not outputs:
        raise GraphError("a graph needs at least one output")
    nodes = {}
    for name, value in outputs.items():
        name = check_name("an output", name)
        try:
            nodes[name] = as_node(value)
        except TypeError as error:
            raise TypeError(f"output {name!r}: {error}") from None
    return nodes


def _short(names: Sequence[str]) -> str:
    return ", ".join(names if len(names) <= 6 else [*names[:3], "...", names[-1]])
