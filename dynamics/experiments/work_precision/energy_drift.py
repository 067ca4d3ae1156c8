"""Energy over long runs of equal steps: the band in which it stays, and the drift with its statistical error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ...multibody.planar_arm import planar_arm
from ...simulation.simulate import simulate
from ..stability.cases.orbits import kepler
from ..stability.known_limits import reason
from ..stability.verdict import Figure, Verdict

Array = np.ndarray[Any, np.dtype[np.float64]]

STEPS, QUICK = 10**6, 10**5
BLOCKS = 16  # whose means are taken as independent; their residuals show how far they are that
SIGMAS = 5.0  # with 14 degrees of freedom, a chance of 1 in 5000 for a slope that is zero
ROUNDINGS = 8.0  # of sqrt(steps) units of rounding: three standard deviations, some six roundings a step
UNIT = 2.0**-53
METHODS = ("symplectic_euler", "verlet", "midpoint", "gauss4", "gauss6")
SECTION = "Energy over long runs"


class Model(NamedTuple):
    """A motion without chaos, and the step to run it with [s]."""

    name: str
    build: Callable[[], Any]
    q: tuple[float, ...]
    qd: tuple[float, ...]
    dt: float


MODELS = (
    Model("double pendulum", lambda: planar_arm([1.0, 0.8], [1.0, 0.8]), (0.5, 0.3), (0.0, 0.0), 0.01),
    Model("Kepler, e = 0.5", kepler(0.5, 1.0, 1.0).build, (0.5, 0.0), (0.0, math.sqrt(3.0)), 0.02),
)


class Drift(NamedTuple):
    """Of an energy over a run: relative to `size`."""

    band: float  # largest less smallest
    drift: float  # the change over the run by the straight line of least squares
    error: float  # its standard error


def drift(energy: Array, size: float) -> Drift:
    """Band, drift and its standard error of energies, (T,), at equal intervals; from the means of 16 blocks.

    The energy of a symplectic method oscillates with the motion. Means with the weights of a Hann window leave less of
    an oscillation, by the cube of the number of its periods in a block, than plain ones; the rest is in the residuals
    of the line, and so in the standard error.
    """
    deviation = (energy - energy[0]) / size
    length = len(deviation) // BLOCKS
    window = np.hanning(length + 2)[1:-1]
    means = deviation[: length * BLOCKS].reshape(BLOCKS, length) @ (window / window.sum())
    t = (np.arange(BLOCKS) - 0.5 * (BLOCKS - 1)) / BLOCKS  # the run is one unit of time
    slope = float(t @ means / (t @ t))
    rest = means - means.mean() - slope * t
    error = math.sqrt(float(rest @ rest) / (BLOCKS - 2) / float(t @ t))
    return Drift(float(np.ptp(deviation)), slope, error)


def verdicts(steps: int = STEPS, methods: tuple[str, ...] = METHODS) -> Iterator[Verdict]:
    """A verdict for each model and method."""
    for model in MODELS:
        for method in methods:
            yield verdict(model, method, steps)


def verdict(model: Model, method: str, steps: int) -> Verdict:
    """Whether the drift of one run is zero: within five standard errors, or the random walk of its roundings."""
    run = simulate(model.build(), model.q, model.qd, steps * model.dt, method, dt=model.dt, progress=False)
    found = drift(run.energy, abs(float(run.energy[0])))
    walk = ROUNDINGS * UNIT * math.sqrt(steps)
    figures = (
        Figure(
            "drift",
            abs(found.drift),
            max(SIGMAS * found.error, walk),
            "of E",
            f"{SIGMAS:g} standard errors ({found.error:.1e}), or the random walk of roundings ({walk:.1e})",
        ),
        Figure("band", found.band, math.inf, "of E", "the method's oscillation about the energy; stated, no bound"),
    )
    return Verdict(
        SECTION,
        model.name,
        f"{steps} steps of {model.dt:g} s",
        method,
        figures,
        run.stats.steps,
        0,
        run.stats.seconds,
        "" if run.stats.success else run.stats.message,
        reason(SECTION, model.name, method, figures),
    )
