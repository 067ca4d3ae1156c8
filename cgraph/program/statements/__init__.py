"""The kinds of statements, and their table: a row each."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..statement import StatementRow, register_statement
from . import call, control, matrix, rows


def _rules(kind: str, **columns: str) -> dict[str, Any]:
    """The rules `push_kind` and `pull_kind`, and others, which are loaded when they are first asked for."""

    def later(name: str) -> Callable[..., Any]:
        return lambda *arguments: getattr(import_module("..derivatives.rules", __package__), name)(*arguments)

    return {column: later(f"{verb}_{kind}") for column, verb in {"jvp": "push", "transpose": "pull", **columns}.items()}


# fmt: off
ROWS = [  # kind, reads, writes; in Python, check, bodies; as machine code, of many memories; derivatives
    StatementRow(call.Call, ("inputs",), ("outputs",), call.run_call, call.check_call, (), "graph",
                 call.call_text, call.call_beside, **_rules("elements")),
    StatementRow(call.Map, ("shared", "inputs", "asked"), ("outputs",), call.run_map, call.check_elements, (), "graph",
                 call.map_text, call.elements_beside, **_rules("elements")),
    StatementRow(call.Sum, ("shared", "inputs"), ("outputs",), call.run_sum, call.check_elements, (), "graph",
                 call.sum_text, call.elements_beside, **_rules("elements")),
    StatementRow(matrix.Factor, ("matrix",), ("matrix", "pivots"), matrix.run_factor, matrix.check_matrix,
                 text=matrix.factor_text, beside=matrix.run_factor, **_rules("factor")),
    StatementRow(matrix.Solve, ("matrix", "pivots", "vector"), ("vector",), matrix.run_solve, matrix.check_matrix,
                 text=matrix.solve_text, beside=matrix.run_solve, **_rules("solve")),
    StatementRow(matrix.Scatter, ("source", "target"), ("target",), matrix.run_scatter,
                 text=matrix.scatter_text, beside=matrix.run_scatter),
    StatementRow(rows.For, ("kind", "count", "tables", "inputs", "changed"), ("changed",), rows.run_for, rows.check_for,
                 (), "graphs", rows.for_text, rows.run_for, **_rules("for")),
    StatementRow(control.If, ("register",), (), control.run_if, control.check_control, ("body", "otherwise"), "",
                 control.if_text, control.run_if, **_rules("if", assign="assign")),
    StatementRow(control.While, ("register",), (), control.run_while, control.check_control, ("body",), "",
                 control.while_text, control.run_while),
    StatementRow(control.FixedPoint, ("register",), (), control.run_while, control.check_control, ("body",), "",
                 control.while_text, control.run_while, **_rules("fixed_point", assign="assign")),
]
# fmt: on
for _row in ROWS:
    register_statement(_row)
