"""Translation: nodes as expressions of other software, operation by operation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cgraph import Node

from .case import Case
from .contender import UnavailableError


def translated(
    order: Sequence[Node],
    env: Mapping[Node, Any],
    functions: Any,
    names: Mapping[str, str] | None = None,
    number: Callable[[float], Any] = float,
) -> dict[Node, Any]:
    """Every node of a topological order as an expression, from those of the variables in `env`.

    functions: the module that has sin, cos, ..., by the names of our operations or those in `names`.
    number: makes a constant.  Raises UnavailableError for an operation that the module does not have.
    """
    result = dict(env)
    for node in order:
        if node in result:
            continue
        if node.value is not None:
            result[node] = number(node.value)
            continue
        name = node.op.name
        function: Any = node.op.operator
        function = function or getattr(functions, (names or {}).get(name, name), None)
        if function is None:
            raise UnavailableError(f"has no operation {name!r}")
        result[node] = function(*[result[arg] for arg in node.args])
    return result


def lagrangian(
    case: Case,
    q: Sequence[Any],
    qd: Sequence[Any],
    functions: Any,
    names: Mapping[str, str] | None = None,
    number: Callable[[float], Any] = float,
) -> tuple[Any, list[Any]]:
    """L and the applied forces at q and qd, without damping, in the other software's expressions."""
    system = case.system
    env = dict(zip([*system.q, *system.qd], [*q, *qd], strict=True))
    env |= {node: number(system.parameters[str(node.name)]) for node in system.extra_inputs}
    values = translated(case.order, env, functions, names, number)
    return values[system.lagrangian], [values[force] for force in system.forces]
