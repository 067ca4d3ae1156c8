"""Translation: nodes as expressions of other software, operation by operation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import cgraph as cg
from cgraph import Node
from cgraph.bridges.translation import translated as expressions
from cgraph.extend import Builder, Op, topological
from tests.bench.peers.peer import PeerModel, UnavailableError

Expression = TypeVar("Expression")
Constant = Callable[[float], Any]  # of an expression


def translated(
    order: Sequence[Node],
    env: Mapping[Node, Expression],
    functions: object,
    names: Mapping[str, str] | None = None,
    number: Constant = float,
) -> dict[Node, Expression]:
    """Every node of a topological order as an expression, from those of the variables in `env`.

    functions: the module that has sin, cos, ..., by the names of our operations or those in `names`.
    number: makes a constant.  Raises UnavailableError for an operation that the module does not have.
    """

    def function_of(op: Op) -> Callable[..., Any]:
        found = op.operator or getattr(functions, (names or {}).get(op.name, op.name), None)
        if found is None:
            raise UnavailableError(f"has no operation {op.name!r}")
        return found

    return expressions(order, env, function_of, number)


def lagrangian(
    case: PeerModel,
    q: Sequence[Expression],
    qd: Sequence[Expression],
    functions: object,
    names: Mapping[str, str] | None = None,
    number: Constant = float,
) -> tuple[Expression, list[Expression]]:
    """L and the applied forces at q and qd, without damping, in the other software's expressions."""
    system = case.system
    env = dict(zip([*system.q, *system.qd], [*q, *qd], strict=True))
    env |= {node: number(system.parameters[str(node.name)]) for node in system.extra_inputs}
    values = translated(case.order, env, functions, names, number)
    return values[system.lagrangian], [values[force] for force in system.forces]


def quasi_velocities(
    case: PeerModel,
    q: Sequence[Expression],
    qd: Sequence[Expression],
    momenta: Sequence[Expression],
    functions: object,
    names: Mapping[str, str] | None = None,
    number: Constant = float,
) -> tuple[list[Expression], list[Expression]]:
    """The rates of the coordinates, G(q) qd, and what brackets of velocities take of the force, ad(qd; p)."""
    kinematics = case.system.kinematics
    p = cg.variables([f"p{i}" for i in range(case.n)])
    taken = kinematics.structure(p, Builder())
    env = dict(zip([*case.system.q, *case.system.qd, *p], [*q, *qd, *momenta], strict=True))
    values = translated(topological([*kinematics.q_dot, *taken]), env, functions, names, number)
    return [values[rate] for rate in kinematics.q_dot], [values[term] for term in taken]
