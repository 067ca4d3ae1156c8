"""Trust: random motions judged by their exact answers, by default arguments."""

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from cgraph.extend import NoSeriesError
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.work_precision.measurement import problem_of
from dynamics.integrators import METHODS
from dynamics.multiprecision import Reference, ReferenceFailedError
from dynamics.multiprecision.reference import from_text
from dynamics.simulation.run_options import METHOD, Steps
from dynamics.simulation.simulate import simulate
from dynamics.simulation.trajectory import Trajectory
from tests.bench.tables import Table
from tests.trust.random_motions import EACH, LAGRANGIANS, STARTS, jump, random_motion

FILE = Path(__file__).with_name("answers.json")
COUNT = LAGRANGIANS + EACH * len(STARTS)
DIGITS = 30
PARTS = 8  # of the motion: an error may be made at the start of any
RTOL, NUDGE = 1e-7, 2.0**-12  # of motions beside the motion: their errors, and how far they start aside, in sizes
REGULAR = 1e8  # condition of a flow that is inverted


@dataclass(frozen=True)
class Answer:
    """The end of a motion, or why it has none.

    end: at t_end; None where the motion runs into a singularity before.  size: the largest value of each state on the
    way, (m,).
    growth: the largest factor by which a small relative error at any time, in the sizes of the states, has grown at
    t_end, at least 1.
    """

    end: Reference | None
    size: tuple[float, ...]
    growth: float
    how: str


def answer(number: int) -> Answer:
    """The answer to the random motion of this number, from the file beside this one or computed."""
    task = random_motion(number)
    kept = task.kept(FILE, str(number))
    if kept is None:
        return compute(task)
    end = from_text([task.t_end], [kept["x"]], kept["error"], kept["how"]) if "x" in kept else None
    return Answer(end, tuple(kept["size"]), kept["growth"], kept["how"])


def compute(task: AccuracyTask) -> Answer:
    """The answer to a task, by `reference`; the growth by SciPy."""
    times = [task.t_end * k / PARTS for k in range(PARTS + 1)]
    try:
        motion = task.solution(times, digits=DIGITS)
    except ReferenceFailedError as error:
        return Answer(None, (), 1.0, str(error))
    assert motion is not None
    end = Reference(motion.t[-1:], motion.decimal[-1:], motion.error, motion.how)
    size, growth = size_and_growth(task, times, np.max(np.abs(motion.x), axis=0))
    return Answer(end, tuple(size.tolist()), growth, motion.how)


def size_and_growth(task: AccuracyTask, times: Sequence[float], size: Array) -> tuple[Array, float]:
    """The largest value of each state, (m,), and the largest row sum of the flow from any of these times to the last.

    The flow is measured in units of the sizes, by differences of motions of SciPy's solvers; `size` is a first guess.
    """
    from scipy.integrate import solve_ivp

    rate = cg.compile(problem_of(task).rate)
    unit = np.where(size > 0.0, size, 1.0)

    def motion(x: Array, at: Sequence[float] | None = times) -> Array:
        options = {"rtol": RTOL, "atol": RTOL * unit, "method": "Radau" if task.stiff else "DOP853", "t_eval": at}
        return np.asarray(solve_ivp(lambda t, x: rate([*x, t]), (0.0, task.t_end), x, **options).y.T)

    start = np.array(task.start)
    size = np.maximum(size, np.abs(motion(start, None)).max(axis=0))  # of all its steps, layers included
    unit = np.where(size > 0.0, size, 1.0)
    columns = []
    for j in range(len(start)):
        aside = unit * (np.arange(len(start)) == j) * NUDGE
        columns.append((motion(start + aside) - motion(start - aside)) / (2.0 * NUDGE * unit))
    flows = np.stack(columns, axis=2)  # (T, m, m), from the start
    usable = [flow for flow in flows[:-1] if np.linalg.cond(flow) < REGULAR]
    return size, max([1.0, *[float(np.abs(flows[-1] @ np.linalg.inv(flow)).sum(axis=1).max()) for flow in usable]])


