"""The exact motions that are kept in files, computed again: `python -m tests.dynamics.experiments.renew`.

Of the stability table that is a quarter of an hour; of the random motions some take half a minute each, of the bench's
motions some minutes. Ends of stiff cases and random motions, which no series reaches, stay as they are.
"""

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import dynamics as dyn
from cgraph._shared import Array
from dynamics.experiments.accuracy_task import KEPT_ENDS, AccuracyTask
from dynamics.experiments.stability import cases
from dynamics.experiments.work_precision.measurement import problem_of
from dynamics.multiprecision import Reference
from tests.bench.motions import motion_scenes
from tests.bench.motions.trajectory_peers import heyoka_equations
from tests.bench.peers.heyoka import heyoka
from tests.trust import trust as answers
from tests.trust.random_motions import random_motion

CHAOS, LOST = 1e-13, 1e-2  # errors of an end, in sizes: one that is not known, and one of which nothing is known


def of_end(end: Reference) -> dict[str, Any]:
    return {"x": list(end.decimal[-1]), "error": end.error, "how": end.how}


def renew_cases(names: Iterable[str]) -> None:
    """Compute the solutions of these cases and keep them in the file."""
    entries = json.loads(KEPT_ENDS.read_text(encoding="utf-8"))
    for name in names:
        if (result := replace(cases.load(name), ends=None).solution()) is not None:
            entries[name] = cases.load(name).identity | of_end(result)
            sys.stdout.write(f"{name}: {result.how}\n")
    known = [name for name in cases.names() if name in entries]
    write(KEPT_ENDS, {name: entries[name] for name in known}, 1)


def renew_answers(numbers: Iterable[int]) -> None:
    """Compute the answers of these numbers and keep each in the file as it is there."""
    for number in numbers:
        entries = json.loads(answers.FILE.read_text(encoding="utf-8"))
        task = random_motion(number)
        if not task.series:
            continue
        result = answers.compute(task)
        entry = task.identity | {"size": list(result.size), "growth": result.growth, "how": result.how}
        entries[str(number)] = entry | ({} if result.end is None else of_end(result.end))
        write(answers.FILE, {str(key): entries[str(key)] for key in sorted(map(int, entries))}, 0)
        sys.stdout.write(f"{number} {task.name}: growth {result.growth:.3g}; {result.how}\n")


def renew_ends(names: Iterable[str]) -> None:
    """Compute the ends of the motions of the bench and keep them in the file."""
    for name in names:
        task = motion_scenes.MOTIONS[name]()
        method = "radau" if task.stiff else "taylor"
        run = dyn.simulate(task.model, task.q, task.qd or None, task.t_end, method, rtol=1e-10, progress=False)
        size = np.abs(np.hstack([run.q, run.qd])).max(axis=0)
        ends = list(_ends(task, np.where(size > 0.0, size, 1.0)))
        entries = json.loads(motion_scenes.FILE.read_text(encoding="utf-8")) if motion_scenes.FILE.exists() else {}
        entries[name] = {"start": task.identity["start"], "size": size.tolist(), "ends": ends}
        known = {each: entries[each] for each in motion_scenes.MOTIONS if each in entries}
        write(motion_scenes.FILE, known, 1)
        sys.stdout.write("".join([f"{name} to {end['t']:g} s: {end['error']:.0e}, {end['how']}\n" for end in ends]))


def _ends(task: AccuracyTask, size: Array) -> Iterator[dict[str, Any]]:
    """The states at `TIMES`: by `reference`, or where that takes hours by heyoka in more than double precision."""
    if not task.series:
        yield from _ends_by_heyoka(task, size)
        return
    for t in motion_scenes.TIMES:
        end = task.solution([t], digits=motion_scenes.DIGITS)
        assert end is not None
        yield {"t": t} | of_end(end)


def _ends_by_heyoka(task: AccuracyTask, size: Array) -> Iterator[dict[str, Any]]:
    """heyoka's taylor_adaptive; what 20 digits do not know at all, no run in float64 gets near to."""
    rough = _two_runs(task, size, np.longdouble, 20, motion_scenes.TIMES)
    lost = {t: error for t, _, error in rough if error > LOST}
    known = [t for t in motion_scenes.TIMES if t not in lost]
    fine = [each for each in rough if each[0] in known]
    if not task.stiff:
        fine = _two_runs(task, size, heyoka().real128, 34, known)
    digits = 20 if task.stiff else 34
    beside = "its difference from a run with 10^3 times the tolerance"
    for t, x, error in fine:
        assert error < CHAOS
        how = f"heyoka's Taylor series with {digits} digits; error: {beside}"
        yield {"t": t, "x": [str(each) for each in x], "error": error, "how": how}
    for t, error in lost.items():
        yield {"t": t, "error": error, "how": f"chaos: two runs with 20 digits end {error:.0e} apart"}


def _two_runs(
    task: AccuracyTask, size: Array, kind: Any, digits: int, times: Sequence[float]
) -> list[tuple[float, Any, float]]:
    """Times, states, and their difference from those of a second run with a thousand times the tolerance, in sizes."""
    equations = heyoka_equations(heyoka(), problem_of(task), kind)
    runs: list[list[Any]] = []
    for tolerance in (kind(10.0) ** (3 - digits), kind(10.0) ** (6 - digits)):
        x, found = np.array([kind(each) for each in task.start], dtype=kind), []
        run = heyoka().taylor_adaptive(equations, x, tol=tolerance, fp_type=kind, compact_mode=True)
        for t in times:
            run.propagate_until(kind(t))
            found.append(run.state.copy())
        runs.append(found)
    return [
        (t, fine, float(np.max(np.abs((fine - coarse).astype(float)) / size)))
        for t, fine, coarse in zip(times, *runs, strict=True)
    ]


def write(file: Path, entries: dict[str, Any], indent: int) -> None:
    file.write_text(json.dumps(entries, indent=indent) + "\n", encoding="utf-8")


if __name__ == "__main__":
    chosen = sys.argv[1:]
    ends = [each for each in chosen if each in motion_scenes.MOTIONS]
    renew_ends(ends if chosen else motion_scenes.MOTIONS)
    renew_cases([each for each in chosen if not each.isdecimal() and each not in ends] if chosen else cases.names())
    renew_answers([int(each) for each in chosen if each.isdecimal()] if chosen else range(answers.COUNT))
