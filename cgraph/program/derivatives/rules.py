"""The rules of the statements: derivatives of graphs, linear equations, branches, and equations solved by turns."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...core.graph import Graph
from ...core.node import constant
from ...operations.table import maximum, where
from ...writing.naming import variables
from ..statement import Names, Statement, bodies_of, effects, reads_and_writes, with_names
from ..statements.call import Call, Map, Sum, added, copied, elements, sizes
from ..statements.control import FixedPoint, If, While
from ..statements.matrix import Solve
from ..statements.rows import Ends, For, Kind, for_rows, sizes_of
from .jvp import Assignment, Numbers, Passes, Registers, Tangent, split, statements_of, tangent_graph
from .transpose import Adjoint, cotangent_graph

MOST_TURNS = 200.0
STALLS = 3.0  # turns whose change is no smaller than before: the rest is rounding


def _parts(assignment: Assignment, lengths: Mapping[str, int]) -> tuple[Names, Numbers, Numbers]:
    """The shared registers, and how many numbers each input and output has of an element; a call is one."""
    statement = assignment.statement
    inputs, outputs = (tuple([lengths[name] for name in names]) for names in (statement.inputs, statement.outputs))
    if isinstance(statement, Call):
        return (), inputs, outputs
    inputs = (*[lengths[name] for name in statement.shared], *sizes(statement, lengths, statement.inputs))
    if isinstance(statement, Map):
        outputs = sizes(statement, lengths, statement.outputs)
    return statement.shared, inputs, outputs


def push_elements(assignment: Assignment, tangent: Tangent) -> None:
    """y_dot[i] = f'(x[i]) x_dot[i], or their sum."""
    statement, (shared, lengths, outputs) = assignment.statement, _parts(assignment, tangent.lengths)
    names, first = (*shared, *statement.inputs), len(shared)
    moving = tuple([k for k, name in enumerate(names) if name in tangent.dots and tangent.lengths[name]])
    if not moving or tangent.active.isdisjoint(statement.outputs):
        return
    graph, kept = tangent_graph(statement.graph, lengths, moving, outputs)
    if graph is None:
        return
    dots, of_all = tuple([tangent.dots[names[k]] for k in moving]), sum([k < first for k in moving])
    inputs, results = (*statement.inputs, *dots[of_all:]), tuple([tangent.dot(statement.outputs[k]) for k in kept])
    if isinstance(statement, Call):
        tangent.add(Call(graph, inputs, results))
        return
    # what is shared comes first: numbers, their tangents, then those of elements
    which, ends = (*range(len(lengths)), *moving), [*lengths, *[lengths[k] for k in moving]]
    groups = list(zip(which, split(graph.inputs, ends), strict=True))
    nodes = [node for of_each in (False, True) for k, group in groups if (k >= first) == of_each for node in group]
    graph = Graph(nodes, graph.outputs) if first else graph
    tangent.add(replace(statement, graph=graph, inputs=inputs, outputs=results, shared=(*shared, *dots[:of_all])))


def pull_elements(assignment: Assignment, adjoint: Adjoint) -> None:
    """x_bar[i] += f'(x[i])^T y_bar[i]; their sum for a number that all elements share, or of length 1."""
    statement, (shared, lengths, outputs) = assignment.statement, _parts(assignment, adjoint.lengths)
    names, first = (*shared, *statement.inputs), len(shared)
    count = 1 if isinstance(statement, Call) else elements(statement, adjoint.lengths)
    seeded = tuple([k for k, name in enumerate(statement.outputs) if name in adjoint.bars])
    wanted = tuple([k for k, name in enumerate(names) if name in adjoint.active and adjoint.lengths[name]])
    if not seeded or not wanted or not count:
        return
    if isinstance(statement, Map) and statement.asked:
        raise TypeError("a Map of as many elements as are asked for has no cotangents")
    total, rule = adjoint.rules.get(id(statement.graph), (0, None))
    if not isinstance(statement, Call) or total != sum([outputs[k] for k in seeded]):
        rule = None
    graph, kept = cotangent_graph(statement.graph, rule, lengths, wanted, outputs, seeded)
    if graph is None:
        return
    seeds = tuple([adjoint.bars[statement.outputs[k]] for k in seeded])
    if isinstance(statement, Call):
        bars = tuple([adjoint.bar(names[k]) for k in kept])
        adjoint.add(Call(graph, (*names, *(statement.outputs if rule else ()), *seeds), bars))
        for k, bar in zip(kept, bars, strict=True):
            adjoint.collect(names[k], bar)
        return
    nodes, inputs = graph.inputs, (*statement.inputs, *seeds)
    if isinstance(statement, Sum) and any(length > 1 for length in outputs):  # seeds the same for every element
        known, size = sum(lengths[:first]), sum(lengths)
        nodes = (*nodes[:known], *nodes[size:], *nodes[known:size])
        shared, inputs = (*shared, *seeds), statement.inputs
    results, at = list(graph.outputs.values()), 0
    for k in kept:
        one = Graph(nodes, {f"bar{j}": node for j, node in enumerate(results[at : at + lengths[k]])})
        at += lengths[k]
        bar = adjoint.bar(names[k])
        in_all = k < first or adjoint.lengths[names[k]] != count * lengths[k]  # the same number for all elements
        adjoint.add(Sum(one, inputs, (bar,), shared) if in_all else Map(one, inputs, (bar,), shared))
        adjoint.collect(names[k], bar)