RIGHT, SAID, SILENT = "right", "said", "silent"
SLACK = 100.0  # times rtol times the growth: an error that is right
JUMPS = 1000.0  # the same where forces jump, whose size in a step no estimate knows
DEFAULT = "default"
ADAPTIVE = tuple([name for name, method in METHODS.items() if method.adaptive])


@dataclass(frozen=True)
class Verdict:
    """One run judged.

    excess: the error at t_end over rtol times the growth, the largest of all states, each over its size; NaN
    where there is no end, or the run did not get there.  verdict: "right", excess at most `SLACK` or `JUMPS`, or the
    motion has no end and the run says so; "said", the run stopped, is refused or warns; "silent".  words: what it said.
    """

    name: str
    method: str
    verdict: str
    excess: float
    words: str
    steps: int
    seconds: float


def judge(number: int, method: str | None = None) -> Verdict:
    """The verdict on one random motion by a method with default arguments."""
    task, truth = random_motion(number), answer(number)
    with warnings.catch_warnings(record=True, action="always") as caught:
        start = task.q, task.qd or None
        try:
            run = simulate(task.model, *start, task.t_end, method or METHOD, progress=False)
        except NoSeriesError as error:
            return Verdict(task.name, method or DEFAULT, SAID, math.nan, str(error), 0, 0.0)
    words = "; ".join([str(each.message) for each in caught])
    excess = _excess(task, truth, run)
    slack = JUMPS if task.name.startswith(jump.__name__) else SLACK
    right = excess <= slack or (truth.end is None and not run.stats.success)
    verdict = RIGHT if right else SAID if words else SILENT
    return Verdict(task.name, method or DEFAULT, verdict, excess, words, run.stats.steps, run.stats.seconds)


def _excess(task: AccuracyTask, truth: Answer, run: Trajectory) -> float:
    if truth.end is None or not run.stats.success:
        return math.nan
    size = np.array(truth.size)
    error = np.abs(truth.end.deviation(np.hstack([run.q[-1:], run.qd[-1:]]))[0])
    relative = np.divide(error, size, out=np.where(error > 0.0, np.inf, 0.0), where=size > 0.0)
    tolerance = Steps(run.stats.method).relative
    return float(np.max(relative) / (tolerance * truth.growth))


def trust(count: int = COUNT) -> Iterator[Table | str]:
    """The verdicts counted by method, and in words those that are not right."""
    right = f"right to {SLACK:g}, where forces jump to {JUMPS:g}"
    title = f"{count} random motions, default arguments; excess: error over rtol times growth, {right}"
    figures: dict[str, Callable[[Sequence[Verdict], list[float]], str]] = {
        "median excess": lambda chosen, ends: f"{np.median(ends):.2g}",
        "largest": lambda chosen, ends: f"{max(ends):.2g}",
        "seconds": lambda chosen, ends: f"{sum(each.seconds for each in chosen):.2f}",
    }
    judged = [judge(number, method) for number in range(count) for method in (None, *ADAPTIVE)]
    yield from counted(title, judged, figures)


def counted(
    title: str, judged: Sequence[Verdict], figures: Mapping[str, Callable[[Sequence[Verdict], list[float]], str]]
) -> Iterator[Table | str]:
    """A title, the verdicts and figures by method, and in words the verdicts that are not right.

    figures: {head of a column: text of the verdicts of a method, and of the excesses of their ends}.
    """
    rows = []
    for method in dict.fromkeys([each.method for each in judged]):
        chosen = [each for each in judged if each.method == method]
        counts = Counter([each.verdict for each in chosen])
        ends = [each.excess for each in chosen if each.excess == each.excess]
        texts = [figure(chosen, ends) for figure in figures.values()]
        rows.append([method, *[str(counts[verdict]) for verdict in (RIGHT, SAID, SILENT)], *texts])
    yield Table(title, ["method", RIGHT, SAID, SILENT, *figures], rows)
    for each in judged:
        if each.verdict != RIGHT:
            yield f"{each.verdict}: {each.name}, {each.method}: excess {each.excess:.3g}; {each.words}"
