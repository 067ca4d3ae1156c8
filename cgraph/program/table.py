"""The table of statements: a row each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

from .statement import StatementRow, register_statement
from .statements import call, control, matrix, memory, tiles


def _later(file: str, name: str) -> Callable[..., Any]:
    """A rule that is loaded when it is first asked for: most runs have no derivatives, and one memory."""

    def rule(*arguments: Any) -> Any:
        return getattr(import_module(f"{__package__}.{file}"), name)(*arguments)

    return rule


WHILE = StatementRow(
    control.While,
    reads=("register",),
    writes=(),
    run=control.run_while,
    check=control.check_control,
    bodies=("body",),
    text=control.while_text,
    beside=control.while_beside,
    masked=_later("many", "masked_while"),
    assign=_later("derivatives.control_rules", "assign_while"),
    jvp=_later("derivatives.control_rules", "push_while"),
    transpose=_later("derivatives.control_rules", "pull_while"),
    reruns=True,
)
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
        jvp=_later("derivatives.call_rules", "push_call"),
        transpose=_later("derivatives.call_rules", "pull_call"),
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
            jvp=_later("derivatives.call_rules", "push_elements"),
            transpose=_later("derivatives.call_rules", "pull_elements"),
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
        jvp=_later("derivatives.matrix_rules", "push_factor"),
        transpose=_later("derivatives.matrix_rules", "pull_factor"),
    ),
    StatementRow(
        matrix.Solve,
        reads=("matrix", "pivots", "vector"),
        writes=("vector",),
        run=matrix.run_solve,
        check=matrix.check_matrix,
        text=matrix.solve_text,
        beside=matrix.solve_beside,
        jvp=_later("derivatives.matrix_rules", "push_solve"),
        transpose=_later("derivatives.matrix_rules", "pull_solve"),
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
        masked=_later("many", "masked_if"),
        assign=_later("derivatives.control_rules", "assign_if"),
        jvp=_later("derivatives.control_rules", "push_if"),
        transpose=_later("derivatives.control_rules", "pull_if"),
    ),
    WHILE,
    replace(
        WHILE,  # with the derivative of its equations in place of its turns
        kind=control.FixedPoint,
        assign=_later("derivatives.fixed_point_rules", "assign_fixed_point"),
        jvp=_later("derivatives.fixed_point_rules", "push_fixed_point"),
        transpose=_later("derivatives.fixed_point_rules", "pull_fixed_point"),
        reruns=False,
    ),
    StatementRow(
        memory.Take,
        reads=("source",),
        writes=("target",),
        run=memory.run_take,
        check=memory.check_take,
        text=memory.take_text,
        beside=memory.take_beside,
        jvp=_later("derivatives.memory_rules", "push_take"),
        transpose=_later("derivatives.memory_rules", "pull_take"),
    ),
    StatementRow(
        memory.Push,
        reads=("stack", "count", "rows"),
        writes=("stack", "count"),
        run=memory.run_push,
        check=memory.check_stack,
        text=memory.push_text,
        beside=memory.push_beside,
        masked=_later("many", "masked_push"),
        jvp=_later("derivatives.memory_rules", "push_push"),
        transpose=_later("derivatives.memory_rules", "pull_push"),
    ),
    StatementRow(
        memory.Pop,
        reads=("stack", "count"),
        writes=("count", "rows"),
        run=memory.run_pop,
        check=memory.check_stack,
        text=memory.pop_text,
        beside=memory.pop_beside,
        jvp=_later("derivatives.memory_rules", "push_pop"),
        transpose=_later("derivatives.memory_rules", "pull_pop"),
    ),
    StatementRow(
        tiles.TiledMap,
        reads=("shared", "inputs", "tiles", "outputs"),
        writes=("outputs",),
        run=tiles.run_tiled_map,
        check=tiles.check_tiled_map,
        graph="graph",
        text=tiles.tiled_map_text,
        beside=tiles.run_tiled_map,
        jvp=_later("derivatives.tile_rules", "push_tiled_map"),
        transpose=_later("derivatives.tile_rules", "pull_tiled_map"),
    ),
    StatementRow(
        tiles.Scatter,
        reads=("source", "target"),
        writes=("target",),
        run=tiles.run_scatter,
        check=tiles.check_scatter,
        text=tiles.scatter_text,
        beside=tiles.run_scatter,
        jvp=_later("derivatives.tile_rules", "push_scatter"),
        transpose=_later("derivatives.tile_rules", "pull_scatter"),
    ),
]
for _row in ROWS:
    register_statement(_row)