def push_factor(assignment: Assignment, tangent: Tangent) -> None:
    """The tangent of the factors is that of the matrix itself, A_dot."""
    (before,), factor = assignment.sources, assignment.statement
    if before in tangent.dots and factor.matrix in tangent.active:
        tangent.dots[factor.matrix] = tangent.dots[before]


def pull_factor(assignment: Assignment, adjoint: Adjoint) -> None:
    """A_bar += the cotangent of the factors."""
    (before,), factor = assignment.sources, assignment.statement
    if factor.matrix in adjoint.bars and before in adjoint.active:
        adjoint.collect(before, adjoint.bars[factor.matrix])


def push_solve(assignment: Assignment, tangent: Tangent) -> None:
    """A x = b: A x_dot = b_dot - A_dot x, and with A^T for A the same."""
    (right,), solve = assignment.sources, assignment.statement
    matrix, side, n = tangent.dots.get(solve.matrix), tangent.dots.get(right), tangent.lengths[solve.vector]
    if matrix is None and side is None:
        return
    dot = tangent.dot(solve.vector)
    tangent.add(copied(side, dot))
    if matrix is not None:
        tangent.add(Call(_less_product(n, solve.transposed), (dot, matrix, solve.vector), (dot,)))
    tangent.add(Solve(solve.matrix, solve.pivots, dot, solve.transposed))  # x_dot = A^-1 (b_dot - A_dot x)


def pull_solve(assignment: Assignment, adjoint: Adjoint) -> None:
    """x = A^-1 b: b_bar = A^-T x_bar, A_bar = -b_bar x^T; of A^T, A_bar = -x b_bar^T."""
    (right,), solve = assignment.sources, assignment.statement
    if solve.vector not in adjoint.bars:
        return
    bar, n = adjoint.bar(right), adjoint.lengths[solve.vector]
    adjoint.add(copied(adjoint.bars[solve.vector], bar))
    adjoint.add(Solve(solve.matrix, solve.pivots, bar, not solve.transposed))  # b_bar = A^-T x_bar
    if solve.matrix in adjoint.active:
        matrix = adjoint.bar(solve.matrix)
        sides = (solve.vector, bar) if solve.transposed else (bar, solve.vector)
        adjoint.add(Call(_outer(n), sides, (matrix,)))
        adjoint.collect(solve.matrix, matrix)
    if right in adjoint.active:
        adjoint.collect(right, bar)


def _less_product(n: int, transposed: bool) -> Graph:
    """b - A x, or b - A^T x."""
    b, x = (variables([f"{name}{k}" for k in range(n)]) for name in "bx")
    a = variables([f"a{k}" for k in range(n * n)])
    at = [[a[n * j + i] if transposed else a[n * i + j] for j in range(n)] for i in range(n)]
    rows = [sum([at[i][j] * x[j] for j in range(n)], constant(0.0)) for i in range(n)]
    return Graph([*b, *a, *x], {f"{i}": b[i] - row for i, row in enumerate(rows)})


def _outer(n: int) -> Graph:
    """-a b^T, row by row."""
    a, b = (variables([f"{name}{k}" for k in range(n)]) for name in "ab")
    return Graph([*a, *b], {f"{i}_{j}": -a[i] * b[j] for i in range(n) for j in range(n)})


