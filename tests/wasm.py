"""WebAssembly modules of graphs, run by wasmtime; functions of the host are those of the operation table."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache

import pytest

import cgraph as cg
from cgraph.extend import OPS

wasmtime = pytest.importorskip("wasmtime", reason="the viz extra has it")


@cache
def engine() -> wasmtime.Engine:
    quick = wasmtime.Config()  # the compiler need not optimize
    quick.cranelift_opt_level = "none"
    return wasmtime.Engine(quick)


class Instance:
    """A module with its memory."""

    def __init__(self, module: bytes, graph: cg.Graph) -> None:
        self.sizes = len(graph.inputs), len(graph.outputs)
        self._store = wasmtime.Store(engine())
        compiled = wasmtime.Module(engine(), module)
        self.imports = [each.name for each in compiled.imports]
        host = [
            wasmtime.Func(self._store, each.type, lambda *numbers, op=OPS[each.name]: op.scalar(*numbers))
            for each in compiled.imports
        ]
        exports = wasmtime.Instance(self._store, compiled, host).exports(self._store)
        self.exports = {name: exports[name] for name in exports}
        self.memory = exports["memory"]

    def write(self, inputs: Sequence[float]) -> None:
        self.memory.write(self._store, struct.pack(f"<{self.sizes[0]}d", *inputs), 0)

    def read(self, at: int, count: int) -> list[float]:
        """Doubles from the byte `at` on."""
        return list(struct.unpack(f"<{count}d", self.memory.read(self._store, at, at + 8 * count)))

    def __call__(self, *inputs: float) -> list[float]:
        """The outputs."""
        self.write(inputs)
        inside = 8 * self.sizes[0]
        self.exports["evaluate"](self._store, 0, inside)
        return self.read(inside, self.sizes[1])

    def step(self, method: str, inputs: Sequence[float], h: float, n: int) -> list[float]:
        """The inputs after n steps."""
        self.write(inputs)
        self.exports[method](self._store, 0, h, float(n))
        return self.read(0, self.sizes[0])


def instance(graph: cg.Graph, *more: object, **options: object) -> Instance:
    return Instance(cg.to_wasm(graph, *more, **options), graph)
