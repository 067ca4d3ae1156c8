"""`compile`: the choice of what runs a graph."""

from __future__ import annotations

import copyreg
from functools import partial
from typing import Any

from ..graph import Graph
from .compiled import Compiled
from .generated import Generated
from .native import Native

BACKENDS = ("auto", "python", "numpy", "llvm")
LARGE = 100_000  # nodes; beyond, making machine code takes longer than most callers gain


def compile(graph: Graph, backend: str = "auto", *, fast: bool = False, fma: bool = True) -> Compiled:
    """The graph as a function: `fn(x)` at one point, `fn.batch(X)` at many, `fn.source` to read.

    backend: "llvm", machine code (`pip install 'cgraph[native]'`); "python", generated Python over floats; "numpy",
    generated NumPy over arrays; "auto", machine code where llvmlite is installed and the graph has at most 100 000
    nodes, else generated Python for `fn(x)` and generated NumPy for `fn.batch(X)`. All agree with `graph.evaluate`, on
    floats and on arrays respectively.
    fma: machine code may round a product and the sum it goes into once instead of twice; without, `fn(x)` agrees with
    `graph.evaluate` to the last bit (`hypot` to one unit of it: Python has its own, machine code the C library's).
    fast: it may also re-associate sums and products, multiply by reciprocals and mistake the sign of a zero; NaN and
    infinities keep their meaning. Both are for machine code alone.

    Raises TypeError for what is no Graph, ValueError for an unknown backend, ImportError for "llvm" without llvmlite.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend must be one of {', '.join(BACKENDS)}, got {backend!r}")
    if not isinstance(graph, Graph):
        raise TypeError(f"compile takes a Graph, got {type(graph).__name__}: {graph!r:.60}")
    if backend == "llvm" or (backend == "auto" and len(graph.nodes) <= LARGE):
        try:
            return Native(graph, backend, fast=fast, fma=fma)
        except ImportError:
            if backend == "llvm":
                raise
    return Generated(graph, backend)


def _recipe(function: Any) -> Any:
    """What pickling keeps: the graph and the choice. Machine code is made again where it is read."""
    options: dict[str, Any] = {"fast": function.fast, "fma": function.fma} if isinstance(function, Native) else {}
    return partial(compile, **options), (function.graph, function.backend)


copyreg.pickle(Generated, _recipe)
copyreg.pickle(Native, _recipe)
