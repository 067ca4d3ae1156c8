"""Parts: the steps of a long graph divided among functions, and the memory for what does not fit in registers.

Some of LLVM's passes cost calls times calls in a function, others values times values that live at once: seconds at a
few thousand steps, minutes at ten thousand. So a function has some hundred steps, and at most as many values at once as
the processor has registers: others wait in memory, those that are needed last (Belady 1966; the fewest loads).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from heapq import heappop, heappush

from ..core.node import Node
from .schedule import Joined, Scheduled
from .vector_sums import Vectors

STEPS = 400  # in a function


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
            name = self._names.get(step)
            if name is None:
                name, more = self._fetch(step)
                self._names[step] = name
                lines += more
            names.append(name)
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
        if step in self._slots or step in self._fixed or (isinstance(step, Node) and not step.args):
            return []
        if not self._free:
            self._free.append(self.places)
            self.places += 1
        self._slots[step] = self._free.pop()
        self._count += 1
        name = f"%w{self._count}"
        return [
            *self._address(step, name),
            f"  store {self.kind} {self._names[step]}, ptr {name}.at, align {self.size}",
        ]

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
