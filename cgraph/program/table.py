"""The table of statements: a row each."""

from __future__ import annotations

from .derivatives import call_rules, control_rules, fixed_point_rules, matrix_rules, memory_rules
from .statement import StatementRow, register_statement
from .statements import call, control, matrix, memory

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
        jvp=call_rules.push_call,
        transpose=call_rules.pull_call,
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
            jvp=call_rules.push_elements,
            transpose=call_rules.pull_elements,
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
        jvp=matrix_rules.push_factor,
        transpose=matrix_rules.pull_factor,
    ),
    StatementRow(
        matrix.Solve,
        reads=("matrix", "pivots", "vector"),
        writes=("vector",),
        run=matrix.run_solve,
        check=matrix.check_matrix,
        text=matrix.solve_text,
        jvp=matrix_rules.push_solve,
        transpose=matrix_rules.pull_solve,
    ),
    StatementRow(
        control.If,
        reads=("register",),
        writes=(),
        run=control.run_if,
        check=control.check_control,
        bodies=("body", "otherwise"),
        text=control.if_text,
        assign=control_rules.assign_if,
        jvp=control_rules.push_if,
        transpose=control_rules.pull_if,
    ),
    StatementRow(
        control.While,
        reads=("register",),
        writes=(),
        run=control.run_while,
        check=control.check_control,
        bodies=("body",),
        text=control.while_text,
        assign=control_rules.assign_while,
        jvp=control_rules.push_while,
        transpose=control_rules.pull_while,
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
        assign=fixed_point_rules.assign_fixed_point,
        jvp=fixed_point_rules.push_fixed_point,
        transpose=fixed_point_rules.pull_fixed_point,
    ),
    StatementRow(
        memory.Take,
        reads=("source",),
        writes=("target",),
        run=memory.run_take,
        check=memory.check_take,
        text=memory.take_text,
        beside=memory.take_beside,
        jvp=memory_rules.push_take,
        transpose=memory_rules.pull_take,
    ),
    StatementRow(
        memory.Push,
        reads=("stack", "count", "rows"),
        writes=("stack", "count"),
        run=memory.run_push,
        check=memory.check_stack,
        text=memory.push_text,
        jvp=memory_rules.push_push,
        transpose=memory_rules.pull_push,
    ),
    StatementRow(
        memory.Pop,
        reads=("stack", "count"),
        writes=("count", "rows"),
        run=memory.run_pop,
        check=memory.check_stack,
        text=memory.pop_text,
        jvp=memory_rules.push_pop,
        transpose=memory_rules.pull_pop,
    ),
]
for _row in ROWS:
    register_statement(_row)
