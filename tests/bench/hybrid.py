"""Hybrid: random systems with switching surfaces, judged by exact ends, events and slopes; and known members."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest

import dynamics as dyn
from cgraph._shared import Array
from cgraph.codegen import llvm_engine
from dynamics.integrators import METHODS
from tests.bench.hybrids.exact import PoorDrawError, solution
from tests.bench.hybrids.families import FAMILIES, Case, Draw, case, draw
from tests.bench.hybrids.members import EACH, KNOWN, members
from tests.bench.tables import Table, Wrong

RIGHT, SAID, SILENT = "right", "said", "silent"
OTHERS = ("dopri5", "radau", "rodas", "rk4", "taylor")  # beside the default, one of them a case
VALUES, SLOPES = 1e-6, 1e-4  # errors that are right, relative to the largest of a component over the run, of all slopes
EQUAL, STEPS = 1e-5, 1000  # the first of equal steps, of which a run has so many
MOST = 20_000  # steps, after which a run stops and says so
GROWTH = 300.0  # times which an error of the start may have grown at the end
TINY = 1e-30  # of plain numbers, what is rounding


class Verdict(NamedTuple):
    """What was right of one run, or of one set of slopes, by one method.  again: what makes it again."""

    name: str
    again: str
    verdict: str
    words: str


class Truth(NamedTuple):
    """A case, and its right end, sizes and slopes, (states, inputs)."""

    case: Case
    end: Array
    sizes: Array
    slopes: Array | None


def truth(case: Case) -> Truth:
    """What is right of a case."""
    if case.exact is None:
        return Truth(case, np.array(case.right), np.array(case.sizes), None)
    end, sizes, slopes = solution(case.exact, case.start, case.numbers, case.t_end, case.slopes)
    return Truth(case, end, np.where(sizes > TINY, sizes, 1.0), slopes)


def drawn(seed: int) -> Truth:
    """The case of a seed: its first draw that is none on the verge."""
    family = FAMILIES[seed % len(FAMILIES)]
    for again in range(1000):
        try:
            found = truth(draw(family, seed // len(FAMILIES), 1000 * seed + again))
        except PoorDrawError:
            continue
        if found.slopes is None or np.abs(found.slopes).max() < GROWTH * found.sizes.max():
            return found
    raise RuntimeError(f"no draw of {family} with seed {seed} can be judged")


def heard(run: Callable[[], Any]) -> tuple[Any, str]:
    """What a run gives, or None, and what it says."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = run()
        except (ValueError, ArithmeticError, RuntimeError, NotImplementedError) as error:
            return None, str(error)
    return found, "; ".join([str(each.message) for each in caught])


def verdict(name: str, again: str, got: Any, right: Any, size: Any, bound: float, words: str) -> Verdict:
    """The verdict on numbers, of sizes; None for none."""
    got, right = np.array(math.nan if got is None else got), np.array(right)
    error = float((np.abs(got - right) / size).max(initial=0.0)) if got.shape == right.shape else math.inf
    text = f"error {error:.2g}, got {got.tolist()}, right {right.tolist()}; {words}"
    return Verdict(name, again, RIGHT if error <= bound else SAID if words else SILENT, text)


def judged(truth: Truth, name: str, again: str, method: str, ways: Sequence[Callable[..., Any]]) -> Iterator[Verdict]:
    """The verdicts on the end or the events of a case by a method, and on its slopes in these ways."""
    case, units = truth.case, np.array(truth.case.units)
    options: dict[str, Any] = {"events": case.events}
    bound = VALUES
    if not METHODS[method].adaptive:
        options["dt"], bound = case.t_end * case.second / STEPS, EQUAL
    half = len(units) if isinstance(case.model, dyn.OdeSystem) else len(units) // 2
    state = np.array(case.start) * units
    start = state[:half], state[half:] if half < len(units) else None, case.t_end * case.second
    run, words = heard(lambda: dyn.simulate(case.model, *start, method, max_steps=MOST, progress=False, **options))
    if run is None or not run.stats.success:
        yield verdict(name, again, None, truth.end, 1.0, bound, words)
        return
    if case.times is not None:
        times = np.hstack([each.t for each in run.events.values()]) / case.second
        yield verdict(name, again, times, case.times, case.t_end, bound, words)
        return
    yield verdict(name, again, np.hstack([run.q[-1], run.qd[-1]]) / units, truth.end, truth.sizes, bound, words)
    if truth.slopes is None:
        return
    factors = np.hstack([units, [case.unit[each] * value for each, value in case.numbers.items()]])
    names, largest = ["q", *["qd"] * (half < len(units)), *case.numbers], np.abs(truth.slopes).max()
    for way in ways:
        found, words = heard(lambda way=way: way(case.model, start, method, names, **options))
        right = truth.slopes[:1] if way is gradient else truth.slopes
        got = None if found is None else found * factors / units[: len(found), None]
        yield verdict(name, again, got, right, largest if largest > TINY else 1.0, SLOPES, words)


def gradient(model: Any, start: Any, method: str, names: Sequence[str], **options: Any) -> Array:
    """Slopes of the first coordinate, a row."""
    found = dyn.gradient(model, lambda q, *_: q[0], *start, method, wrt=names, **options)
    return np.hstack([found[each] for each in names])[None]


def sensitivities(model: Any, start: Any, method: str, names: Sequence[str], **options: Any) -> Array:
    """Slopes of all states, a row each."""
    found = dyn.sensitivities(model, *start, method, wrt=names, **options)
    return np.hstack([np.reshape(found[each][-1], (len(found[each][-1]), -1)) for each in names])


def random_verdicts(count: int, seed: int, methods: Sequence[str]) -> Iterator[Verdict]:
    """The verdicts on cases of these seeds, by these methods; or by the default and another, slopes by one of them."""
    for each in range(seed, seed + count):
        found, u, ways = drawn(each), Draw(each), (gradient, sensitivities)
        pair, sloped, way = ("dop853", OTHERS[u.pick(len(OTHERS))]), u.pick(2), ways[u.pick(2)]
        for k, method in enumerate(methods or pair):
            asked = ways if methods else (way,) * (k == sloped)
            again = f"--seed {each} --count 1 --methods {method}"
            yield from judged(found, FAMILIES[each % len(FAMILIES)], again, method, asked)


def known_verdicts() -> Iterator[Verdict]:
    """The verdicts on known members."""
    for name, row in KNOWN.items():
        for method in EACH:
            yield from judged(truth(case(row, Draw())), name, method, method, (gradient, sensitivities))
    for member in members():
        got, words = heard(member.ask)
        yield verdict(member.name, member.method, got, member.right, np.abs(member.right).max(), member.bound, words)


def hybrid(count: int = 300, seed: int = 0, methods: Sequence[str] = (), cases: bool = False) -> Iterator[Table | str]:
    """Verdicts on random systems, or on known ones, counted by name; and those that are wrong in silence."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(llvm_engine, "LEVEL", 0)  # most of the time would go into code that runs once
        found = list(known_verdicts() if cases else random_verdicts(count, seed, methods))
    rows = []
    for name in dict.fromkeys([each.name for each in found]):
        counts = Counter([each.verdict for each in found if each.name == name])
        rows.append([name, str(counts.total()), *[str(counts[each]) for each in (RIGHT, SAID, SILENT)]])
    yield Table("Systems with switching surfaces", ["", "judged", RIGHT, SAID, SILENT], rows)
    for each in found:
        line = f"{each.verdict}: {each.name}, {each.again}: {each.words}"
        if each.verdict == SILENT:
            yield Wrong(line)
        elif count == 1 or cases:
            yield line
