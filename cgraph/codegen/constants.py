"""Constants: the numbers of a function that its instructions do not hold, in a table behind the code."""

from __future__ import annotations

from ..core.graph import Graph
from ..core.node import CONSTANT, Node
from ..operations.table import OPS
from .arithmetic import Arithmetic, bits


class Constants:
    """A table of a graph's constants, each once, read by way of its address.

    As an operand, a constant would need its own address, ten bytes where instructions have five to nine; the processor
    waits for the code of a long graph.

    name: of the function.
    """

    def __init__(self, graph: Graph, arithmetic: Arithmetic, name: str) -> None:
        self._arithmetic, self._name = arithmetic, name
        inside = {node.args[1] for node in graph.nodes if node.op is OPS["div"]}  # LLVM divides by 2 with a product
        self._rows: dict[Node, int] = {}
        for node in graph.nodes:
            if node.op is CONSTANT and node.value and node not in inside:
                self._rows[node] = len(self._rows)

    def definitions(self) -> list[str]:
        """The table, and its address in a variable: LLVM would put the address of each row into the instructions."""
        if not self._rows:
            return []
        numbers = ", ".join([f"double {bits(node.value or 0.0)}" for node in self._rows])
        return [
            f"@{self._name}.numbers = internal constant [{len(self._rows)} x double] [{numbers}], align 64",
            f"@{self._name}.constants = internal global ptr @{self._name}.numbers",
        ]

    def start(self) -> list[str]:
        """What stands at the start of a function that reads constants."""
        return [] if not self._rows else [f"  %constants = load ptr, ptr @{self._name}.constants, align 8"]

    def read(self, node: Node, name: str) -> tuple[str, list[str]]:
        """The name of a constant's value, and the lines that bring it there."""
        if node not in self._rows:
            assert node.value is not None
            return self._arithmetic.number(node.value), []
        one = name if self._arithmetic.lanes == 1 else f"{name}.one"
        lines = [
            f"  {name}.at = getelementptr double, ptr %constants, i64 {self._rows[node]}",
            f"  {one} = load double, ptr {name}.at, align 8, !invariant.load !{{}}",
        ]
        return name, lines + (self._arithmetic.splat(name, one) if self._arithmetic.lanes > 1 else [])
