"""Formulas of nodes, in any notation: a line for every output, and for every node that several lines need."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from ..core.node import Node
from ..core.traversal import topological
from ..operations.operation import LEAF, Op, columns
from ..util.require import require_flag, require_kind, require_mapping, require_sequence, require_texts, require_whole

Text = tuple[str, int]  # a formula, and how strongly it binds, as in the table of operations
Side = Node | Sequence[Sequence[Node]]  # of a statement: a node, or a matrix by rows
INLINE, LONG = 12, 90  # operations in a line, at most; more are told in lines of their own; of reading form
WIDE = 26  # operations of a part of a sum, at most, that goes on in the next row
SHORT = 6  # operations that are written again in reading form, wherever they are needed
LINES = 40


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    inside = [f"[{', '.join(row)}]" for row in rows]
    return f"[{', '.join(inside)}]"


class Notation(NamedTuple):
    """Notation of formulas; a text is (formula, how strongly it binds, as in `MathML`).

    names: of names, {name: formula}; two names never have one formula.  number: of a constant, its text.
    operation: of an operation's row and the texts of its arguments, its text.
    unnamed: of the %number of an operation without a name, what it is called.
    matrix: of texts by rows, the text of the matrix.  equals: the sign between sides.

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
    matrix: Callable[[Sequence[Sequence[str]]], str] = _matrix
    equals: str = " = "


class Lines(NamedTuple):
    """Equations, (left, right) each, arguments first; and the left sides of those that were too many.

    Without a left side it is the formula of the end, or what goes on from the row above.
    """

    equations: list[tuple[str, str]]
    left_out: list[str]


