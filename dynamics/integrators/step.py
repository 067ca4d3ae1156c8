"""Step: one step of a method as statements, of which equal steps, chosen steps and derivatives are wrappers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from cgraph.extend import Call, FixedPoint, Map, Statement, While, copied, effects

from .problem import Problem
from .statements import lengths_of

# What a step may read of a run; in equal steps and derivatives, which have no tolerance, the others are 0.
STATES = ("x", "x_new", "atol")
SHARED = (*STATES, *"t h p rtol leap next end evaluations error at_limit accepted".split())


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
