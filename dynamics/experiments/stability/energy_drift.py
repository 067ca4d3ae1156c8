"""Energy over long runs of equal steps: the band in which it stays, and the drift with its statistical error."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ...multibody.builders import planar_arm
from ...scenes import Scene
from ...simulation.simulate import simulate
from .case_result import CaseResult, Measurement, reason
from .cases.rotation import kepler

STEPS, QUICK = 10**6, 10**5
BLOCKS = 16  # whose means are taken as independent; their residuals show how far they are that
SIGMAS = 5.0  # with 14 degrees of freedom, a chance of 1 in 5000 for a slope that is zero
ROUNDINGS = 8.0  # of sqrt(steps) units of rounding: three standard deviations, some six roundings a step
UNIT = 2.0**-53
SYMPLECTIC = ("symplectic_euler", "verlet", "midpoint", "gauss4", "gauss6")
SECTION = "Energy over long runs"

DOUBLE = Scene("double pendulum", "two rods", planar_arm([1.0, 0.8], [1.0, 0.8]), (0.5, 0.3), (0.0, 0.0), STEPS * 0.01)
MOTIONS: dict[str, tuple[Scene, float]] = {  # without chaos, and the step to run each with [s]
    scene.name: (scene, step) for scene, step in ((DOUBLE, 0.01), (kepler(0.5, 1.0, 1.0), 0.02))
}


class Drift(NamedTuple):
    """Drift of an energy over a run, relative to `size`."""

    band: float  # largest less smallest
    drift: float  # the change over the run by the straight line of least squares
    error: float  # its standard error


def drift(energy: Array, size: float) -> Drift:
    """Band, drift and its standard error of energies, (T,), at equal intervals; from the means of 16 blocks.

    Means with the weights of a Hann window leave less of the oscillation of a symplectic method than plain ones.
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


def results(steps: int = STEPS, methods: tuple[str, ...] = SYMPLECTIC) -> Iterator[CaseResult]:
    """A result for each motion and method."""
    for name in MOTIONS:
        for method in methods:
            yield result(name, method, steps)


def result(name: str, method: str, steps: int) -> CaseResult:
    """Whether the drift of one run is zero: within five standard errors, or the random walk of its roundings."""
    scene, step = MOTIONS[name]
    run = simulate(scene.model, scene.q, scene.qd, steps * step, method, dt=step, estimate_error=False, progress=False)
    whole = run.stats.success
    measured = drift(run.energy, abs(float(run.energy[0]))) if whole else Drift(math.nan, math.nan, math.nan)
    walk = ROUNDINGS * UNIT * math.sqrt(steps)
    bound = max(SIGMAS * measured.error, walk)
    why = f"{SIGMAS:g} standard errors ({measured.error:.1e}), or the random walk of roundings ({walk:.1e})"
    stated = "the method's oscillation about the energy; stated, no bound"
    rows = (
        Measurement("drift", abs(measured.drift), bound, "of E", why),
        Measurement("band", measured.band, math.inf, "of E", stated),
    )
    stopped = "" if whole else run.stats.message
    counts = run.stats.steps, 0, run.stats.seconds, stopped
    about = f"{steps} steps of {step:g} s"
    return CaseResult(SECTION, name, about, method, rows, *counts, reason(SECTION, name, method, rows))
