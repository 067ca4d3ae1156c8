"""`compile`: a graph as a function, by machine code or by generated Python and NumPy."""

from __future__ import annotations

import copyreg
import os
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...codegen.disk_cache import open_cache
from ...codegen.llvm_engine import MissingFunctionError
from ...core.graph import Graph
from ...util.require import require_choice, require_flag, require_graph
from ...util.version import __version__
from ..runners.native_runner import NativeRunner
from ..runners.python_runner import PythonRunner
from .compiled import Compiled, Options

BACKENDS = ("auto", "python", "numpy", "llvm")
LARGE_GRAPH = 1_000_000  # nodes; beyond, making machine code takes longer than most callers gain


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
        RuntimeWarning says so if it is the size. Beyond 60 000 nodes machine code is made in two thirds of the time
        for a node, and takes twice as long to run.
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
    large = backend == "auto" and len(graph.nodes) > LARGE_GRAPH
    if large:
        warnings.warn(
            f"a graph of {len(graph.nodes)} nodes is compiled to generated Python, as it has more than {LARGE_GRAPH}; "
            "backend='llvm' makes machine code of it",
            RuntimeWarning,
            stacklevel=2,
        )
    if backend == "llvm" or (backend == "auto" and not large):
        try:
            kept = open_cache(options["cache"])
            ready = partial(NativeRunner, fast=options["fast"], fma=options["fma"], cache=kept)
            return Compiled(graph, backend, options, ready, ready)
        except (ImportError, MissingFunctionError):
            if backend == "llvm":
                raise
    in_python = partial(PythonRunner, fma=options["fma"])
    return Compiled(graph, backend, options, in_python, partial(in_python, backend=backend))


def _place(cache: bool | str | os.PathLike[str]) -> bool | str:
    """The choice of a cache in words that hold in another folder and another process."""
    if isinstance(cache, (bool, np.bool_)):
        return bool(cache)
    if not isinstance(cache, (str, os.PathLike)) or not os.fspath(cache):
        raise TypeError(f"cache must be True, False or the path of a folder, got {cache!r:.60}")
    return str(Path(cache).expanduser().absolute())


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


copyreg.pickle(Compiled, _recipe)