def assign_if(statement: If, passes: Passes) -> Assignment:
    """Both bodies from the same registers on; what one of them writes is copied at the end of both."""
    decides, before, parts, ends = passes.now(statement.register), dict(passes.current), [], []
    writes = list(dict.fromkeys([*effects(statement.body)[1], *effects(statement.otherwise)[1]]))
    for body in (statement.body, statement.otherwise):
        passes.current = dict(before)
        parts.append(tuple([passes.assignment(each) for each in body]))
        ends.append([passes.now(name) for name in writes])
    passes.current = before
    at = [passes.write(name) for name in writes]
    after = tuple([dict(zip(at, end, strict=True)) for end in ends])
    ways = [
        (*statements_of(part), *[copied(end, name) for name, end in there.items()])
        for part, there in zip(parts, after, strict=True)
    ]
    return Assignment(If(decides, *ways), parts=tuple(parts), after=after)


def push_if(assignment: Assignment, tangent: Tangent) -> None:
    """The tangents of the branch that is taken."""
    ways = []
    for part, after in zip(assignment.parts, assignment.after, strict=True):
        inner = replace(tangent, dots=dict(tangent.dots))
        inner.push(part)
        ways.append((inner, {name: inner.dots[end] for name, end in after.items() if end in inner.dots}))
    names = [name for name in assignment.after[0] if any([name in found for _, found in ways])]
    _add_if(assignment, tangent, ways, {name: tangent.dot(name) for name in names if name in tangent.active})


def pull_if(assignment: Assignment, adjoint: Adjoint) -> None:
    """The cotangents of the branch that was taken."""
    seeds = {name: adjoint.bars[name] for name in assignment.after[0] if name in adjoint.bars}
    if not seeds:
        return
    ways = []
    for part, after in zip(assignment.parts, assignment.after, strict=True):
        inner = replace(adjoint, bars={after[name]: bar for name, bar in seeds.items()})
        inner.pull(part)
        ways.append((inner, inner.bars))
    inside = {name for part in assignment.parts for each in part for name in reads_and_writes(each.statement)[1]}
    names = dict.fromkeys([name for _, bars in ways for name in bars if name in adjoint.active and name not in inside])
    terms = {name: adjoint.bar(name) for name in names}
    _add_if(assignment, adjoint, ways, terms)
    for name, bar in terms.items():
        adjoint.collect(name, bar)


def _add_if(
    assignment: Assignment, to: Registers, ways: Sequence[tuple[Registers, Mapping[str, str]]], ends: Mapping[str, str]
) -> None:
    """Add both branches, at whose ends what each has found for a register is in that of `ends`, or else 0."""
    bodies = [(*made.statements, *[copied(found.get(name), end) for name, end in ends.items()]) for made, found in ways]
    if ends:
        to.add(If(assignment.statement.register, *bodies))


def assign_fixed_point(statement: FixedPoint, passes: Passes) -> Assignment:
    """The iteration in registers of its own, and one more turn from where it ends, in single assignment."""
    if bad := [each for each in statement.body if bodies_of(each)]:
        raise TypeError(f"a FixedPoint with a {type(bad[0]).__name__} in its turns has no derivatives")
    before = dict(passes.current)
    first, writes = effects(statement.body)
    at = {name: passes.write(name) for name in writes}
    outside = dict(passes.current)
    turn = tuple([passes.assignment(each) for each in statement.body])
    after = {place: passes.now(name) for name, place in at.items()}
    passes.current = outside
    carried = [name for name in dict.fromkeys((*first, statement.register)) if name in at]
    copies = tuple([copied(before.get(name, name), at[name]) for name in carried])
    loop = FixedPoint(passes.now(statement.register), tuple([with_names(each, passes.now) for each in statement.body]))
    return Assignment(loop, copies, (turn,), (after,), tuple([at[name] for name in carried]))


