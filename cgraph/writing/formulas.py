"""Formulas of nodes, in any notation: a line for every output, and for every node that several lines need."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from ..core.node import Node
from ..operations.operation import LEAF, Op, columns
from ..util.require import require_mapping, require_sequence, require_texts, require_whole

Text = tuple[str, int]  # a formula, and how strongly it binds, as in the table of operations
INLINE = 12  # operations in a line, at most; more are told in lines of their own
LINES = 40


class Notation(NamedTuple):
    """Notation of formulas; a text is (formula, how strongly it binds, as in `MathML`).

    names: of names, {name: formula}; two names never have one formula.  number: of a constant, its text.
    operation: of an operation's row and the texts of its arguments, its text.
    unnamed: of the %number of an operation without a name, what it is called.

    >>> from cgraph.extend import Notation
    >>> plain = Notation(
    ...     lambda names: {name: name for name in names},
    ...     lambda value: (f"{value:g}", 4),
    ...     lambda op, args: (f"{op.name}({', '.join(text for text, _ in args)})", 3),
    ...     "v{}".format,
    ... )
    >>> plain.number(0.5)
    ('0.5', 4)
    """

    names: Callable[[Iterable[str]], dict[str, str]]
    number: Callable[[float], Text]
    operation: Callable[[Op, Sequence[Text]], Text]
    unnamed: Callable[[int], str]


class Lines(NamedTuple):
    """Equations, (left, right) each, arguments first; and the left sides of those that were too many."""

    equations: list[tuple[str, str]]
    left_out: list[str]


class Formulas:
    """The equations of some nodes: which of them have a line, what they are called, and their formulas.

    nodes: all that is reached, arguments first, as `Graph.nodes`.  outputs: {name: node}.
    called: {name of an input, node or output: what a person calls it}.

    >>> import cgraph as cg
    >>> from cgraph.extend import Formulas, Notation
    >>> plain = Notation(
    ...     lambda names: {name: name for name in names},
    ...     lambda value: (f"{value:g}", 4),
    ...     lambda op, args: (f"{op.name}({', '.join(text for text, _ in args)})", 3),
    ...     "v{}".format,
    ... )
    >>> x = cg.variable("x")
    >>> shared = x * x
    >>> graph = cg.Graph([x], {"y": shared + cg.sin(shared)})
    >>> Formulas(graph.nodes, graph.outputs, plain).lines(list(graph.outputs.values())).equations
    [('v1', 'mul(x, x)'), ('y', 'add(v1, sin(v1))')]
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        outputs: Mapping[str, Node],
        notation: Notation,
        called: Mapping[str, str] | None = None,
    ) -> None:
        called = require_texts("names", called)
        nodes = require_sequence("nodes", nodes, "nodes", Node)
        require_sequence("outputs", require_mapping("outputs", outputs, "name: node").values(), "nodes", Node)
        if not isinstance(notation, Notation):
            raise TypeError(f"notation must be a Notation, got {type(notation).__name__}: {notation!r:.60}")
        self.outputs, self.notation = outputs, notation
        self.places = {node: k for k, node in enumerate(nodes)}
        taken = Counter([node.name for node in nodes if node.name])
        taken.update([name for name, node in outputs.items() if node.name != name])
        shown = {name: called.get(name, name) for name in taken}
        texts = notation.names(shown.values())
        self.names = {name: texts[text] for name, text in shown.items()}
        operations = [node for node in nodes if node.args]
        self.symbol = {
            node: self.names[node.name] if node.name and taken[node.name] == 1 else notation.unnamed(k)
            for k, node in enumerate(operations, start=1)  # the %numbers of the listing
        }
        self.lined = _lined(operations)

    def lines(self, ends: Sequence[Node], most: int = LINES) -> Lines:
        """The lines of the ends and of what they need, those nearest to the ends where there are too many."""
        needed = dict.fromkeys(ends)
        queue = list(needed)
        for node in queue:  # breadth first
            new = [arg for arg in self._inside(node)[1:] if arg in self.lined and arg not in needed]
            needed |= dict.fromkeys(new)
            queue += new
        most = require_whole("lines", most, 1)
        kept = sorted(queue[:most], key=self.places.__getitem__)
        named: dict[Node, list[str]] = {}
        for name, node in self.outputs.items():
            named.setdefault(node, []).append(self.names[name])
        equations = []
        for node in kept:
            lefts = ([self.symbol[node]] if node in self.lined else []) + named.get(node, [])
            first, *same = dict.fromkeys(lefts or [""])
            equations.append((first, self._right(node)))
            equations += [(left, first) for left in same]
        left_out = sorted(queue[most:], key=self.places.__getitem__)
        return Lines(equations, [(*named.get(node, ()), self.symbol.get(node, ""))[0] for node in left_out])

    def _inside(self, node: Node) -> list[Node]:
        """The nodes of a node's line, it first, and the nodes with lines that it refers to."""
        met = {node: None}
        queue = [node]
        for each in queue:
            if each is node or each not in self.lined:
                new = dict.fromkeys([arg for arg in each.args if arg not in met])
                met |= new
                queue += new
        return queue

    def _right(self, node: Node) -> str:
        """The right side of a node's line."""
        texts: dict[Node, Text] = {}
        for each in sorted(self._inside(node), key=self.places.__getitem__):
            if each.value is not None:
                texts[each] = self.notation.number(each.value)
            elif not each.args:
                texts[each] = self.names[str(each.name)], LEAF
            elif each in self.lined and each is not node:
                texts[each] = self.symbol[each], LEAF
            else:
                texts[each] = self.notation.operation(columns(each.op), [texts[arg] for arg in each.args])
        return texts[node][0]


def _lined(operations: Sequence[Node]) -> set[Node]:
    """Nodes with a line: named ones, shared ones but for functions of one leaf, and parts of what is too long."""
    uses = Counter([arg for node in operations for arg in node.args])
    lined: set[Node] = set()
    size: dict[Node, int] = {}
    for node in operations:
        inner = [arg for arg in dict.fromkeys(node.args) if arg.args and arg not in lined]
        total = 1 + sum([size[arg] for arg in inner])
        for arg in sorted(inner, key=lambda arg: -size[arg]):
            if total > INLINE:
                lined.add(arg)
                total -= size[arg]
        size[node] = total
        of_a_leaf = len(node.args) == 1 and not node.args[0].args
        if node.name is not None or (uses[node] > 1 and not of_a_leaf):
            lined.add(node)
    return lined
