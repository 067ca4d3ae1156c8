"""`compile`: a graph as a function, by machine code or by generated Python and NumPy."""

from __future__ import annotations

import copyreg
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...codegen.disk_cache import open_cache
from ...codegen.llvm_engine import MissingFunctionError
from ...codegen.python_function import OnArrays, OnFloats
from ...core.evaluation import Array
from ...core.graph import Graph
from ...util.require import require_choice, require_flag, require_graph
from ...util.version import __version__
from ..program import Program
from ..runners.native_runner import NativeRunner, flags_of
from ..runners.python_runner import BLOCK, PythonRunner
from ..statements.call import Call
from .bound_function import BoundFunction
from .compiled import Compiled, Options

BACKENDS = ("auto", "python", "numpy", "llvm")
LARGE = 1_000_000  # nodes; beyond, making machine code takes longer than most callers gain


def compile(
    graph: Graph,
    backend: str = "auto",
    *,
    fast: bool = False,
    fma: bool = True,
    cache: bool | str | os.PathLike[str] = False,
) -> Compiled:
    """The graph as a function: `fn(x)` at one point, `fn.batch(X)` at many, `fn.source` to read.

    All back ends agree with `graph.evaluate`, on floats and on arrays respectively. `fast` and `cache` are for machine
    code alone.

    Parameters
    ----------
    graph : Graph
        What to compile.
    backend : {"auto", "llvm", "python", "numpy"}
        "llvm": machine code (extra `native`). "python": generated Python over floats. "numpy": generated NumPy over
        arrays. "auto": machine code where llvmlite is installed, the C library has all functions of the graph and that
        has at most 1 000 000 nodes, else generated Python for `fn(x)` and generated NumPy for `fn.batch(X)`; a
        RuntimeWarning says so if it is the size. Beyond 60 000 nodes machine code is made in a quarter of the time for
        a node, and takes a third longer to run.
    fast : bool
        May also re-associate sums and products, multiply by reciprocals and mistake the sign of a zero; NaN and
        infinities keep their meaning.
    fma : bool
        May round a product and the sum it goes into once instead of twice, and take sines, cosines, exponentials and
        logarithms from polynomials (within 2 ulp), NumPy its own functions. Without, `fn(x)` and `fn.batch(X)` agree
        with `graph.evaluate` at a point to the last bit, in every back end; batches then call the C library for each
        column.
    cache : bool or path
        Keep machine code on disk for the next process, and read it from there: True, in the platform's folder for
        caches (`$XDG_CACHE_HOME/cgraph`, `~/.cache/cgraph`, ...), or the path of a folder, `~` the home, that nobody
        else can write to. An entry is identified by the code's text, the processor and the version of LLVM; a damaged
        one is made anew. A folder that cannot be written gives a RuntimeWarning. `clear_cache` empties it; nothing
        else does.

    Returns
    -------
    Compiled
        The function; inputs and outputs are in the order of the graph's.

    Raises
    ------
    TypeError
        For what is no Graph, `fast` or `fma` that are neither True nor False, or a cache that is no path either.
    ValueError
        For an unknown backend.
    ImportError
        For "llvm" without llvmlite.
    RuntimeError
        For "llvm" where an operation is no function of the C library and its row has no instructions.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> f = cg.compile(cg.Graph([x, y], {"area": x * y}))
    >>> f([2.0, 3.0]).tolist(), f.batch([[1.0, 2.0], [3.0, 4.0]]).tolist()
    ([6.0], [[3.0, 8.0]])
    """
    require_choice("backend", backend, BACKENDS)
    require_graph("compile", graph)
    options: Options = {"fast": require_flag("fast", fast), "fma": require_flag("fma", fma), "cache": _place(cache)}
    large = backend == "auto" and len(graph.nodes) > LARGE
    if large:
        warnings.warn(
            f"a graph of {len(graph.nodes)} nodes is compiled to generated Python, as it has more than {LARGE}; "
            "backend='llvm' makes machine code of it",
            RuntimeWarning,
            stacklevel=2,
        )
    if backend == "llvm" or (backend == "auto" and not large):
        try:
            return Native(graph, backend, options)
        except (ImportError, MissingFunctionError):
            if backend == "llvm":
                raise
    return Generated(graph, backend, options)


def _place(cache: bool | str | os.PathLike[str]) -> bool | str:
    """The choice of a cache in words that hold in another folder and another process."""
    if isinstance(cache, (bool, np.bool_)):
        return bool(cache)
    if not isinstance(cache, (str, os.PathLike)) or not os.fspath(cache):
        raise TypeError(f"cache must be True, False or the path of a folder, got {cache!r:.60}")
    return str(Path(cache).expanduser().absolute())


class Generated(Compiled):
    """Generated Python for one point, generated NumPy for many; with backend "python" or "numpy", that one for both.

    options: fma; without it NumPy has its functions from the C library, too, one element after another.
    """

    vector_cost = 20  # NumPy's call, against one of Python's operators

    def __init__(self, graph: Graph, backend: str, options: Options) -> None:
        super().__init__(graph, backend, options)
        self._floats = None if backend == "numpy" else OnFloats(graph)
        self._arrays = self._on_arrays(graph) if backend == "numpy" else None
        self.source = (self._floats or self._on_arrays(graph)).source

    def _on_arrays(self, graph: Graph) -> OnArrays:
        return OnArrays(graph, exact=not self.options["fma"])

    def __call__(self, x: ArrayLike) -> Array:
        """The outputs at one point; by NumPy, as a batch of one."""
        point = self._point(x)
        return self.batch(point[:, None])[:, 0] if self._floats is None else np.array(self._floats(point.tolist()))

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats; IEEE values where a function of `math` raises."""
        return tuple(self(x).tolist()) if self._floats is None else self._floats(x)

    def _ready(self, program: Program) -> PythonRunner:
        return PythonRunner(program, fma=self.options["fma"])

    def _columns(self) -> tuple[int, Callable[[Array, Array], None]]:
        if self.backend == "python":
            return sys.maxsize, self._one_by_one  # the interpreter runs one thread at a time
        if self._arrays is None:
            self._arrays = self._on_arrays(self.graph)
        return BLOCK, self._arrays

    def _one_by_one(self, points: Array, result: Array) -> None:
        for column, x in enumerate(points.T.tolist()):
            result[:, column] = self.values(x)

    def _bound(self, x: Array, y: Array) -> Callable[[], None]:
        def run() -> None:
            y[:] = self(x)

        return run


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


class _Version:
    """The version that writes a pickle; in it, the first that is read."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return require_version, (__version__,)


def require_version(version: str) -> None:
    """Raise ValueError unless a pickle was written by this version."""
    if version != __version__:
        problem = f"was pickled by cgraph {version}, and this is cgraph {__version__}"
        raise ValueError(f"a compiled graph {problem}: pickle the graph alone, or compile it again")


def _remade(_: object, graph: Graph, backend: str, options: Options) -> Compiled:
    return compile(graph, backend, **options)


def _recipe(function: Compiled) -> Any:
    """Graph and choices, which a pickle keeps. Machine code is made again where it is read."""
    return _remade, (_Version(), function.graph, function.backend, function.options)


copyreg.pickle(Generated, _recipe)
copyreg.pickle(Native, _recipe)