def push_fixed_point(assignment: Assignment, tangent: Tangent) -> None:
    """v_dot = (dT/dv) v_dot + (dT/de) e_dot, iterated as v was."""
    (turn,), (after,) = assignment.parts, assignment.after
    carried = [name for name in assignment.carried if name in tangent.active]
    moving = {name: tangent.fresh(f"{name}_dot", tangent.lengths[name]) for name in carried}
    inner = replace(tangent, dots=tangent.dots | moving)
    inner.push(turn)
    rows = [(dot, None, inner.dots.get(after[name])) for name, dot in moving.items()]
    _add_settled(rows, inner.statements, tangent)
    tangent.dots |= {name: inner.dots[end] for name, end in after.items() if end in inner.dots} | moving


def pull_fixed_point(assignment: Assignment, adjoint: Adjoint) -> None:
    """u = v_bar + (dT/dv)^T u, iterated as v was; then e_bar = (dT/de)^T u."""
    (turn,), (after,) = assignment.parts, assignment.after
    outer = {name: adjoint.bars[name] for name in after if name in adjoint.bars}
    if not outer:
        return
    turning = {name: adjoint.bar(name) for name in assignment.carried if name in adjoint.active}
    inner = replace(adjoint, bars={after[name]: bar for name, bar in {**outer, **turning}.items()})
    inner.pull(turn)
    rows = [(bar, outer.get(name), inner.bars.get(name)) for name, bar in turning.items()]
    _add_settled(rows, inner.statements, adjoint)
    for name, bar in inner.bars.items():
        if name not in after and name not in after.values() and name in adjoint.active:
            adjoint.collect(name, bar)


def _add_settled(
    rows: Sequence[tuple[str, str | None, str | None]], turn: Sequence[Statement], registers: Registers
) -> None:
    """Add u = v + A u for all rows (u, v, the result of A u that a turn leaves), to rounding; None is zero."""
    names = ("going", "turns", "stalled", "change_old", "change", "d", "s")
    going, turns, stalled, old, total, change, size = [registers.fresh(name, 1) for name in names]
    body: list[Statement] = [*turn, Call(Graph([], {"zero": 0.0}), (), (total,))]
    registers.add(*[copied(v, u) for u, v, _ in rows])
    for u, v, result in rows:
        if result is not None:
            new = registers.fresh("new", registers.lengths[u])
            body.append(copied(result, new) if v is None else added(v, result, new))  # u_new = v + A u
            body += [Sum(_SQUARED_CHANGE, (new, u), (change,)), Sum(_SQUARE, (new,), (size,)), copied(new, u)]
            body.append(Call(_SHARE, (total, change, size), (total,)))  # sum of |u_new - u|^2 / |u_new|^2
    state = (old, turns, stalled, registers.unsolved)
    body.append(Call(_JUDGED, (total, *state), (going, *state)))
    registers.add(Call(_BEGUN, (), (going, turns, stalled, old)), While(going, tuple(body)), *turn)


def _kinds(assignment: Assignment) -> tuple[list[Kind], dict[str, str]]:
    """The kinds of rows, and {register that rows change: the one before}, which a row reads that writes there."""
    kinds, before = [], dict(zip(assignment.statement.changed, assignment.sources, strict=True))
    for graph, reads, writes, adds in assignment.statement.kinds:
        own = {end[:2] for end in writes}
        old = [(before[end[0]], *end[1:]) if end[:2] in own else end for end in reads]
        kinds.append((graph, old, writes, adds))
    return kinds, before


def _renamed(ends: Ends, names: Mapping[str, str]) -> Ends:
    return [(names[name], table, length) for name, table, length in ends]


def _rows(statement: For, kinds: Sequence[Kind], changed: Sequence[str]) -> For:
    """The statement with other kinds of rows, which read what their graphs use."""
    made: list[Kind] = []
    for graph, reads, writes, adds in kinds:
        used = {*graph.outputs.values(), *[arg for node in graph.nodes for arg in node.args]}
        groups = zip(split(graph.inputs, sizes_of(reads)), reads, strict=True)
        kept = [(nodes, end) for nodes, end in groups if not used.isdisjoint(nodes)]
        graph = Graph([node for nodes, _ in kept for node in nodes], graph.outputs)
        made.append((graph, [end for _, end in kept], writes, adds))
    return for_rows(made, (statement.kind, statement.count), changed, backwards=statement.backwards)


