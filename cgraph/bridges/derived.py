"""Derivatives of a compiled graph as further compiled graphs, to any order."""

from collections.abc import Callable

from ..core.evaluation import Array
from ..core.graph import Graph
from ..core.node import variable
from ..program.functions.compiled import Compiled, compile


def require_compiled(what: str, fn: object) -> None:
    """Raise TypeError, saying that the function `what` needs a compiled graph, for anything else."""
    if not isinstance(fn, Compiled):
        hint = "; write cg.compile(graph)" if isinstance(fn, Graph) else ""
        raise TypeError(f"{what} needs a compiled graph, got {type(fn).__name__}: {fn!r:.60}{hint}")


def derived(fn: Compiled, transform: Callable[[Graph], Graph]) -> Compiled:
    """The transformed graph, compiled in the same way. Inputs and outputs are numbered: names would grow by orders."""
    inputs = [variable(f"x{k}") for k in range(fn.n_in)]
    numbered = Graph(inputs, {f"y{k}": node for k, node in enumerate(fn.graph(*inputs).values())})
    return compile(transform(numbered), fn.backend, **fn.options)


def values_at(fn: Compiled, points: Array) -> Array:
    """The outputs, (..., n_out), at points (..., n_in)."""
    if points.ndim == 1:
        return fn(points)
    rows = points.reshape(-1, fn.n_in)
    return fn.batch(rows.T).T.reshape(*points.shape[:-1], fn.n_out)
