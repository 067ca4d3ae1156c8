"""Hybrid: random systems with switching surfaces, judged by exact ends, events and slopes; and known members."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest

import dynamics as dyn
from cgraph.codegen import llvm_engine
from dynamics.integrators import METHODS
from tests.bench.hybrids.families import FAMILIES, TINY, Case, Draw, case, drawn
from tests.bench.hybrids.members import EACH, KNOWN, members
from tests.bench.tables import Table, Wrong

RIGHT, SAID, SILENT = "right", "said", "silent"
OTHERS = ("dopri5", "radau", "rodas", "rk4", "taylor")  # beside the default, one of them a case
VALUES, SLOPES = 1e-6, 1e-4  # errors that are right, relative to the largest of a component over the run, of all slopes
STEPS, MOST = 1000, 20_000  # equal steps of a run; steps after which a run stops and says so


class Verdict(NamedTuple):
    """What was right of one run, or of one set of slopes, by one method.  again: what makes it again."""

    name: str
    again: str
    verdict: str
    words: str


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


def judged(of: Case, name: str, again: str, method: str, ways: Sequence[bool]) -> Iterator[Verdict]:
    """The verdicts on the end or the events of a case by a method, and its slopes: all, or those of one place."""
    options: dict[str, Any] = {"events": of.events}
    if not METHODS[method].adaptive:
        options["dt"] = of.t_end / STEPS
    bound, half = of.equal if "dt" in options else VALUES, [*of.start, None][:2]
    simulate = partial(dyn.simulate, of.model, *half, of.t_end, method, max_steps=MOST, progress=False, **options)
    run, words = heard(simulate)
    got = None
    if run is not None and run.stats.success:
        times = [each.t / of.t_end for each in run.events.values()]
        got = np.hstack(times) if of.timed else np.hstack([run.q[-1], run.qd[-1]]) / of.units
    yield verdict(name, again, got, of.right, of.sizes, bound, words)
    if of.slopes is None or got is None:
        return
    names, largest = [*["q", "qd"][: len(of.start)], *of.numbers], np.abs(of.slopes).max()
    for whole in ways:
        count = len(of.units) if whole else 1
        ask = partial(dyn.sensitivities, of.model) if whole else partial(dyn.gradient, of.model, lambda q, *_: q[0])
        found, words = heard(partial(ask, *half, of.t_end, method, wrt=names, **options))
        if found is not None:
            found = np.hstack([np.reshape(found[each][-1] if whole else found[each], (count, -1)) for each in names])
            found = found * np.hstack([of.units, [*of.numbers.values()]]) / of.units[:count, None]
        size = largest if largest > TINY else 1.0
        yield verdict(name, again, found, of.slopes[:count], size, SLOPES, words)


def random_verdicts(count: int, seed: int, methods: Sequence[str]) -> Iterator[Verdict]:
    """The verdicts on cases of these seeds, by these methods; or by the default and another, slopes by one of them."""
    for each in range(seed, seed + count):
        found, u = drawn(each), Draw(each)
        pair, sloped, way = ("dop853", OTHERS[u.pick(len(OTHERS))]), u.pick(2), bool(u.pick(2))
        for k, method in enumerate(methods or pair):
            asked = (False, True) if methods else (way,) * (k == sloped)
            again = f"--seed {each} --count 1 --methods {method}"
            yield from judged(found, FAMILIES[each % len(FAMILIES)], again, method, asked)


def known_verdicts() -> Iterator[Verdict]:
    """The verdicts on known members."""
    for name, row in KNOWN.items():
        for method in EACH:
            yield from judged(case(row, Draw()), name, method, method, (False, True))
    for name, method, ask, right, bound in members():
        got, words = heard(ask)
        yield verdict(name, method, got, right, np.abs(right).max(), bound, words)


def hybrid(count: int = 300, seed: int = 0, methods: Sequence[str] = (), cases: bool = False) -> Iterator[Table | str]:
    """Verdicts on random systems, or on known ones, counted by name; and those that are wrong in silence."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(llvm_engine, "LEVEL", 0)  # most of the time would go into code that runs once
        found = list(known_verdicts() if cases else random_verdicts(count, seed, methods))
    counts = Counter([(each.name, each.verdict) for each in found])
    names = dict.fromkeys([each.name for each in found])
    rows = [[name, *[str(counts[name, each]) for each in (RIGHT, SAID, SILENT)]] for name in names]
    yield Table("Systems with switching surfaces", ["", RIGHT, SAID, SILENT], rows)
    for each in found:
        line = f"{each.verdict}: {each.name}, {each.again}: {each.words}"
        if each.verdict == SILENT:
            yield Wrong(line)
        elif count == 1 or cases:
            yield line