class Formulas:
    """The equations of some nodes: which of them have a line, what they are called, and their formulas.

    nodes: all that is reached, arguments first, as `Graph.nodes`.  outputs: {name: node}.
    called: {name of an input, node or output: what a person calls it}.  reading: nodes are those of `reading_form`:
    what is long and needed several times has a line; these are numbered from 1, and a long sum goes on in further rows.

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
        *,
        reading: bool = False,
    ) -> None:
        called = require_texts("names", called)
        nodes = require_sequence("nodes", nodes, "nodes", Node)
        require_sequence("outputs", require_mapping("outputs", outputs, "name: node").values(), "nodes", Node)
        require_kind("notation", notation, Notation)
        self.outputs, self.notation = outputs, notation
        self.places = {node: k for k, node in enumerate(nodes)}
        taken = Counter([node.name for node in nodes if node.name])
        taken.update([name for name, node in outputs.items() if node.name != name])
        shown = {name: called.get(name, name) for name in taken}
        texts = notation.names(shown.values())
        self.names = {name: texts[text] for name, text in shown.items()}
        operations = [node for node in nodes if node.args]
        self.reading = require_flag("reading", reading)
        self.size: dict[Node, int] = {}  # operations in a node's line
        self.lined = self._lined(operations)
        numbered = [node for node in operations if node in self.lined] if reading else operations
        self.symbol = {
            node: self.names[node.name] if node.name and taken[node.name] == 1 else notation.unnamed(k)
            for k, node in enumerate(numbered, start=1)  # the %numbers of the listing
        }

    def lines(self, ends: Sequence[Node], most: int = LINES) -> Lines:
        """The lines of the ends and of what they need, those nearest to the ends where there are too many."""
        ends = require_sequence("ends", ends, "nodes", Node)
        queue = list(dict.fromkeys([*ends, *self._needed(ends)]))
        most = require_whole("lines", most, 1)
        kept = sorted(queue[:most], key=self.places.__getitem__)
        named: dict[Node, list[str]] = {}
        for name, node in self.outputs.items():
            named.setdefault(node, []).append(self.names[name])
        equations = []
        for node in kept:
            lefts = ([self.symbol[node]] if node in self.lined else []) + named.get(node, [])
            first, *same = dict.fromkeys(lefts or [""])
            equations += self._rows(first, node)
            equations += [(left, first) for left in same]
        left_out = sorted(queue[most:], key=self.places.__getitem__)
        return Lines(equations, [(*named.get(node, ()), self.symbol.get(node, ""))[0] for node in left_out])

    def _needed(self, ends: Sequence[Node]) -> list[Node]:
        """The nodes with lines that the formulas of some nodes are or refer to, those nearest to them first."""
        queue = list(dict.fromkeys(ends))
        found: dict[Node, None] = dict.fromkeys([node for node in queue if node in self.lined])
        for node in queue:
            new = [arg for arg in self._inside(node)[1:] if arg in self.lined and arg not in found]
            found |= dict.fromkeys(new)
            queue += new
        return list(found)

    def _rows(self, left: str, node: Node) -> list[tuple[str, str]]:
        """The line of a node; a long sum of reading form goes on in further rows."""
        texts = self._texts(node)
        spine, parts = node, list[tuple[Node, Node]]()  # the sums from the outermost inwards, and what each adds
        while self.reading and spine.op.name in ("add", "sub") and (spine is node or spine not in self.lined):
            parts.append((spine, spine.args[1]))
            spine = spine.args[0]
        room, rows = self.size.get(spine, 1), [texts[spine][0]]
        if not parts or self.size[node] <= WIDE:
            return [(left, texts[node][0])]
        for whole, part in reversed(parts):
            text = self.notation.operation(columns(whole.op), [("", LEAF), texts[part]])[0]
            size = 1 if part in self.lined else self.size.get(part, 1)
            room += size
            if room > WIDE:
                room = size
                rows.append(text)
            else:
                rows[-1] += text
        return [(left if i == 0 else "", row) for i, row in enumerate(rows)]

    def _formula(self, node: Node) -> str:
        """The formula of a node, which refers to those with lines."""
        return self._texts(node)[node][0]

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

    def _texts(self, node: Node) -> dict[Node, Text]:
        """The texts of a node and of all in its line."""
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
        return texts

    def _lined(self, operations: Sequence[Node]) -> set[Node]:
        """Nodes with a line: named ones, shared ones but for functions of one leaf, and parts of what is too long."""
        uses = Counter([arg for node in operations for arg in node.args])
        most, short = (LONG, SHORT) if self.reading else (INLINE, 0)
        lined: set[Node] = set()
        for node in operations:
            inner = [arg for arg in dict.fromkeys(node.args) if arg.args and arg not in lined]
            total = 1 + sum([self.size[arg] for arg in inner])
            for arg in sorted(inner, key=lambda arg: -self.size[arg]):
                if total > most:
                    lined.add(arg)
                    total -= self.size[arg]
            self.size[node] = total
            of_a_leaf = len(node.args) == 1 and not node.args[0].args
            if node.name is not None or (uses[node] > 1 and not of_a_leaf and total > short):
                lined.add(node)
        return lined


def statements(
    given: Sequence[Sequence[Side]],
    notation: Notation,
    called: Mapping[str, str] | None = None,
    lines: int = LINES,
    *,
    whole: bool = False,
) -> Lines:
    """Statements that sides are equal, of nodes in reading form, below the lines of what they need.

    given: of each statement its sides from the left, two at least; a matrix stands on the right.  Those that have room
    with all the lines that they need are told, from the first on.  whole: if none has, none is, in place of the first
    with the lines nearest to it.

    >>> import cgraph as cg
    >>> from cgraph.writing.latex import LATEX
    >>> p, v, w = cg.variables("p v w")
    >>> statements([(p, v + w)], LATEX).equations
    [('p', 'v + w')]
    """
    ends = [entry for sides in given for entry in entries_of(sides)]
    found = Formulas(topological(ends), {}, notation, called, reading=True)
    kept, needed, all_needed = _fitting(given, found, require_whole("lines", lines, 1), whole)
    equations = [row for node in needed for row in found._rows(found.symbol[node], node)]
    for *lefts, right in kept:
        left = notation.equals.join([found._formula(each) for each in lefts if isinstance(each, Node)])
        if isinstance(right, Node):
            equations += [(left, found.symbol[right])] if right in found.lined else found._rows(left, right)
        else:
            entries = [
                [found.symbol.get(each, "") if each in found.lined else found._formula(each) for each in row]
                for row in right
            ]
            equations.append((left, notation.matrix(entries)))
    told = set(needed)
    left_out = [found._formula(sides[0]) for sides in given if sides not in kept and isinstance(sides[0], Node)]
    left_out += [found.symbol[node] for node in all_needed if node not in told]
    return Lines(equations, left_out)


def _fitting(
    given: Sequence[Sequence[Side]], found: Formulas, most: int, whole: bool
) -> tuple[list[Sequence[Side]], list[Node], list[Node]]:
    """The statements that so many lines have room for, the lines that they need, and all lines that any needs."""
    place = found.places.__getitem__
    kept: list[Sequence[Side]] = []
    shown: set[Node] = set()
    everything: set[Node] = set()
    for sides in given:
        needed = set(found._needed(entries_of(sides)))
        everything |= needed
        if len(shown | needed) + len(kept) < most:
            kept.append(sides)
            shown |= needed
    if not kept and given and not whole:
        kept = [given[0]]
        shown = set(found._needed(entries_of(given[0]))[: most - 1])
    return kept, sorted(shown, key=place), sorted(everything, key=place)


def entries_of(sides: Sequence[Side]) -> list[Node]:
    """All nodes of a statement."""
    return [entry for side in sides for row in ([[side]] if isinstance(side, Node) else side) for entry in row]


def fraction(value: float) -> tuple[int, int] | None:
    """(numerator, denominator) of a number that is read more easily so: one half, and what has no end in decimals."""
    for below in (2, 3, 6, 9, 12):
        above = round(value * below)
        if 0 < above <= 3 * below and above / below == value and (value == 0.5 or value * 1000.0 % 1.0):
            return above, below
    return None
