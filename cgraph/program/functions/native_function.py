"""Native: a graph as machine code, for one point and for vectors of them."""

from __future__ import annotations

from collections.abc import Callable

from ...codegen.disk_cache import open_cache
from ...core.evaluation import Array
from ...core.graph import Graph
from ..program import Program
from ..runners.native_runner import NativeRunner, flags_of
from ..statements.call import Call
from .bound_function import BoundFunction
from .compiled import Compiled, Options


class Native(BoundFunction, Compiled):
    """Machine code through LLVM. The function of one point is made at once, that of batches at its first use.

    options: fast, fma and cache, see `compile`. Any number of threads may call it at once.
    """

    takes_rows, tiles = True, 16

    def __init__(self, graph: Graph, backend: str, options: Options) -> None:
        Compiled.__init__(self, graph, backend, options)
        BoundFunction.__init__(self, self._bound, self.n_in, (self.n_out,))
        self._flags = flags_of(options["fast"], options["fma"])
        self._cache = open_cache(options["cache"])
        self._runner = self._ready(Program({"x": self.n_in, "y": self.n_out}, [Call(graph, ("x",), ("y",))], ["y"]))
        self.lanes = self._runner.width
        self.source = self._runner.point("x", "y").source

    def batch_source(self) -> str:
        """The text in LLVM's language of the function for batches."""
        return self._runner.batch_text("x").source

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        return self._runner._bind_pass(("x", x), ("y", y))[0]

    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        return self._runner._columns("x")

    def _ready(self, program: Program) -> NativeRunner:
        return NativeRunner(program, self._flags, self._cache)
