"""The random Lagrangians as exactly as float64 has them, by our Taylor method and by heyoka's, in turns."""

import math
from collections.abc import Iterator, Sequence
from statistics import geometric_mean
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array
from dynamics.experiments.work_precision.measurement import Ours, Solver, Tried, problem_of, time_in_turns
from tests.bench.motions.trajectory_peers import EPSILON, Heyoka
from tests.bench.tables import Table
from tests.trust.random_motions import LAGRANGIANS, random_task
from tests.trust.trust import Answer, answer

TIGHT, TURNS = "taylor", 5
FLOOR = EPSILON / 4.0  # of an error in a ratio: less is luck


class Duel(NamedTuple):
    """error: of both at t_end over the sizes of the states.  seconds: of both, the shortest of the turns.

    status: empty, or why there is no figure.
    """

    name: str
    error: tuple[float, float]
    seconds: tuple[float, float]
    status: str = ""


def duel(number: int) -> Duel | None:
    """Our Taylor method and heyoka, both at the resolution of float64; None of a motion that has no end or is stiff."""
    task, truth = random_task(number), answer(number)
    if truth.end is None or task.stiff:
        return None
    problem, smallest = problem_of(task), min([size for size in truth.size if size] or [1.0])
    both: tuple[Solver, Solver] = Ours(TIGHT, task, smallest, problem), Heyoka(task, smallest, problem)
    tried = []
    for solver in both:
        run = solver.ready(EPSILON)
        outcome = run()
        if outcome.status:
            return Duel(task.name, (math.nan, math.nan), (math.nan, math.nan), f"{solver.name}: {outcome.status}")
        tried.append(Tried(0.0, run, outcome, _error(truth, outcome.x)))
    time_in_turns(tried, TURNS)
    first, second = tried
    return Duel(task.name, (first.error, second.error), (first.seconds, second.seconds))


def _error(truth: Answer, x: Array) -> float:
    assert truth.end is not None
    size = np.array(truth.size)
    return float(np.max(np.abs(truth.end.deviation(x[None])[0]) / np.where(size > 0.0, size, 1.0)))


def tightest(count: int = LAGRANGIANS) -> Iterator[Table | str]:
    """Errors and times as ratios to heyoka's, by family and in all."""
    duels = [result for number in range(count) if (result := duel(number)) is not None]
    fought = [each for each in duels if not each.status]
    title = f"{TIGHT} at a relative tolerance of {EPSILON:.2g} over heyoka at its default, {len(fought)} motions"
    families: dict[str, list[Duel]] = {}
    for each in fought:
        families.setdefault(each.name.rpartition(" ")[0], []).append(each)
    rows = [_row(name, chosen) for name, chosen in (families | {"all": fought}).items()]
    yield Table(title, ["family", "motions", "error ratio", "largest", "time ratio", "largest"], rows)
    yield from [f"{each.name}: {each.status}" for each in duels if each.status]


def _row(name: str, chosen: Sequence[Duel]) -> list[str]:
    errors = [max(each.error[0], FLOOR) / max(each.error[1], FLOOR) for each in chosen]
    times = [each.seconds[0] / each.seconds[1] for each in chosen]
    figures = [f(values) for values in (errors, times) for f in (geometric_mean, max)]
    return [name, str(len(chosen)), *[f"{figure:.2g}" for figure in figures]]
