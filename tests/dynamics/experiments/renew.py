"""The exact motions that are kept in files, computed again: `python -m tests.dynamics.experiments.renew`.

Of the stability table that is a quarter of an hour; of the random motions some take half a minute each, of the bench's
motions some minutes.
"""

import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import dynamics as dyn
from cgraph.extend import Array
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.stability import case_runs, cases
from dynamics.experiments.trust import trust as answers
from dynamics.experiments.trust.random_motions import random_motion
from dynamics.experiments.work_precision import motion_scenes
from dynamics.experiments.work_precision.trajectory_peers import heyoka_equations
from dynamics.experiments.work_precision.trajectory_runs import problem_of
from dynamics.multiprecision import Reference
from dynamics.peers.heyoka import heyoka

CHAOS = 1e-13  # error of an end, in sizes, that is not known


def of_end(end: Reference) -> dict[str, Any]:
    """What a file says of an end."""
    return {"x": list(end.decimal[-1]), "error": end.error, "how": end.how}


def renew_cases(names: Iterable[str]) -> None:
    """Compute the solutions of these cases and keep them in the file."""
    entries = json.loads(case_runs.FILE.read_text(encoding="utf-8"))
    for name in names:
        if (result := cases.load(name).solution()) is not None:
            entries[name] = cases.load(name).identity | of_end(result)
            sys.stdout.write(f"{name}: {result.how}\n")
    known = [name for name, case in cases.table().items() if name in entries and (case.exact or case.method)]
    write(case_runs.FILE, {name: entries[name] for name in known}, 1)


def renew_answers(numbers: Iterable[int]) -> None:
    """Compute the answers of these numbers and keep each in the file as it is there."""
    for number in numbers:
        entries = json.loads(answers.FILE.read_text(encoding="utf-8"))
        task = random_motion(number)
        result = answers.compute(task)
        entry = task.identity | {"size": list(result.size), "growth": result.growth, "how": result.how}
        entries[str(number)] = entry | ({} if result.end is None else of_end(result.end))
        write(answers.FILE, {str(key): entries[str(key)] for key in sorted(map(int, entries))}, 0)
        sys.stdout.write(f"{number} {task.name}: growth {result.growth:.3g}; {result.how}\n")


def renew_ends(names: Iterable[str]) -> None:
    """Compute the ends of the motions of `cgraph bench motions` and keep them in the file."""
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
    if task.exact is None and task.method is None:
        yield from _ends_by_heyoka(task, size)
        return
    for t in motion_scenes.TIMES:
        end = task.solution([t], digits=motion_scenes.DIGITS)
        assert end is not None
        yield {"t": t} | of_end(end)


def _ends_by_heyoka(task: AccuracyTask, size: Array) -> Iterator[dict[str, Any]]:
    """heyoka's taylor_adaptive: two runs, the second with a thousand times the tolerance, tell the error."""
    hy = heyoka()
    kind, digits = (np.longdouble, 20) if task.stiff else (hy.real128, 34)
    equations = heyoka_equations(hy, problem_of(task), kind)
    states: list[list[Any]] = []
    for tolerance in (kind(10.0) ** (3 - digits), kind(10.0) ** (6 - digits)):
        x = np.array([kind(each) for each in task.start], dtype=kind)
        run = hy.taylor_adaptive(equations, x, tol=tolerance, fp_type=kind, compact_mode=True)
        found = []
        for t in motion_scenes.TIMES:
            run.propagate_until(kind(t))
            found.append(run.state.copy())
        states.append(found)
    for t, fine, coarse in zip(motion_scenes.TIMES, *states, strict=True):
        error = float(np.max(np.abs((fine - coarse).astype(float)) / size))
        if error > CHAOS:
            yield {"t": t, "error": error, "how": f"chaos: two runs with {digits} digits end {error:.0e} apart"}
        else:
            beside = "its difference from a run with 10^3 times the tolerance"
            how = f"heyoka's Taylor series with {digits} digits; error: {beside}"
            yield {"t": t, "x": [str(each) for each in fine], "error": error, "how": how}


def write(file: Path, entries: dict[str, Any], indent: int) -> None:
    """The file of these entries."""
    file.write_text(json.dumps(entries, indent=indent) + "\n", encoding="utf-8")


if __name__ == "__main__":
    chosen = sys.argv[1:]
    ends = [each for each in chosen if each in motion_scenes.MOTIONS]
    renew_ends(ends if chosen else motion_scenes.MOTIONS)
    renew_cases([each for each in chosen if not each.isdecimal() and each not in ends] if chosen else cases.names())
    renew_answers([int(each) for each in chosen if each.isdecimal()] if chosen else range(answers.COUNT))
