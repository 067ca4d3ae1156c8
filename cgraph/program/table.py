"""The table of statements: a row each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
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


# fmt: off   (a table is read by columns: kind, reads, writes, in Python, check; as machine code, side by side; more)
MAP = StatementRow(
    call.Map,
    ("shared", "inputs", "asked"),
    ("outputs",),
    call.run_map,
    call.check_elements,
    graph="graph",
    text=call.map_text,
    beside=call.elements_beside,
    **_derivatives("call_rules", "elements"),
)
WHILE = StatementRow(
    control.While,
    ("register",),
    (),
    control.run_while,
    control.check_control,
    bodies=("body",),
    text=control.while_text,
    beside=control.run_while,
    masked=_later("many", "masked_while"),
    assign=_later("derivatives.control_rules", "assign_while"),
    reruns=True,
    **_derivatives("control_rules", "while"),
)
ROWS = [
    StatementRow(
        call.Call,
        ("inputs",),
        ("outputs",),
        call.run_call,
        call.check_call,
        graph="graph",
        text=call.call_text,
        beside=call.call_beside,
        **_derivatives("call_rules", "call", "elements"),
    ),
    MAP,
    replace(MAP, kind=call.Sum, reads=("shared", "inputs"), run=call.run_sum, text=call.sum_text),
    StatementRow(
        matrix.Factor,
        ("matrix",),
        ("matrix", "pivots"),
        matrix.run_factor,
        matrix.check_matrix,
        text=matrix.factor_text,
        beside=matrix.run_factor,
        **_derivatives("matrix_rules", "factor"),
    ),
    StatementRow(
        matrix.Solve,
        ("matrix", "pivots", "vector"),
        ("vector",),
        matrix.run_solve,
        matrix.check_matrix,
        text=matrix.solve_text,
        beside=matrix.run_solve,
        **_derivatives("matrix_rules", "solve"),
    ),
    StatementRow(
        control.If,
        ("register",),
        (),
        control.run_if,
        control.check_control,
        bodies=("body", "otherwise"),
        text=control.if_text,
        beside=control.run_if,
        masked=_later("many", "masked_if"),
        assign=_later("derivatives.control_rules", "assign_if"),
        **_derivatives("control_rules", "if"),
    ),
    WHILE,
    replace(  # with the derivative of its equations in place of its turns
        WHILE,
        kind=control.FixedPoint,
        assign=_later("derivatives.fixed_point_rules", "assign_fixed_point"),
        reruns=False,
        **_derivatives("fixed_point_rules", "fixed_point"),
    ),
    StatementRow(
        memory.Take,
        ("source",),
        ("target",),
        memory.run_take,
        memory.check_take,
        text=memory.take_text,
        beside=memory.run_take,
        **_derivatives("memory_rules", "take", "moved"),
    ),
    StatementRow(
        memory.Push,
        ("stack", "count", "rows"),
        ("stack", "count"),
        memory.run_push,
        memory.check_stack,
        text=memory.push_text,
        beside=memory.run_push,
        masked=_later("many", "masked_push"),
        **_derivatives("memory_rules", "push", "moved"),
    ),
    StatementRow(
        memory.Pop,
        ("stack", "count"),
        ("count", "rows"),
        memory.run_pop,
        memory.check_stack,
        text=memory.pop_text,
        beside=memory.run_pop,
        **_derivatives("memory_rules", "pop", "moved"),
    ),
    StatementRow(
        memory.Scatter,
        ("source", "target"),
        ("target",),
        memory.run_scatter,
        memory.check_scatter,
        text=memory.scatter_text,
        beside=memory.run_scatter,
        **_derivatives("memory_rules", "scatter", "moved"),
    ),
]
# fmt: on
for _row in ROWS:
    register_statement(_row)