def push_for(assignment: Assignment, tangent: Tangent) -> None:
    """Each row pushes the tangents of what it reads on to those of what it writes and adds."""
    kinds, before = _kinds(assignment)
    if tangent.active.isdisjoint(before):
        return
    dots = {name: tangent.fresh(f"{name}_dot", tangent.lengths[name]) for name in before}
    tangent.add(*[copied(tangent.dots.get(before[name]), dot) for name, dot in dots.items()])
    tangent.dots |= {name: dot for name, dot in dots.items() if name in tangent.active}
    rows: list[Kind] = []
    for graph, reads, writes, adds in kinds:
        moving = tuple([k for k, end in enumerate(reads) if end[0] in tangent.dots])
        made = tangent_graph(graph, sizes_of(reads), moving, (len(graph.outputs),))[0] if moving else None
        made = made or Graph([], dict.fromkeys(graph.outputs, 0.0))
        along = [*reads, *_renamed([reads[k] for k in moving], tangent.dots)]
        rows.append((made, along, _renamed(writes, dots), _renamed(adds, dots)))
    tangent.add(_rows(assignment.statement, rows, [*dots.values()]))


def pull_for(assignment: Assignment, adjoint: Adjoint) -> None:
    """Each row, the last first, adds to cotangents of what it reads; what was written over has had no influence."""
    statement, (kinds, before) = assignment.statement, _kinds(assignment)
    if adjoint.bars.keys().isdisjoint(before):
        return
    bars = {name: adjoint.bar(name) for name in before}
    old = {name: adjoint.bar(name) for name in before if any(name == end[0] for kind in kinds for end in kind[2])}
    idle = adjoint.fresh("idle", 1)
    nothing: Kind = (Graph([], {"zero": 0.0}), [], [], [(idle, "", 1)])  # of a row without a result
    rows, overwritten = list[Kind](), list[Kind]()
    for graph, reads, writes, adds in kinds:
        ends, zeros = [*writes, *adds], {f"{k}": 0.0 for k in range(sum(sizes_of(writes)))}
        wanted = tuple([k for k, (name, *_) in enumerate(reads) if name in adjoint.active])
        sizes, seeded = (sizes_of(reads), sizes_of(ends)), tuple(range(len(ends)))
        pulled, kept = cotangent_graph(graph, None, sizes[0], wanted, sizes[1], seeded) if wanted else (None, ())
        bars |= {name: adjoint.bar(name) for name in dict.fromkeys([reads[k][0] for k in kept]) if name not in bars}
        results = _renamed([reads[k] for k in kept], bars)
        rows.append((pulled, [*reads, *_renamed(ends, bars)], [], results) if pulled else nothing)
        overwritten.append((Graph([], zeros), [], _renamed(writes, old), []) if zeros else nothing)
    adjoint.add(*[copied(adjoint.bars.get(name) if name in before else None, bar) for name, bar in bars.items()])
    adjoint.add(replace(_rows(statement, rows, [*bars.values(), idle]), backwards=not statement.backwards))
    adjoint.add(*[copied(bars[name], bar) for name, bar in old.items()])
    adjoint.add(*([_rows(statement, overwritten, [*old.values(), idle])] if old else []))
    for name, bar in (bars | old).items():
        if (source := before.get(name, name)) in adjoint.active:
            adjoint.collect(source, bar)


_A, _B = variables("a b")
_SQUARED_CHANGE = Graph([_A, _B], {"square": (_A - _B) * (_A - _B)})
_SQUARE = Graph([_A], {"square": _A * _A})
_TOTAL, _CHANGE, _SIZE = variables("total change size")
_SHARE = Graph([_TOTAL, _CHANGE, _SIZE], {"total": _TOTAL + where(_SIZE, _CHANGE / _SIZE, 0.0)})
_BEGUN = Graph([], {"going": 1.0, "turns": 0.0, "stalled": 0.0, "old": math.inf})


def _judge() -> Graph:
    change, old, turns, stalled, unsolved = inputs = variables("change old turns stalled unsolved")
    stalls = stalled + (1.0 - (change < old))
    most = turns + 1.0 >= MOST_TURNS
    going = (stalls < STALLS) * (change > 0.0) * (1.0 - most)
    lost = 1.0 - (change < math.inf)
    unsolved = unsolved + maximum(lost, most * (stalls < STALLS))
    outputs = {"going": going, "old": change, "turns": turns + 1.0, "stalled": stalls, "unsolved": unsolved}
    return Graph(inputs, outputs)


_JUDGED = _judge()
