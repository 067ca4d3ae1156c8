"""Parts: the steps of a long graph divided among functions, and the memory through which values pass between them.

Some of LLVM's passes cost calls times calls in a function, others values times values that live at once: seconds at a
few thousand steps, minutes at ten thousand. What passes between parts would wait in memory anyway.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.node import Node
from .schedule import Joined, needed

STEPS = 1000  # in a function
Step = Node | Joined


class Parts:
    """The names of values while the steps are written in order; in another part a value is read from memory.

    steps: what is computed.  calls: {node: the joined call that gives it}.  kind, size: of a value, in LLVM's language
    and in bytes.

    starts: the numbers of the steps with which a part begins, without the first.  places: how many values the memory
    %w has to hold; one that nothing needs any more leaves its place to others.
    """

    def __init__(self, steps: Sequence[Step], calls: Mapping[Node, Joined], kind: str, size: int) -> None:
        self.kind, self.size, self.places = kind, size, 0
        self._calls = calls
        self.starts, self._last = _divided(steps, calls)
        self._names: dict[Step, str] = {}  # of what this part has
        self._constants: dict[Step, str] = {}
        self._slots: dict[Step, int] = {}
        self._free: list[int] = []
        self._count = 0  # of loads and stores

    def begin(self) -> None:
        """Another part: nothing is in a register."""
        self._names = dict(self._constants)

    def read(self, steps: Sequence[Step]) -> tuple[list[str], list[str]]:
        """The names of values, and the lines that bring them from memory."""
        lines: list[str] = []
        for step in steps:
            if step not in self._names:
                lines += self._address(step)
                self._names[step] = f"%w{self._count}"
                lines.append(f"  %w{self._count} = load {self.kind}, ptr %w{self._count}.at, align {self.size}")
        return [self._names[step] for step in steps], lines

    def write(self, number: int, step: Step, name: str) -> list[str]:
        """After step `number`: let its value have a name; the lines that keep it for other parts."""
        for arg in dict.fromkeys(needed(step, self._calls)):
            if self._last.get(arg) == number:
                self._free.append(self._slots.pop(arg))
        self._names[step] = name
        if isinstance(step, Node) and step.value is not None:
            self._constants[step] = name
        if step not in self._last:
            return []
        if not self._free:
            self._free.append(self.places)
            self.places += 1
        self._slots[step] = self._free.pop()
        return [*self._address(step), f"  store {self.kind} {name}, ptr %w{self._count}.at, align {self.size}"]

    def _address(self, step: Step) -> list[str]:
        self._count += 1
        return [f"  %w{self._count}.at = getelementptr {self.kind}, ptr %w, i64 {self._slots[step]}"]


def _divided(steps: Sequence[Step], calls: Mapping[Node, Joined]) -> tuple[set[int], dict[Step, int]]:
    """Where parts begin, and {value that another part needs: the number of the step that needs it last}."""
    starts: set[int] = set()
    part: dict[Step, int] = {}
    last: dict[Step, int] = {}
    passed: set[Step] = set()
    begin = 0
    for number, step in enumerate(steps):
        if number - begin >= STEPS and step not in calls:  # the results of a joined call stay in its part
            starts.add(number)
            begin = number
        part[step] = len(starts)
        for arg in needed(step, calls):
            last[arg] = number
            if part[arg] < len(starts) and (isinstance(arg, Joined) or arg.value is None):
                passed.add(arg)
    return starts, {step: last[step] for step in passed}
