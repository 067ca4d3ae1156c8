"""Step: one step of a method as formulas over registers, of which equal and chosen steps and derivatives are made."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import STATEMENTS, Call, Factor, FixedPoint, Map, Statement, Sum, While, copied, effects

from .problem import Problem

# What a step may read of a run; in equal steps and derivatives, which have no tolerance, the others are 0.
STATES = ("x", "x_new", "atol")
SHARED = (*STATES, *"t h p rtol leap next end evaluations error at_limit accepted".split())
Values = Mapping[str, Node | float | Sequence[Node | float]]
Rule = Callable[..., Values]


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a method: from the state x at t, of the length h, to x_new, and what is known of it besides.

    It is statements over registers. Every step has x (m), x_new (m), t, h and p, the values of the problem's
    parameters, and may set others under any name. Whether it is accepted, how long the next one is, which forces act in
    it and what its derivatives are is the business of `equal`, `chosen` and `dyn.gradient`.

    Parameters
    ----------
    lengths : dict, optional
        Of registers of its own, where its statements do not tell: such as those of one `Call` that sets several.
    body : sequence of Statement
        x_new of x, t, h, p and what comes before.
    rates : sequence of Statement, optional
        Before all else, from x, t and p.
    prepare : sequence of Statement, optional
        Before the body, after `rates`: done once for a state, however many lengths are tried from it.
    start : sequence of Statement, optional
        Before the first step.
    kept : sequence of Statement, optional
        After an accepted step, with x still the state before: what the next one reads, such as a guess. Its value must
        not matter where a step starts anew: applied forces may change between two steps.
    fixed : tuple of str, optional
        Registers whose values have no derivatives: guesses, roundings, matrices of an iteration.
    failed : str, optional
        A register that is not 0 after a step whose equations were not solved. Equations are solved by a `FixedPoint`,
        to the tolerance of register rtol, and to rounding where that is 0.
    error : sequence of Statement, optional
        After the body: the estimated error of x_new in register `error`, 1 at the tolerance; see
        `step_control.measured`. Without it steps cannot be chosen.
    estimate : int, optional
        q, where the estimate falls as h^q.
    handed : sequence of Statement, optional
        After an accepted step that was chosen, in place of `rates` before the next: the same from what `error` knows;
        none, but not None, where `error` leaves it where `rates` does.
    dense : sequence of Statement, optional
        After an accepted step: registers dense1, dense2, .. (m), with x(t + s h) = x + sum_k dense_k s^k. Without it
        the cubic through states and rates at both ends.
    dense_lengths : dict, optional
        As `lengths`, of those that only `dense` needs.

    Examples
    --------
    Heun's method, which goes by the mean of the slopes at both ends:

    >>> import dynamics as dyn
    >>> from cgraph.extend import Call
    >>> from dynamics.integrators import Method, Step, call, each
    >>> def heun(problem):
    ...     return Step(
    ...         rates=[Call(problem.rate, ("x", "t", "p"), ("slope",))],
    ...         body=[
    ...             each(lambda x, h, slope: {"at": x + h * slope}),
    ...             call(lambda t, h: {"end": t + h}),
    ...             Call(problem.rate, ("at", "end", "p"), ("slope_at_end",)),
    ...             each(lambda x, h, slope, slope_at_end: {"x_new": x + h * (slope + slope_at_end) / 2}),
    ...         ],
    ...     )
    >>> dyn.METHODS["heun"] = Method(2, heun)
    >>> decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    >>> dyn.simulate(decay, [1.0], None, 1.0, "heun", dt=0.01).q[-1].round(4)
    array([0.3679])
    >>> del dyn.METHODS["heun"]
    """

    lengths: Mapping[str, int] = field(default_factory=dict)
    body: Sequence[Statement] = ()
    rates: Sequence[Statement] = ()
    prepare: Sequence[Statement] = ()
    start: Sequence[Statement] = ()
    kept: Sequence[Statement] = ()
    fixed: tuple[str, ...] = ()
    failed: str = ""
    error: Sequence[Statement] = ()
    estimate: int = 0
    handed: Sequence[Statement] | None = None
    dense: Sequence[Statement] = ()
    dense_lengths: Mapping[str, int] = field(default_factory=dict)

    @property
    def derived(self) -> list[Statement]:
        """The statements of a step whose derivatives are taken, from x to the new x."""
        return arriving([*self.rates, *self.prepare, *self.body, *self.kept])

    @property
    def iterates(self) -> bool:
        """Whether the step iterates as often as numbers say, so that steps side by side wait for one another."""
        return any(isinstance(each, While | FixedPoint) for each in (*self.start, *self.derived))


