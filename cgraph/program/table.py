"""The table of statements: a row each."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from .statement import StatementRow, register_statement
from .statements import call, control, matrix


def _rules(kind: str, **columns: str) -> dict[str, Any]:
    """The rules `push_kind` and `pull_kind`, and others, which are loaded when they are first asked for."""

    def later(name: str) -> Callable[..., Any]:
        return lambda *arguments: getattr(import_module(f"{__package__}.derivatives.rules"), name)(*arguments)

    return {column: later(f"{verb}_{kind}") for column, verb in {"jvp": "push", "transpose": "pull", **columns}.items()}


# fmt: off
ROWS = [  # read by columns: kind, reads, writes; in Python, check; as machine code; of many memories; more
    StatementRow(
        call.Call, ("inputs",), ("outputs",), call.run_call, call.check_call,
        text=call.call_text, beside=call.call_beside, graph="graph", **_rules("elements"),
    ),
    StatementRow(
        call.Map, ("shared", "inputs", "asked"), ("outputs",), call.run_map, call.check_elements,
        text=call.map_text, beside=call.elements_beside, graph="graph", **_rules("elements"),
    ),
    StatementRow(
        call.Sum, ("shared", "inputs"), ("outputs",), call.run_sum, call.check_elements,
        text=call.sum_text, beside=call.elements_beside, graph="graph", **_rules("elements"),
    ),
    StatementRow(
        matrix.Factor, ("matrix",), ("matrix", "pivots"), matrix.run_factor, matrix.check_matrix,
        text=matrix.factor_text, beside=matrix.run_factor, **_rules("factor"),
    ),
    StatementRow(
        matrix.Solve, ("matrix", "pivots", "vector"), ("vector",), matrix.run_solve, matrix.check_matrix,
        text=matrix.solve_text, beside=matrix.run_solve, **_rules("solve"),
    ),
    StatementRow(
        matrix.Scatter, ("source", "target"), ("target",), matrix.run_scatter,
        text=matrix.scatter_text, beside=matrix.run_scatter,
    ),
    StatementRow(
        control.If, ("register",), (), control.run_if, control.check_control, bodies=("body", "otherwise"),
        text=control.if_text, beside=control.run_if, **_rules("if", assign="assign"),
    ),
    StatementRow(
        control.While, ("register",), (), control.run_while, control.check_control, bodies=("body",),
        text=control.while_text, beside=control.run_while,
    ),
    StatementRow(  # with the derivative of its equations in place of its turns
        control.FixedPoint, ("register",), (), control.run_while, control.check_control, bodies=("body",),
        text=control.while_text, beside=control.run_while, **_rules("fixed_point", assign="assign"),
    ),
]
# fmt: on
for _row in ROWS:
    register_statement(_row)
