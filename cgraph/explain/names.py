"""Names in both directions: the nodes of a name, and a node as text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

from ..core.checks import GraphError
from ..core.evaluation import is_finite
from ..core.graph import Graph
from ..core.node import CONSTANT, Node
from ..operations.operation import SUM, columns
from ..util.require import require_graph, require_kind, require_mapping, require_texts
from ..util.words import listed, nearest
from ..writing.source_lines import lines_text

Name = str | Node
Point = Mapping[str, float]
Value = TypeVar("Value")
LONGEST_TEXT = 32  # characters up to which a node is written out; a longer one refers to its parts by their %numbers
DEEPEST_TEXT = 4  # most operations within one another in such a text

_NEGATION, _WHOLE = SUM, 9  # how strongly a leading minus binds, and a name or a function


class Names:
    """The names of a graph's nodes, in both directions: `one`, `all`, `group`, `output`; and `text`, `line`, `short`.

    called: {name in the graph: what a person calls it}, such as `dynamics.display_names(model)`. These are shown, and
    taken beside the graph's; where the graph has the same name, or two have one, the graph's stands.
    number, as an attribute: the %numbers of the operations, as in `graph.listing()`.

    >>> import cgraph as cg
    >>> from cgraph.extend import Names
    >>> x, h = cg.variables("x h")
    >>> names = Names(cg.Graph([x, h], {"y": cg.sin(x * h)}))
    >>> names.line(names.output("y"))
    '%2 = sin(%1)'
    >>> names.text(names.output("y"))
    'sin(x * h)'
    """

    def __init__(self, graph: Graph, called: Mapping[str, str] | None = None) -> None:
        require_graph("Names", graph)
        self.graph = graph
        self.number = {node: i for i, node in enumerate([node for node in graph.nodes if node.args], 1)}
        self.by_name: dict[str, list[Node]] = {}
        self.known = dict.fromkeys((*graph.inputs, *graph.nodes))
        for node in self.known:
            if node.name is not None:
                self.by_name.setdefault(node.name, []).append(node)
        self._called: dict[str, str] = {}
        self._meant: dict[str, str] = {}
        for name, text in require_texts("names", called).items():
            if self._has(name) and not self._has(text) and text not in self._meant:
                self._called[name], self._meant[text] = text, name

    def _has(self, name: str) -> bool:
        return name in self.by_name or name in self.graph.outputs

    # Between a graph's name and what a person calls it.

    def shown(self, name: str) -> str:
        """Name of a node, input or output as a person writes it."""
        return self._called.get(require_kind("name", name, str), name)

    def meant(self, name: str) -> str:
        """The graph's name of what a person calls so."""
        return self._meant.get(require_kind("name", name, str), name)

    def called(self, who: Name) -> str:
        """Name, as a person writes it, of a node or of the name of one."""
        return self.shown(self.meant(who)) if isinstance(who, str) else self.text(who)

    def inputs_of(self, what: str, values: Mapping[str, Value], *, all_of_them: bool = False) -> dict[str, Value]:
        """Values by the graph's names of inputs. Raises GraphError, naming `what`, for what is no input, or twice.

        all_of_them: whether to raise it, too, for an input without a value.
        """
        result: dict[str, Value] = {}
        inputs = dict.fromkeys(self.graph.input_names)
        for name, value in require_mapping(what, values, "input: value").items():
            meant = self.meant(name) if isinstance(name, str) else name
            if meant not in inputs:
                has = listed([self.shown(each) for each in inputs]) or "none"
                near = self._near(name, inputs)
                raise GraphError(f"{what}: the graph has no input {name!s:.80}{near} (it has {has})")
            if meant in result:
                raise GraphError(f"{what} gives the input {self.shown(meant)} twice, once as {meant}")
            result[meant] = value
        if all_of_them and (missing := [self.shown(name) for name in inputs if name not in result]):
            raise GraphError(f"{what}: no value for input {', '.join(missing)}")
        return result

    # From a name to nodes.

    def all(self, who: Name, what: str = "a node") -> list[Node]:
        """The nodes of a name: input, named nodes, output. Raises GraphError if there is none."""
        if isinstance(who, Node):
            if who not in self.known:
                raise GraphError(f"{who!r} is not a node of the graph")
            return [who]
        if not isinstance(who, str):
            raise TypeError(f"{what} is given by its name or itself, got {type(who).__name__}: {who!r:.60}")
        name = self.meant(who)
        nodes = self.by_name.get(name, []) + ([self.graph.outputs[name]] if name in self.graph.outputs else [])
        if not nodes:
            near = self._near(who, [*self.by_name, *self.graph.outputs])
            raise GraphError(f"nothing in the graph is called {who!r:.80}{near} ({self._known()})")
        return list(dict.fromkeys(nodes))

    def group(self, who: Name | Sequence[Name]) -> list[Node]:
        """The nodes of a group: a name or several in one string, a node, or a sequence of these."""
        if isinstance(who, str) and not self._has(self.meant(who)):
            who = who.replace(",", " ").split()
        if not isinstance(who, (str, Node, Iterable)):
            raise TypeError(f"a group is a name or several, or nodes; got {type(who).__name__}: {who!r:.60}")
        members = [who] if isinstance(who, (str, Node)) else list(who)
        if not members:
            raise ValueError("a group needs at least one name")
        return list(dict.fromkeys([node for member in members for node in self.all(member)]))

    def one(self, who: Name, what: str = "a node") -> Node:
        """The one node of a name. Raises GraphError if there is none, or more than one."""
        nodes = self.all(who, what)
        if len(nodes) > 1:
            raise GraphError(f"{len(nodes)} nodes are called {who!r:.80}; give the node itself")
        return nodes[0]

    def output(self, who: Name, what: str = "a node") -> Node:
        """The output of a name, else the one node of that name."""
        name = self.meant(who) if isinstance(who, str) else who
        return self.graph.outputs[name] if isinstance(name, str) and name in self.graph.outputs else self.one(who, what)

    def _near(self, who: str, known: Iterable[str]) -> str:
        """Known names that may be meant, as part of a sentence; empty where none is near."""
        near = nearest(str(who), [each for name in known for each in dict.fromkeys((self.shown(name), name))])
        return f": did you mean {' or '.join(near)}?" if near else ""

    def _known(self) -> str:
        named = [name for name, nodes in self.by_name.items() if any(node.args for node in nodes)]
        parts = (("inputs", self.graph.input_names), ("named nodes", named), ("outputs", tuple(self.graph.outputs)))
        return "; ".join(f"{what} {listed([self.shown(name) for name in names])}" for what, names in parts if names)

    # From a node to text.

    def short(self, node: Node) -> str:
        """A name, a number, or the %number of the listing; a question mark for an operation of no such line."""
        if require_kind("node", node, Node).op is CONSTANT:
            return f"{node.value:.6g}"
        if node.name:
            return self.shown(node.name)
        return f"%{self.number[node]}" if node in self.number else "?"

    def text(self, node: Node, length: int = LONGEST_TEXT) -> str:
        """A name, or the formula, such as `qd0 * dt`, as deep as `length` characters allow."""
        if require_kind("node", node, Node).name or not node.args:
            return self.short(node)
        for depth in range(DEEPEST_TEXT, 1, -1):
            text = self._written(node, depth)[0]
            if len(text) <= length:
                return text
        return self._written(node, 1)[0]

    def line(self, node: Node) -> str:
        """The node as in the listing, with its tags, and its lines if known: `%7 = qd0 * dt  [euler]  arm.py:12`."""
        tags = f"  [{', '.join(sorted(node.tags))}]" if require_kind("node", node, Node).tags else ""
        tags += f"  {lines_text([node])}" if node.lines else ""
        if not node.args:
            return self.short(node) + tags
        if node not in self.number:
            raise GraphError(f"{node!r} is not a node of the graph")
        name = f"  ({self.shown(node.name)})" if node.name else ""
        return f"%{self.number[node]} = {self.formula(node)}{name}{tags}"

    def formula(self, node: Node) -> str:
        """The operation on its arguments, these by name or %number: `qd0 * dt`."""
        return self._written(require_kind("node", node, Node), 1)[0]

    def _written(self, node: Node, depth: int) -> tuple[str, int]:
        """Text with at most `depth` operations within one another, and how strongly the outermost one binds."""
        parts = [
            self._written(arg, depth - 1) if depth > 1 and arg.args and not arg.name else (self.short(arg), _WHOLE)
            for arg in node.args
        ]
        if (infix := columns(node.op).infix) is not None:
            symbol, strength = infix
            (a, left), (b, right) = parts
            a = f"({a})" if left < strength else a
            b = f"({b})" if right <= strength or b.startswith("-") else b
            return f"{a} {symbol} {b}", strength
        if columns(node.op).signs == (-1,):
            text, strength = parts[0]
            return (f"-({text})" if strength <= _NEGATION or text.startswith("-") else f"-{text}"), _NEGATION
        return f"{node.op.name}({', '.join([text for text, _ in parts])})", _WHOLE


def checked_point(names: Names, at: Point) -> dict[str, float]:
    """The point as floats, by the graph's names.

    Raises GraphError for a missing or unknown name, ValueError for what is not finite.
    """
    for name, value in require_mapping("at", at, "input: value").items():
        if isinstance(value, bool) or not is_finite(value):
            raise ValueError(f"at: input {name!r} must be a finite number, got {value!r:.60}")
    return {name: float(value) for name, value in names.inputs_of("at", at, all_of_them=True).items()}


def joined(words: Sequence[str], most: int = 6) -> str:
    """`a, b and c`; of many words the first and the number of the rest."""
    if len(words) > most:
        words = [*words[: most - 1], f"{len(words) - most + 1} more"]
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)
