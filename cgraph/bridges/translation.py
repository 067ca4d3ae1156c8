"""Translation: nodes as expressions of another library, operation by operation; or compiled graphs, which it calls."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ..core.checks import GraphError
from ..core.evaluation import Array
from ..core.graph import Graph
from ..core.node import Node, variable
from ..operations.operation import Op, columns
from ..program.functions.compiled import Compiled, compile
from ..util.caches import kept_by_first

Expression = TypeVar("Expression")
Operations = Callable[[Op], Callable[..., Any]]  # of a row of the table: the function on expressions


def translated(
    order: Iterable[Node],
    env: Mapping[Node, Expression],
    function_of: Operations,
    number: Callable[[float], Any] = float,
) -> dict[Node, Expression]:
    """Every node of a topological order as an expression, from those of the variables in `env`.

    number: makes a constant. Operations on floats alone give a float.
    """
    result: dict[Node, Any] = dict(env)
    for node in order:
        if node in result:
            continue
        if node.value is not None:
            result[node] = number(node.value)
            continue
        args = [result[arg] for arg in node.args]
        constant = all([type(arg) is float for arg in args])
        result[node] = node.op.scalar(*args) if constant else function_of(columns(node.op))(*args)
    return result


def operations(library: str, modules: Sequence[object], table: Mapping[str, Callable[..., Any]]) -> Operations:
    """The functions of a library: of its `table`, the operators of expressions, or those named as the row's ufunc.

    table: {operation: function}, where the library's has another name or meaning. A row that a program registers is
    translated by its columns `operator` and `ufunc`. Raises GraphError for an operation that the library does not have.
    """

    def function_of(op: Op) -> Callable[..., Any]:
        name = op.ufunc.__name__ if isinstance(op.ufunc, np.ufunc) else op.ufunc
        found: Callable[..., Any] | None = table.get(op.name) or op.operator
        for module in modules if name else ():
            found = found or getattr(module, str(name), None)
        if found is None:
            raise GraphError(
                f"{library} has no operation {op.name!r}: of a row of your own, the column `operator` translates it, "
                f"or `ufunc`, if {library} has a function of that name"
            )
        return found

    return function_of


def require_compiled(what: str, fn: object) -> None:
    """Raise TypeError, saying that the function `what` needs a compiled graph, for anything else."""
    if not isinstance(fn, Compiled):
        hint = "; write cg.compile(graph)" if isinstance(fn, Graph) else ""
        raise TypeError(f"{what} needs a compiled graph, got {type(fn).__name__}: {fn!r:.60}{hint}")


def require_inputs(shape: tuple[int, ...], n_in: int) -> None:
    """Raise GraphError unless points of this shape have a value for each input."""
    if not shape or shape[-1] != n_in:
        raise GraphError(f"x must have shape (..., {n_in}), one value for each input, got {shape}")


@kept_by_first
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
