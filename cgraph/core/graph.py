"""The graph: named inputs to named outputs, and the nodes that the outputs reach; and what a notebook shows of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from .checks import GraphError, check_name
from .evaluation import Value, evaluate, input_values
from .html_text import html_table, render_html
from .node import CONSTANT, VARIABLE, Node, Scalar, as_node, variable
from .row import ROWS, Row
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


@dataclass(frozen=True)
class Counts:
    """Sizes of a graph; leaves (inputs and constants) count as nodes. `str` of it is a table.

    Attributes
    ----------
    nodes, edges : int
        How many; an edge is one use of a node by another.
    depth : int
        Operations on the longest path.
    width : int
        The largest number of nodes at one distance from the leaves.
    by_operation, by_tag, by_role : dict of str to int
        Numbers of nodes, the largest first.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> counts = cg.Graph([x], {"y": x * cg.sin(x)}).counts()
    >>> counts.nodes, counts.edges, counts.depth
    (3, 3, 2)
    """

    nodes: int
    edges: int
    depth: int
    width: int
    by_operation: dict[str, int]
    by_tag: dict[str, int]
    by_role: dict[str, int]

    def __str__(self) -> str:
        lines = [f"nodes {self.nodes}, edges {self.edges}, depth {self.depth}, width {self.width}"]
        for group, counts in self._groups.items():
            listed = ", ".join(f"{name} {n}" for name, n in counts.items())
            lines.append(f"{f'by {group}':13}{listed or '-'}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        sizes = [(name, str(getattr(self, name))) for name in ("nodes", "edges", "depth", "width")]
        rows = [(f"{group} {name}", str(n)) for group, counts in self._groups.items() for name, n in counts.items()]
        return html_table(("", "count"), sizes + rows)

    @property
    def _groups(self) -> dict[str, dict[str, int]]:
        return {"operation": self.by_operation, "tag": self.by_tag, "role": self.by_role}


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
        if isinstance(inputs, Node) or not isinstance(inputs, Iterable):
            raise TypeError(f"inputs must be a sequence of variables, got {inputs!r:.60}; write [x]")
        self.inputs = tuple(inputs)
        if wrong := [node for node in self.inputs if not isinstance(node, Node) or node.op is not VARIABLE]:
            raise TypeError(f"an input must be a variable, got {wrong[0]!r:.60}")
        if twice := [name for name, count in Counter([node.name for node in self.inputs]).items() if count > 1]:
            raise GraphError(f"input {twice[0]!r} is listed more than once")
        if not isinstance(outputs, Mapping):
            raise TypeError(f"outputs must map names to nodes, got {type(outputs).__name__}")
        if not outputs:
            raise GraphError("a graph needs at least one output")
        self.outputs = {}
        for name, value in outputs.items():
            name = check_name("an output", name)
            try:
                self.outputs[name] = as_node(value)
            except TypeError as error:
                raise TypeError(f"output {name!r}: {error}") from None
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
        if wrt is None:
            return self.inputs
        if not isinstance(wrt, (str, Node, Iterable)):
            raise TypeError(f"wrt must name inputs by strings or variables, got {type(wrt).__name__}: {wrt!r:.60}")
        inputs, chosen = set(self.inputs), dict[Node, None]()
        names = ", ".join(self.input_names) or "none"
        for name in (wrt,) if isinstance(wrt, (str, Node)) else wrt:
            node = variable(name) if isinstance(name, str) else name
            if not isinstance(node, Node):
                raise TypeError(f"wrt must name inputs by strings or variables, got {node!r:.60}")
            if node not in inputs:
                raise GraphError(f"the graph has no input {node.name or node!r} (it has {names})")
            if node in chosen:
                raise GraphError(f"wrt names the input {node.name} twice")
            chosen[node] = None
        if not chosen:
            raise GraphError(f"wrt must name at least one input (the graph has {names})")
        return tuple(chosen)

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
        return dict(zip(self.nodes, values_of(self.inputs, self.nodes, values), strict=True))

    def counts(self) -> Counts:
        """Nodes, edges, depth, width, and nodes by operation, tag and role."""
        level: dict[Node, int] = {}
        operations, tags, roles = groups = Counter[str](), Counter[str](), Counter[str]()
        for node in self.nodes:
            level[node] = 1 + max(level[arg] for arg in node.args) if node.args else 0
            operations[node.op.name] += 1
            tags.update(node.tags)
            roles.update(node.roles)
        edges, depth = sum([len(node.args) for node in self.nodes]), max(level.values(), default=0)
        width = max(Counter(level.values()).values(), default=0)
        return Counts(len(level), edges, depth, width, *map(largest_first, groups))

    def listing(self) -> str:
        """The graph as text, a node a line, the same in every run."""
        lines = [f"inputs {' '.join(self.input_names)}"]
        text: dict[Node, str] = {}
        for node in self.nodes:
            if node.op is CONSTANT:
                text[node] = repr(node.value)
            elif node.op is VARIABLE:
                text[node] = str(node.name)
            else:  # such as `%3 = mul %1 %2  # adjoint; kinetic, link 2`
                text[node] = f"%{len(lines)}"
                line = f"{text[node]} = {node.op.name} {' '.join([text[arg] for arg in node.args])}"
                notes = [", ".join(sorted(labels)) for labels in (node.roles, node.tags) if labels]
                name = f"  ({node.name})" if node.name else ""
                lines.append(line + name + (f"  # {'; '.join(notes)}" if notes else ""))
        lines.extend(f"output {name} = {text[node]}" for name, node in self.outputs.items())
        return "\n".join(lines) + "\n"

    def check(self) -> None:
        """Raise GraphError unless every node is well formed and the order is topological."""
        for node in self.nodes:
            if not isinstance(node, Node) or not isinstance(node.op, Row):
                raise GraphError(f"a {type(node).__name__} is not a node of an operation in the table")
            if node.op is CONSTANT:
                if type(node.value) is not float or node.value != node.value:
                    raise GraphError(f"constant {node.value!r} is not a number")
            elif node.op is VARIABLE:
                if not node.name:
                    raise GraphError("a variable has no name")
            elif ROWS.get(node.op.name) is not node.op:
                raise GraphError(f"operation {node.op.name!r} is not in the table")
            if len(node.args) != node.op.arity:
                raise GraphError(f"{node.op.name} takes {node.op.arity} argument(s), a node has {len(node.args)}")
            for arg in node.args:
                if not isinstance(arg, Node):
                    raise GraphError(f"an argument of {node!r} is not a node: {arg!r:.60}")
        if set(topological(self.outputs.values())) != set(self.nodes):
            raise GraphError("the nodes are not those that the outputs reach")
        visited: set[Node] = set()
        for node in self.nodes:
            if not visited.issuperset(node.args):
                raise GraphError(f"{node!r} comes before one of its arguments")
            visited.add(node)

    def __repr__(self) -> str:
        ends, edges = map(_short, (self.input_names, tuple(self.outputs))), sum(len(node.args) for node in self.nodes)
        return f"<Graph ({') -> ('.join(ends)}): {len(self.nodes)} nodes, {edges} edges>"

    def _repr_html_(self) -> str | None:
        """The drawing that a notebook shows, when a drawing package is installed (extra `viz`)."""
        return render_html("graph", self)


def html(what: Node | Graph) -> str | None:
    """The drawing of a graph, or the formula of a node, as HTML: what a notebook shows of it.

    Parameters
    ----------
    what : Node or Graph
        The node or the graph.

    Returns
    -------
    str or None
        The HTML; None if no package is installed that draws it (extra `viz`), or if it cannot draw.

    Raises
    ------
    TypeError
        For what is neither a node nor a graph.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> "<math" in cg.html(cg.sin(x))
    True
    """
    if not isinstance(what, (Node, Graph)):
        raise TypeError(f"html needs a node or a graph, got {type(what).__name__}: {what!r:.60}")
    return render_html("graph" if isinstance(what, Graph) else "node", what)


def values_of(inputs: Sequence[Node], nodes: Sequence[Node], values: Mapping[str, Value]) -> list[Value]:
    """Values of nodes over some inputs, as `evaluate` has them."""
    outputs = {str(k): node for k, node in enumerate(nodes)}
    return list(Graph(inputs, outputs).evaluate(values).values()) if outputs else []


def largest_first(counter: Counter[str]) -> dict[str, int]:
    """The counts, those that are equal by name."""
    return dict(sorted(counter.items(), key=lambda item: (-item[1], item[0])))


def _short(names: Sequence[str]) -> str:
    return ", ".join(names if len(names) <= 6 else [*names[:3], "...", names[-1]])
