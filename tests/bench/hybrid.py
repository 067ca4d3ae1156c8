"""Hybrid: random systems with switching surfaces, judged by exact ends, events and slopes."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

import dynamics as dyn
from cgraph._shared import Array
from dynamics.integrators import METHODS
from tests.bench.hybrids.exact import PoorDrawError, slopes
from tests.bench.hybrids.families import FAMILIES, Case, draw
from tests.bench.hybrids.members import members
from tests.bench.tables import Table, Wrong

RIGHT, SAID, SILENT = "right", "said", "silent"
OTHERS = ("dopri5", "radau", "rodas", "rk4", "taylor")  # beside the default, one of them a case
VALUES, SLOPES = 1e-6, 1e-4  # errors that are right, relative to the largest of a component over the run, of all slopes
EQUAL, STEPS = 1e-5, 1000  # the first of equal steps, of which a run has so many
MOST = 20_000  # steps, after which a run stops and says so
GROWTH = 300.0  # times which an error of the start may have grown at the end


class Verdict(NamedTuple):
    """What was right of one run, or of one set of slopes, by one method."""

    family: str
    method: str
    what: str
    verdict: str
    error: float
    words: str


class Truth(NamedTuple):
    """A case, and its right end, sizes and slopes, (states, inputs)."""

    case: Case
    end: Array
    sizes: Array
    slopes: Array | None


def drawn(seed: int) -> Truth:
    """The case of a seed: its first draw that is none on the verge."""
    family = FAMILIES[seed % len(FAMILIES)]
    for again in range(1000):
        case = draw(family, seed // len(FAMILIES), 1000 * seed + again)
        if case.exact is None:
            return Truth(case, np.array(case.right), np.array(case.sizes), None)
        try:
            end, found = slopes(case.exact, case.start, case.numbers, case.t_end)
        except PoorDrawError:
            continue
        if np.abs(found).max() < GROWTH * end.sizes.max():
            sizes = np.where(end.sizes > 0.0, end.sizes, 1.0)
            return Truth(case, end.x.astype(float), sizes, found if case.slopes else None)
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


def verdicts(seed: int, methods: Sequence[str] = ()) -> Iterator[Verdict]:
    """The verdicts on the case of a seed, by these methods, or by the default and one of the others."""
    truth = drawn(seed)
    turn, ways = seed // len(FAMILIES), (_gradient, _sensitivities)
    for k, method in enumerate(methods or ("dop853", OTHERS[turn % len(OTHERS)])):
        asked = () if not methods and (turn + k) % 2 else ways if methods else ways[turn // 2 % 2 :][:1]
        yield from judged(truth, FAMILIES[seed % len(FAMILIES)], method, asked)


def judged(truth: Truth, name: str, method: str, ways: Sequence[Callable[..., Any]]) -> Iterator[Verdict]:
    """The verdicts on the end or the events of a case by a method, and on its slopes in these ways."""
    case, units = truth.case, np.array(truth.case.units)
    options: dict[str, Any] = {"events": case.events}
    bound = VALUES
    if not METHODS[method].adaptive:
        options["dt"], bound = case.t_end * case.second / STEPS, EQUAL
    half = len(units) if isinstance(case.model, dyn.OdeSystem) else len(units) // 2
    state = np.array(case.start) * units
    start = state[:half], state[half:] if half < len(units) else None, case.t_end * case.second

    def verdict(what: str, error: float, bound: float, words: str) -> Verdict:
        met = RIGHT if error <= bound else SAID if words else SILENT
        return Verdict(name, method, what, met, error, words)

    run, words = heard(lambda: dyn.simulate(case.model, *start, method, max_steps=MOST, progress=False, **options))
    if run is None or not run.stats.success:
        yield verdict("end", math.inf, bound, words)
        return
    if case.times is not None:
        times = np.hstack([each.t for each in run.events.values()]) / case.second
        same = len(times) == len(case.times)
        error = np.abs(times - case.times).max(initial=0.0) / case.t_end if same else math.inf
        yield verdict(f"events {times}, right {case.times}", error, bound, words)
        return
    end = np.hstack([run.q[-1], run.qd[-1]]) / units
    yield verdict(f"end {end}, right {truth.end}", np.max(np.abs(end - truth.end) / truth.sizes), bound, words)
    if truth.slopes is None:
        return
    factors = np.hstack([units, [case.unit[each] * value for each, value in case.numbers.items()]])
    names = ["q", *["qd"] * (half < len(units)), *case.numbers]
    for way in ways:
        found, words = heard(lambda way=way: way(case.model, start, method, names, **options))
        what, error = f"{way.__name__[1:]} not made", math.inf
        if found is not None:
            got = found * factors / units[: len(found), None]
            expected = truth.slopes[: len(found)]
            error = np.max(np.abs(got - expected)) / np.abs(truth.slopes).max()
            what = f"{way.__name__[1:]} {got.tolist()}, right {expected.tolist()}"
        yield verdict(what, error, SLOPES, words)


def _gradient(model: Any, start: Any, method: str, names: Sequence[str], **options: Any) -> Array:
    found = dyn.gradient(model, lambda q, *_: q[0], *start, method, wrt=names, **options)
    return np.hstack([found[each] for each in names])[None]


def _sensitivities(model: Any, start: Any, method: str, names: Sequence[str], **options: Any) -> Array:
    found = dyn.sensitivities(model, *start, method, wrt=names, **options)
    return np.hstack([np.reshape(found[each][-1], (len(found[each][-1]), -1)) for each in names])


def known() -> Iterator[Table | str]:
    """The verdicts on the members with known answers."""
    rows, silent = [], []
    for member in members():
        got, words = heard(member.ask)
        got, right = np.ravel(math.nan if got is None else got), np.ravel(member.right)
        error = float(np.abs(got - right).max() / np.abs(right).max()) if got.shape == right.shape else math.inf
        verdict = RIGHT if error <= member.bound else SAID if words else SILENT
        rows.append([member.name, str(got.round(6).tolist()), str(right.round(6).tolist()), verdict])
        if verdict == SILENT:
            silent.append(Wrong(f"silent: {member.name}: got {got.tolist()}, right {right.tolist()}"))
    yield Table("Members with known answers", ["member", "got", "right", "verdict"], rows, (0, 1, 2, 3))
    yield from silent


def hybrid(count: int = 300, seed: int = 0, methods: Sequence[str] = (), cases: bool = False) -> Iterator[Table | str]:
    """Verdicts on random cases of these seeds, counted by family, or on known cases; and in words the silent ones."""
    if cases:
        yield from known()
        return
    found: dict[str, list[Verdict]] = {}
    silent = []
    for each in range(seed, seed + count):
        for verdict in verdicts(each, methods):
            found.setdefault(verdict.family, []).append(verdict)
            if verdict.verdict == SILENT:
                again = f"--seed {each} --count 1 --methods {verdict.method}"
                silent.append(Wrong(f"silent: {verdict.family}, {again}: {verdict.what}; error {verdict.error:.2g}"))
    rows = []
    for family, chosen in found.items():
        counts = Counter([each.verdict for each in chosen])
        rows.append([family, str(len(chosen)), *[str(counts[each]) for each in (RIGHT, SAID, SILENT)]])
    yield Table(f"{count} random hybrid systems", ["family", "judged", RIGHT, SAID, SILENT], rows)
    yield from silent