def arriving(statements: Sequence[Statement]) -> list[Statement]:
    """The statements with x_new as the new x: where the last one makes it, written there, else copied."""
    *before, last = statements
    if isinstance(last, Map | Call) and last.outputs == ("x_new",):
        return [*before, replace(last, outputs=("x",))]
    return [*statements, copied("x_new", "x")]


def with_registers(step: Step, own: Mapping[str, int], *more: Statement) -> dict[str, int]:
    """All registers: those of what wraps a step, and its own.

    more: its statements besides those from x to the new x.
    Raises ValueError where one name has two meanings, and for a step that does not make x_new of x.
    """
    every = [*step.start, *step.rates, *step.prepare, *step.body, *more, *step.kept]
    written = effects([*step.rates, *step.prepare, *step.body, *step.kept])[1]
    if "x_new" not in written or "x" in written:
        raise ValueError("a step has to write register 'x_new', and to leave 'x' as it is")
    given = {**step.lengths, **step.dense_lengths}
    reads, writes = effects(every)
    if twice := [name for name in (*given, *writes) if name in own and name not in SHARED]:
        raise ValueError(f"a step cannot have a register {twice[0]!r}: a run has another of that name")
    shared = {name: own["x"] if name in STATES else 1 for name in SHARED if name not in own}
    lengths = lengths_of(every, {**shared, **given, **own})
    lengths |= dict.fromkeys([name for name in step.fixed if name not in lengths], 1)
    return {name: lengths[name] for name in (*given, *reads, *writes, *step.fixed, *own) if name in lengths}


def rate_calls(problem: Problem, *statements: Sequence[Statement]) -> int:
    """Number of times that statements evaluate the rate; those inside an iteration count themselves."""
    return sum(isinstance(each, Call) and each.graph is problem.rate for part in statements for each in part)


def call(rule: Rule, *reads: str, **lengths: int) -> Call:
    """Statement that sets registers by a rule of others.

    rule: a function of nodes, whose parameters are the registers that it reads (without an underscore at the end, where
    the name is one of Python's), and that gives {register: node} of those that it sets.  reads: these registers, where
    their names are others; one that no result depends on, such as by a weight of 0, is left out.  lengths: of those
    that are lists of several numbers; results may be such lists as well.

    >>> from dynamics.integrators import call
    >>> later = call(lambda t, h: {"t_new": t + h})
    >>> later.inputs, later.outputs
    (('t', 'h'), ('t_new',))
    """
    graph, inputs, outputs = _formula(rule, reads, lengths)
    return Call(graph, inputs, outputs)


def each(rule: Rule, *reads: str) -> Map:
    """Statement that sets registers by a rule of others, see `call`, component by component.

    >>> from dynamics.integrators import each
    >>> euler = each(lambda x, h, slope: {"x_new": x + h * slope})
    >>> euler.inputs, euler.outputs
    (('x', 'h', 'slope'), ('x_new',))
    """
    return Map(*_formula(rule, reads, {}))


def total(rule: Rule, *reads: str) -> Sum:
    """Statement that sets registers to the sums over all components of a rule of others, see `call`.

    >>> from dynamics.integrators import total
    >>> total(lambda x: {"square": x * x}).outputs
    ('square',)
    """
    return Sum(*_formula(rule, reads, {}))


