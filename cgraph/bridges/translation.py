"""Translation: nodes as expressions of another library, operation by operation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ..core.checks import GraphError
from ..core.node import Node
from ..operations.operation import Op, columns

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
