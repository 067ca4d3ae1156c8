"""The table of statements: a row each."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from .statement import StatementRow, register_statement
from .statements import call, control, matrix, memory


def _later(file: str, name: str) -> Callable[..., Any]:
    """A rule that is loaded when it is first asked for: most runs have no derivatives, and one memory."""

    def rule(*arguments: Any) -> Any:
        return getattr(import_module(f"{__package__}.{file}"), name)(*arguments)

    return rule


def _derivatives(file: str, kind: str, push: str = "") -> dict[str, Any]:
    """The rules `push_kind`, or another, and `pull_kind` of a file."""
    file = f"derivatives.{file}"
    return {"jvp": _later(file, f"push_{push or kind}"), "transpose": _later(file, f"pull_{kind}")}


def _bodies(file: str, kind: str, masked: str, **more: Any) -> dict[str, Any]:
    """Rules of a statement with bodies."""
    rules = _derivatives(file, kind)
    return {
        **rules,
        "assign": _later(f"derivatives.{file}", f"assign_{kind}"),
        "masked": _later("many", masked),
        **more,
    }


# fmt: off
ROWS = [  # read by columns: kind, reads, writes; in Python, check; as machine code; of many memories; more
    StatementRow(
        call.Call, ("inputs",), ("outputs",), call.run_call, call.check_call,
        text=call.call_text, beside=call.call_beside, graph="graph", **_derivatives("call_rules", "elements"),
    ),
    StatementRow(
        call.Map, ("shared", "inputs", "asked"), ("outputs",), call.run_map, call.check_elements,
        text=call.map_text, beside=call.elements_beside, graph="graph", **_derivatives("call_rules", "elements"),
    ),
    StatementRow(
        call.Sum, ("shared", "inputs"), ("outputs",), call.run_sum, call.check_elements,
        text=call.sum_text, beside=call.elements_beside, graph="graph", **_derivatives("call_rules", "elements"),
    ),
    StatementRow(
        matrix.Factor, ("matrix",), ("matrix", "pivots"), matrix.run_factor, matrix.check_matrix,
        text=matrix.factor_text, beside=matrix.run_factor, **_derivatives("linear_rules", "factor"),
    ),
    StatementRow(
        matrix.Solve, ("matrix", "pivots", "vector"), ("vector",), matrix.run_solve, matrix.check_matrix,
        text=matrix.solve_text, beside=matrix.run_solve, **_derivatives("linear_rules", "solve"),
    ),
    StatementRow(
        control.If, ("register",), (), control.run_if, control.check_control, bodies=("body", "otherwise"),
        text=control.if_text, beside=control.run_if, **_bodies("control_rules", "if", "masked_if"),
    ),
    StatementRow(
        control.While, ("register",), (), control.run_while, control.check_control, bodies=("body",), reruns=True,
        text=control.while_text, beside=control.run_while, **_bodies("control_rules", "while", "masked_while"),
    ),
    StatementRow(  # with the derivative of its equations in place of its turns
        control.FixedPoint, ("register",), (), control.run_while, control.check_control, bodies=("body",),
        text=control.while_text, beside=control.run_while,
        **_bodies("control_rules", "fixed_point", "masked_while"),
    ),
    StatementRow(
        memory.Take, ("source",), ("target",), memory.run_numbers, memory.check_numbers,
        text=memory.numbers_text, beside=memory.run_numbers, **_derivatives("linear_rules", "take", "moved"),
    ),
    StatementRow(
        memory.Scatter, ("source", "target"), ("target",), memory.run_numbers, memory.check_numbers,
        text=memory.numbers_text, beside=memory.run_numbers, **_derivatives("linear_rules", "scatter", "moved"),
    ),
    StatementRow(
        memory.Push, ("stack", "count", "rows"), ("stack", "count"), memory.run_stack, memory.check_stack,
        text=memory.stack_text, beside=memory.run_stack, masked=_later("many", "masked_push"),
        **_derivatives("linear_rules", "push", "moved"),
    ),
    StatementRow(
        memory.Pop, ("stack", "count"), ("count", "rows"), memory.run_stack, memory.check_stack,
        text=memory.stack_text, beside=memory.run_stack, **_derivatives("linear_rules", "pop", "moved"),
    ),
]
# fmt: on
for _row in ROWS:
    register_statement(_row)