def _formula(
    rule: Rule, reads: tuple[str, ...], lengths: Mapping[str, int]
) -> tuple[Graph, tuple[str, ...], tuple[str, ...]]:
    """The graph of a rule, and the registers that it reads and sets."""
    names = reads or tuple([name.rstrip("_") for name in inspect.signature(rule).parameters])
    values: list[Any] = [
        cg.variables([f"{name}[{k}]" for k in range(lengths[name])]) if name in lengths else cg.variable(name)
        for name in names
    ]
    results = rule(*values)
    graph = Graph(_end_to_end(values), {f"{k}": number for k, number in enumerate(_end_to_end(results.values()))})
    if reads and not lengths and not {*graph.inputs} <= (within := {*graph.nodes}):
        names = tuple([name for name, value in zip(names, values, strict=True) if value in within])
        graph = Graph([value for value in values if value in within], graph.outputs)
    return graph, names, tuple(results)


def _end_to_end(values: Iterable[Any]) -> list[Any]:
    """Numbers, and those of lists."""
    return [number for value in values for number in (value if isinstance(value, list) else [value])]


def lengths_of(statements: Iterable[Statement], known: Mapping[str, int]) -> dict[str, int]:
    """Lengths of the registers that statements set, as far as these and those that are known tell.

    Component by component a result is as long as what it is made of, and a sum is one number. The numbers of a call are
    one for each register, or all of the only one that is not known. Pivots are as many as a matrix has rows.
    """
    every, lengths = list(_inside(statements)), dict(known)
    for _ in every:
        before = dict(lengths)
        for statement in every:
            for name, length in _told(statement, known, lengths):
                if name not in known:
                    lengths[name] = max(length, lengths.get(name, 0))
        if lengths == before:
            break
    return lengths


def _inside(statements: Iterable[Statement]) -> Iterator[Statement]:
    for statement in statements:
        yield statement
        for body in STATEMENTS[type(statement)].bodies:
            yield from _inside(getattr(statement, body))


def _told(statement: Statement, known: Mapping[str, int], lengths: Mapping[str, int]) -> Iterator[tuple[str, int]]:
    """Registers that a statement sets, with their lengths."""
    if isinstance(statement, Factor):
        yield statement.pivots, math.isqrt(lengths.get(statement.matrix, 0))
    if isinstance(statement, Call | Map | Sum):
        names, numbers, elements = statement.outputs, len(statement.graph.outputs), 1
        if isinstance(statement, Map):
            elements = max([lengths.get(name, 1) for name in statement.inputs], default=1)
        unknown = [name for name in names if name not in known]
        if len(names) == numbers:
            yield from [(name, elements) for name in names]
        elif len(unknown) == 1:
            yield unknown[0], elements * numbers - sum([known[name] for name in names if name in known])


def weighted(nodes: Sequence[Node], weights: Sequence[float]) -> Node:
    """The sum of weight * node, without those of weight 0."""
    result: Node | None = None
    for weight, node in zip(weights, nodes, strict=True):
        if weight:
            term = node if weight == 1.0 else weight * node
            result = term if result is None else result + term
    return cg.constant(0.0) if result is None else result


def numbered(register: str, count: int, first: int = 0) -> list[str]:
    """So many registers, by their numbers."""
    return [f"{register}{k}" for k in range(first, first + count)]


def advanced(target: str, weights: Sequence[float]) -> Map:
    """target = x + h * (sum of weight * slope)."""
    slopes = numbered("slope", len(weights))
    return each(lambda x, h, *slopes: {target: x + h * weighted(slopes, weights)}, "x", "h", *slopes)


def combined(rows: Sequence[Sequence[float]], sources: Sequence[str], targets: Sequence[str]) -> Map:
    """Statement for each target = sum of weight * source, by its row of weights."""
    return each(lambda *nodes: {to: weighted(nodes, row) for to, row in zip(targets, rows, strict=True)}, *sources)


def compensated(x: Node, more: Node) -> tuple[Node, Node]:
    """x + more, and what rounding takes off it, which the next sum may add (Kahan)."""
    result = x + more
    return result, more - (result - x)


def stage_time(target: str, c: float) -> Call:
    """target = t + c h."""
    return call(lambda t, h: {target: t + c * h})


def count(more: int, register: str = "evaluations") -> Call:
    """That many more in a register."""
    return call(lambda done: {register: done + float(more)}, register)
