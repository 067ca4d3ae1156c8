"""The order in which machine code computes a graph's nodes, in joined calls, and what memory holds meanwhile.

Some of LLVM's passes cost calls times calls in a function, others values times values that live at once: seconds at a
few thousand steps, minutes at ten thousand. So a function has some hundred steps, and at most as many values at once as
the processor has registers: others wait in memory, those that are needed last (Belady 1966; the fewest loads).
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from heapq import heappop, heappush
from types import MappingProxyType
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import Node
from ..core.traversal import as_made
from ..operations.operation import columns
from .vector_math import POLYNOMIAL
from .vector_sums import Sums, Vectors

STEPS = 400  # in a function


class Joined(NamedTuple):
    """One call in place of several: each of the functions named, at each of the arguments."""

    names: tuple[str, ...]
    arguments: tuple[Node, ...]


class Merged(NamedTuple):
    """Several nodes of a graph that machine code does in one step.

    calls: {node: the call that gives it}.  products: {sum: its argument that it multiplies itself}.
    of_libm: nodes of a vector that each lane has from libm.  sums: {sum of products: those added up with it}.
    """

    calls: Mapping[Node, Joined]
    products: Mapping[Node, Node]
    of_libm: Set[Node] = frozenset()
    sums: Mapping[Node, Sums] = MappingProxyType({})


Scheduled = Node | Joined | Sums


def schedule(graph: Graph, merged: Merged) -> dict[Scheduled, tuple[Scheduled, ...]]:
    """Every operation once and what it reads, arguments first, in the order in which the nodes were made.

    Calls of library functions come as early as they can, since a call empties the registers; right behind a joined one
    come the nodes that it gives.
    """
    results: dict[Scheduled, list[Node]] = {}
    for node, call in merged.calls.items():
        results.setdefault(call, []).append(node)
    reads: dict[Scheduled, tuple[Scheduled, ...]] = {}
    stack: list[Scheduled] = list(graph.outputs.values())
    while stack:
        step = stack.pop()
        if step not in reads and not _leaf(step):
            reads[step] = needed(step, merged)
            stack += reads[step]
    early = [merged.calls.get(node, node) for node in graph.nodes if node.args and columns(node.op).calls_library]
    made = as_made([step for step in reads if isinstance(step, Node)])
    order: dict[Scheduled, tuple[Scheduled, ...]] = {}
    stack = [*reversed(made), *reversed(early)]
    while stack:
        step = stack[-1]
        missing = [each for each in reads[step] if each not in order and not _leaf(each)]
        if missing and step not in order:
            stack += reversed(missing)
            continue
        order.setdefault(stack.pop(), reads[step])
        order |= {node: (step,) for node in results.get(step, ()) if node not in order}
    return order


def _leaf(step: Scheduled) -> bool:
    return isinstance(step, Node) and not step.args


def needed(step: Scheduled, merged: Merged) -> tuple[Scheduled, ...]:
    """Arguments of a step, or the joined call that gives the node; of a product that it takes in, the factors.

    In their place, as in a * b + c and in c - a * b.
    """
    if isinstance(step, Joined):
        return step.arguments
    if isinstance(step, Sums):
        return tuple(dict.fromkeys([node for pair in step.factors for side in pair for node in side]))
    if step in merged.calls:
        return (merged.calls[step],)
    if step in merged.sums:
        return (merged.sums[step],)
    if (product := merged.products.get(step)) is not None:
        first, second = step.args
        return (*product.args, second) if first is product else (first, *product.args)
    return step.args


def products_of(graph: Graph) -> dict[Node, Node]:
    """{sum or difference: its argument, a product that nothing else needs}, the first where both are; rounded once."""
    users = Counter([arg for node in graph.nodes for arg in node.args] + list(graph.outputs.values()))
    return {
        node: product
        for node in graph.nodes
        if node.op.name in ("add", "sub")
        for product in [next((arg for arg in node.args if arg.op.name == "mul" and users[arg] == 1), None)]
        if product is not None
    }


def joined_calls(graph: Graph, together: int) -> dict[Node, Joined]:
    """{node: the call that gives it} for sines, cosines, exponentials and logarithms that do not need each other.

    together: at most so many arguments in one call. With 1, only sine and cosine of the same angle are joined. A node
    with nothing to join stays out.
    """
    level: dict[Node, int] = {}  # how many of these functions lie one behind another on the way to a node
    groups: dict[tuple[int, str], dict[Node, list[Node]]] = {}  # (level, kind) -> argument -> its calls
    for node in graph.nodes:
        level[node] = max([level[arg] for arg in node.args], default=0)
        if columns(node.op).vector:
            level[node] += 1
            groups.setdefault((level[node], columns(node.op).vector), {}).setdefault(node.args[0], []).append(node)
    calls: dict[Node, Joined] = {}
    for group in groups.values():
        arguments = tuple(group)
        for start in range(0, len(arguments), together):
            chosen = arguments[start : start + together]
            nodes = [node for argument in chosen for node in group[argument]]
            if len(nodes) > 1:
                names = {columns(node.op).library for node in nodes}
                call = Joined(tuple([name for name in POLYNOMIAL if name in names]), chosen)
                calls.update(dict.fromkeys(nodes, call))
    return calls


class Parts:
    """The names of values while the steps are written in order.

    steps: what is computed, and what that reads.  calls: {node: the joined call that gives it}.  kind, size: of a
    value, in LLVM's language and in bytes.  registers: how many values have names at once.  leaf: (a constant or an
    input, name) -> its name and the lines that make it so.  vectors: values that lie in memory besides.

    starts: the numbers of the steps with which a part begins, without the first.  places: how many values the memory
    %w has to hold; one that nothing needs any more leaves its place to others.
    """

    def __init__(
        self,
        steps: Mapping[Scheduled, tuple[Scheduled, ...]],
        calls: Mapping[Node, Joined],
        kind: str,
        size: int,
        registers: int,
        leaf: Callable[[Node, str], tuple[str, list[str]]],
        vectors: Vectors,
    ) -> None:
        self.kind, self.size, self.places = kind, size, vectors.places
        self._leaf, self._registers = leaf, registers
        self.starts = _starts(steps, calls)
        self._uses: dict[Scheduled, list[int]] = {}  # numbers of the steps that will need a value, the next one last
        for number, reads in zip(range(len(steps) - 1, -1, -1), reversed(list(steps.values())), strict=True):
            for arg in reads:
                self._uses.setdefault(arg, []).append(number)
        self._names: dict[Scheduled, str] = {}
        self._latest: list[tuple[int, int, Scheduled]] = []  # heap by the next use, latest first; some outdated
        self._slots: dict[Scheduled, int] = {}
        self._fixed: dict[Node, int] = {node: slots[0] for node, slots in vectors.slots.items()}
        self._free: list[int] = []
        self._count = 0  # of names

    def forget(self) -> list[str]:
        """Lines that keep what is needed, after which nothing is in a register any more."""
        lines = [line for step in self._names for line in self._keep(step)]
        self._names, self._latest = {}, []
        return lines

    def read(self, steps: Sequence[Scheduled]) -> tuple[list[str], list[str]]:
        """The names of values for the next step, and the lines that bring them from memory."""
        lines: list[str] = []
        names = []
        for step in steps:
            if step not in self._names:
                self._names[step], more = self._fetch(step)
                lines += more
            names.append(self._names[step])
            self._uses[step].pop()
        for step in steps:
            self._used(step)
        return names, lines

    def write(self, step: Scheduled, name: str) -> list[str]:
        """A step's value has a name; the lines that make room for it."""
        self._names[step] = name
        self._used(step)
        lines: list[str] = []
        while len(self._names) > self._registers:
            next_use, _, latest = heappop(self._latest)
            if latest in self._names and self._uses[latest][-1] == -next_use:
                lines += self._keep(latest)
                del self._names[latest]
        return lines

    def _used(self, step: Scheduled) -> None:
        """Move a step on to its next use; after the last one it goes."""
        if uses := self._uses.get(step):
            self._count += 1
            heappush(self._latest, (-uses[-1], self._count, step))
            return
        self._names.pop(step, None)
        if step in self._slots:
            self._free.append(self._slots.pop(step))

    def _fetch(self, step: Scheduled) -> tuple[str, list[str]]:
        self._count += 1
        name = f"%w{self._count}"
        if isinstance(step, Node) and not step.args:
            return self._leaf(step, name)
        return name, [*self._address(step, name), f"  {name} = load {self.kind}, ptr {name}.at, align {self.size}"]

    def _keep(self, step: Scheduled) -> list[str]:
        """The lines that put a value into memory, if it is to be there and is not."""
        if step in self._slots or step in self._fixed or _leaf(step):
            return []
        if not self._free:
            self._free.append(self.places)
            self.places += 1
        self._slots[step] = self._free.pop()
        self._count += 1
        name = f"%w{self._count}"
        store = f"  store {self.kind} {self._names[step]}, ptr {name}.at, align {self.size}"
        return [*self._address(step, name), store]

    def _address(self, step: Scheduled, name: str) -> list[str]:
        slot = self._fixed[step] if isinstance(step, Node) and step in self._fixed else self._slots[step]
        return [f"  {name}.at = getelementptr {self.kind}, ptr %w, i64 {slot}"]


def _starts(steps: Iterable[Scheduled], calls: Mapping[Node, Joined]) -> set[int]:
    """Numbers of the steps where parts begin, without the first."""
    starts: set[int] = set()
    begin = 0
    for number, step in enumerate(steps):
        if number - begin >= STEPS and step not in calls:  # the results of a joined call stay in its part
            starts.add(number)
            begin = number
    return starts
