"""The exact motions that are kept in files, computed again: `python -m tests.dynamics.experiments.renew`.

Of the stability table that is a quarter of an hour; of the random motions some take half a minute each.
"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from dynamics.experiments.stability import case_runs, cases
from dynamics.experiments.trust import trust as answers
from dynamics.experiments.trust.random_motions import random_motion
from dynamics.multiprecision import Reference


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


def write(file: Path, entries: dict[str, Any], indent: int) -> None:
    """The file of these entries."""
    file.write_text(json.dumps(entries, indent=indent) + "\n", encoding="utf-8")


if __name__ == "__main__":
    chosen = sys.argv[1:]
    renew_cases([each for each in chosen if not each.isdecimal()] if chosen else cases.names())
    renew_answers([int(each) for each in chosen if each.isdecimal()] if chosen else range(answers.COUNT))
