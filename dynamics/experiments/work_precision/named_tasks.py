"""The tasks that integrators are compared on, by name: scenes, cases of the stability table, and model files."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ... import scenes
from ...scenes.start import Start, moving_start, rest_text, with_start
from ..accuracy_task import AccuracyTask
from ..stability import cases
from ..stability.cases.rotation import kepler

TASKS: dict[str, Callable[[], AccuracyTask]] = {  # beside the scenes, the cases and the files
    **{f"kepler {e:g}": partial(kepler, e, 3.5, 1.0) for e in (0.3, 0.5, 0.7, 0.9)},
    "spring pendulum 1e8": partial(cases.load, "damped spring pendulum, k = 1e+08"),
    "van der pol 1e6": partial(cases.load, "Van der Pol, mu = 1e+06"),
    "robertson": partial(cases.load, "Robertson, to 1e11"),
}


def load(
    name: str,
    *,
    t_end: float | None = None,
    start: Start | None = None,
    reading: Mapping[str, Any] | None = None,
) -> AccuracyTask:
    """The task of that name: of `TASKS`, a scene, a case, or an MJCF or URDF file.

    t_end [s], start: in place of its own, or of `moving_start`.  reading: options of `dynamics.scenes.of_file`.
    Raises ValueError for a name that is none of these, a horizon that is not positive, or a start of another length.
    """
    fixed = TASKS.get(name) or (partial(cases.load, name) if name in cases.names() else None)
    if fixed is not None:
        task = fixed()
    elif name in scenes.names() or Path(name).suffix or ":" in name:
        task = AccuracyTask(**vars(scenes.load(name, **({} if name in scenes.names() else reading or {}))))
    else:
        raise ValueError(
            f"there is no scene {name!r}; there are {', '.join([*scenes.names(), *TASKS])}, the cases "
            f"({', '.join(cases.names()[:3])}, ..), files that end in .xml or .urdf, and models as file.py:name"
        )
    if t_end is not None:
        if not (math.isfinite(t_end) and t_end > 0.0):
            raise ValueError(f"t_end must be positive and finite, got {t_end!r} s")
        task = replace(task, t_end=float(t_end))
    if start is None and fixed is None:
        moving = moving_start(task)
        task = task if moving is task else replace(moving, about=f"{task.about}; {rest_text(task, moving)}")
    elif start is not None:
        if fixed is not None:
            raise ValueError(f"{name!r} has a start of its own; scenes and files take others")
        task = with_start(task, start)
    return task
