"""The table of statements: a row each."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from .masks import masked_if, masked_push, masked_while
from .statement import StatementRow, register_statement
from .statements import call, control, matrix, memory


def _later(file: str, name: str) -> Callable[..., Any]:
    """A rule of `derivatives`, which is loaded when it is first asked for: most runs have no derivatives."""

    def rule(*arguments: Any) -> Any:
        return getattr(import_module(f"{__package__}.derivatives.{file}"), name)(*arguments)

    return rule


ROWS = [
    StatementRow(
        call.Call,
        reads=("inputs",),
        writes=("outputs",),
        run=call.run_call,
        check=call.check_call,
        graph="graph",
        text=call.call_text,
        beside=call.call_beside,
        jvp=_later("call_rules", "push_call"),
        transpose=_later("call_rules", "pull_call"),
    ),
    *[
        StatementRow(
            kind,
            reads=("shared", "inputs"),
            writes=("outputs",),
            run=run,
            check=call.check_elements,
            graph="graph",
            text=text,
            beside=call.elements_beside,
            jvp=_later("call_rules", "push_elements"),
            transpose=_later("call_rules", "pull_elements"),
        )
        for kind, run, text in ((call.Map, call.run_map, call.map_text), (call.Sum, call.run_sum, call.sum_text))
    ],
    StatementRow(
        matrix.Factor,
        reads=("matrix",),
        writes=("matrix", "pivots"),
        run=matrix.run_factor,
        check=matrix.check_matrix,
        text=matrix.factor_text,
        beside=matrix.factor_beside,
        jvp=_later("matrix_rules", "push_factor"),
        transpose=_later("matrix_rules", "pull_factor"),
    ),
    StatementRow(
        matrix.Solve,
        reads=("matrix", "pivots", "vector"),
        writes=("vector",),
        run=matrix.run_solve,
        check=matrix.check_matrix,
        text=matrix.solve_text,
        beside=matrix.solve_beside,
        jvp=_later("matrix_rules", "push_solve"),
        transpose=_later("matrix_rules", "pull_solve"),
    ),
    StatementRow(
        control.If,
        reads=("register",),
        writes=(),
        run=control.run_if,
        check=control.check_control,
        bodies=("body", "otherwise"),
        text=control.if_text,
        beside=control.if_beside,
        masked=masked_if,
        assign=_later("control_rules", "assign_if"),
        jvp=_later("control_rules", "push_if"),
        transpose=_later("control_rules", "pull_if"),
    ),
    StatementRow(
        control.While,
        reads=("register",),
        writes=(),
        run=control.run_while,
        check=control.check_control,
        bodies=("body",),
        text=control.while_text,
        beside=control.while_beside,
        masked=masked_while,
        assign=_later("control_rules", "assign_while"),
        jvp=_later("control_rules", "push_while"),
        transpose=_later("control_rules", "pull_while"),
        reruns=True,
    ),
    StatementRow(
        control.FixedPoint,
        reads=("register",),
        writes=(),
        run=control.run_while,
        check=control.check_control,
        bodies=("body",),
        text=control.while_text,
        beside=control.while_beside,
        masked=masked_while,
        assign=_later("fixed_point_rules", "assign_fixed_point"),
        jvp=_later("fixed_point_rules", "push_fixed_point"),
        transpose=_later("fixed_point_rules", "pull_fixed_point"),
    ),
    StatementRow(
        memory.Take,
        reads=("source",),
        writes=("target",),
        run=memory.run_take,
        check=memory.check_take,
        text=memory.take_text,
        beside=memory.take_beside,
        jvp=_later("memory_rules", "push_take"),
        transpose=_later("memory_rules", "pull_take"),
    ),
    StatementRow(
        memory.Push,
        reads=("stack", "count", "rows"),
        writes=("stack", "count"),
        run=memory.run_push,
        check=memory.check_stack,
        text=memory.push_text,
        beside=memory.push_beside,
        masked=masked_push,
        jvp=_later("memory_rules", "push_push"),
        transpose=_later("memory_rules", "pull_push"),
    ),
    StatementRow(
        memory.Pop,
        reads=("stack", "count"),
        writes=("count", "rows"),
        run=memory.run_pop,
        check=memory.check_stack,
        text=memory.pop_text,
        beside=memory.pop_beside,
        jvp=_later("memory_rules", "push_pop"),
        transpose=_later("memory_rules", "pull_pop"),
    ),
]
for _row in ROWS:
    register_statement(_row)
