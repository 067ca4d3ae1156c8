"""Settings: a model, its start and horizon, and the exact motion that integrators are measured against."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ... import scenes
from ...equations.state_equation import state_inputs
from ...reference import Reference, reference
from ...reference.solution import scale
from ...simulation.trajectory import Array
from ...systems.model import Model, as_ode, as_system
from ..stability import cases
from ..stability.cases import Case
from ..stability.cases.orbits import kepler

INTERVALS = 64  # between the times at which errors are taken
DECADES = 12  # of the times, where they are spread by powers of ten

Known = Callable[[Sequence[float], str | Path | None], Reference]


@dataclass(frozen=True)
class Setting:
    """What a report is made of.

    start: q and then qd, or the states of an OdeSystem.  known(times, folder): the exact motion, of a case.
    sizes: what errors of the states are relative to; empty for the largest values over the times.
    decades: times go up by powers of ten, and errors are relative to the state's value at that time.
    """

    name: str
    about: str
    model: Model
    start: tuple[float, ...]
    t_end: float  # s
    known: Known | None = None
    sizes: tuple[float, ...] = ()
    stiff: bool = False
    decades: bool = False
    left_out: tuple[str, ...] = ()  # of a file, see Scene

    @property
    def times(self) -> list[float]:
        """When errors are taken [s]; the last is t_end."""
        if self.decades:
            return [*(self.t_end * 10.0 ** (k / 4) for k in range(-4 * DECADES, 0)), self.t_end]
        return [self.t_end * k / INTERVALS for k in range(INTERVALS + 1)]

    def exact(self, digits: int, folder: str | Path | None = None) -> Reference:
        """The motion at `times`: a case's own, or to so many digits. Raises what `multiprecision.reference` raises."""
        if self.known is not None:
            return self.known(self.times, folder)
        return reference(self.model, self.start, self.times, digits=digits, folder=folder)

    @property
    def mechanical(self) -> bool:
        """It has coordinates and velocities."""
        return as_ode(self.model) is None

    @property
    def conservative(self) -> bool:
        """Energy stays: no damping, no forces, and nothing that depends on time."""
        if not self.mechanical or state_inputs(self.model).timed:
            return False
        system = as_system(self.model)
        return not any(system.damping) and all(force.value == 0.0 for force in system.forces)

    def scales(self, exact: Reference) -> Array:
        """What errors are relative to, (T, m)."""
        if self.decades:
            return np.where(exact.x == 0.0, 1.0, np.abs(exact.x))
        return np.broadcast_to(self.sizes or scale(exact.x), exact.x.shape)


def _of_case(case: Case, decades: bool = False) -> Setting:
    return Setting(
        case.name,
        case.about,
        case.build(),
        case.start,
        case.t_end,
        lambda times, folder: _known(case, times, folder),
        sizes=() if decades else case.size,
        stiff=case.stiff,
        decades=decades,
    )


def _known(case: Case, times: Sequence[float], folder: str | Path | None) -> Reference:
    found = case.solution(times, folder)
    if found is None:
        raise ValueError(f"no solution of {case.name!r} is known to compare with")
    return found


def _of_scene(name: str, **options: Any) -> Setting:
    scene = scenes.load(name, **options)
    start = (*scene.q, *scene.qd)
    return Setting(scene.name, scene.about, scene.model, start, scene.t_end, left_out=scene.omitted)


SETTINGS: dict[str, Callable[[], Setting]] = {
    **{f"kepler {e:g}": partial(lambda e: _of_case(kepler(e, 3.5, 1.0)), e) for e in (0.3, 0.5, 0.7, 0.9)},
    "spring pendulum 1e8": lambda: _of_case(cases.load("damped spring pendulum, k = 1e+08")),
    "van der pol 1e6": lambda: _of_case(cases.load("Van der Pol, mu = 1e+06")),
    "robertson": lambda: _of_case(cases.load("Robertson, to 1e11"), decades=True),
}


def names() -> list[str]:
    """Names of the settings beside the scenes, the cases and the files."""
    return list(SETTINGS)


def load(
    name: str, *, t_end: float | None = None, start: Sequence[float] | None = None, ignore: bool = False
) -> Setting:
    """The setting of that name: of `SETTINGS`, a scene, a case, or an MJCF or URDF file.

    t_end [s], start: in place of its own.  ignore: leave out what of a file a mechanism cannot have.
    Raises ValueError for a name that is none of these, a horizon that is not positive, or a start of another length.
    """
    own = name in SETTINGS or name in cases.names()  # with a start that the exact motion belongs to
    if own:
        found = SETTINGS[name]() if name in SETTINGS else _of_case(cases.load(name))
    elif name in scenes.names() or Path(name).suffix:
        found = _of_scene(name, **({"ignore": True} if ignore and name not in scenes.names() else {}))
    else:
        raise ValueError(
            f"there is no scene {name!r}; there are {', '.join([*scenes.names(), *SETTINGS])}, the cases "
            f"({', '.join(cases.names()[:3])}, ..), and files that end in .xml or .urdf"
        )
    if t_end is not None:
        if not (math.isfinite(t_end) and t_end > 0.0):
            raise ValueError(f"t_end must be positive and finite, got {t_end!r} s")
        found = replace(found, t_end=float(t_end))
    if start is not None:
        states = state_inputs(found.model).states
        if len(start) != len(states):
            raise ValueError(f"the start needs {len(states)} numbers ({', '.join(states[:12])}), got {len(start)}")
        if own:
            raise ValueError(f"{name!r} has a start of its own; scenes and files take others")
        found = replace(found, start=tuple(map(float, start)))
    return found
