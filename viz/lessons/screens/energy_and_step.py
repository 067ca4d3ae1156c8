"""Energy and the step: how fast the error of a motion shrinks with the step, by the order of its method."""

import math
import warnings
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array
from dynamics import SimulationWarning, energy, simulate, state_equation

from ... import theme
from ...pages.document import Table
from ..glossary import term
from ..screen import Screen
from ..subject import Subject, number

FACTORS = (2, 4, 16)  # by which the error of a method of order 1, 2 or 4 shrinks
STEPS, FINE = (300, 100, 30, 10), 16  # of the coarse motion, and how many of the reference's there are in one
LONGEST_MOTION, HALVINGS = 1.0, 20  # s, of the motion whose order is measured, and how often it is halved
ROUNDING_ERROR = 1e-12  # of the largest coordinate: an error that says nothing about a method
SMALL_ERROR = 1e-5  # of the largest coordinate: an error that has not grown beyond its order
_BRAKED = " This system is damped or driven, so its energy does change: the dashed line is what a method should follow."


def energy_and_step(subject: Subject) -> Screen:
    """The screen of a system."""
    rate, total = state_equation(subject.system), energy(subject.system)
    forces = (*subject.system.damping, *subject.system.forces)
    braked = any([getattr(each, "value", each) != 0.0 for each in forces])
    measured = _measured(subject)
    t_end, steps = measured.t_end, measured.steps
    rows = [[f"{t_end / (factor * steps):.3g}", number(error)] for factor, error in measured.errors.items()]
    play = subject.play(
        "energy",
        {"rate": rate, "energy": total},
        t_end=min(subject.scene.t_end, 3.0),
        fine=2000 if len(rate.nodes) < 1000 else 500,
        colors=[theme.ORANGE, theme.BLUE],
        unit=" J" if subject.units else "",
    )
    return Screen(
        "energy-and-step",
        "Energy and the step",
        5,
        f"<p>Now the system moves on its own, step by step. {term('Euler’s method')} follows the rate at the start of a step; the "
        f"classical Runge-Kutta method, {term('rk4')}, takes a weighted mean of four. Without damping and drive energy is conserved, so its "
        f"change is an error that can be seen.{_BRAKED if braked else ''}</p>",
        f"rk4 takes {steps} steps to t = {number(t_end)} s. We halve the step. The error of the positions "
        "then becomes smaller by a factor of about …",
        (*map(str, FACTORS), "none of these factors"),
        measured.answer,
        f"<p>{measured.words} {_of_euler(subject, measured)}</p>"
        + Table("rk4: largest error of a coordinate", ["dt [s]", "at the end"], rows).html(),
        "The line to compare with is the dashed one"
        + (": the energy of this system does change." if braked else "; here it stays level."),
        "Move the number of steps. Orange: the energy by Euler’s method over time; blue: by rk4; dashed: by rk4 with very small steps.",
        play,
    )


class Measured(NamedTuple):
    """Errors of rk4 at the end of a motion, {1: by `steps` steps, 2: by twice as many}, and what rounding makes of them."""

    t_end: float
    steps: int
    exact: Array  # coordinates at the end
    errors: dict[int, float]
    rounding: float

    @property
    def answer(self) -> int:
        """The place of the measured factor among `FACTORS`; the one after the last where it is none of them."""
        if self.errors[2] <= self.rounding:
            return len(FACTORS)
        powers = [abs(math.log2(self.errors[1] / self.errors[2] / factor)) for factor in FACTORS]
        return powers.index(min(powers)) if min(powers) < 0.5 else len(FACTORS)

    @property
    def words(self) -> str:
        """What is behind the answer."""
        order = (
            "The slopes of rk4 are weighted so that all terms of the error up to dt⁴ cancel. So half the step leaves about a "
            "sixteenth of the error, a tenth of the step a ten-thousandth."
        )
        if self.errors[1] <= self.rounding:
            return f"rk4 is exact for this motion: what is left is rounding. For most motions it is not. {order}"
        if self.errors[2] <= self.rounding:
            return f"At half the step nothing but rounding is left, so there is no factor to be measured. {order}"
        factor = f"Measured here: a factor of {number(self.errors[1] / self.errors[2])}."
        usual = self.answer == FACTORS.index(16)
        return f"{order} {factor}" if usual else f"{factor} Where the rate is smooth one would expect 16. {order}"


def _of_euler(subject: Subject, measured: Measured) -> str:
    """Sentence on the errors of Euler's method with the same steps."""
    ends = [_end(subject, measured.t_end, factor * measured.steps, "euler") for factor in (1, 2)]
    coarse, finer = (float(np.abs(end - measured.exact).max()) for end in ends)
    if math.isnan(coarse + finer):
        return ""
    if finer <= measured.rounding:
        return "Euler’s method is exact here, too."
    return f"The error of Euler’s method becomes smaller by a factor of {number(coarse / finer)} alone."


def _measured(subject: Subject) -> Measured:
    """Errors of a motion and of steps for which the error has not grown beyond its order, nor drowned in rounding.

    Where there is no such motion, the last one whose error is small.
    Raises RuntimeError for a motion that has none.
    """
    t_end, last = min(subject.scene.t_end, LONGEST_MOTION), None
    for _ in range(HALVINGS):
        for steps in STEPS:
            exact, *ends = (_end(subject, t_end, factor * steps) for factor in (FINE, 1, 2))
            size = max(float(np.abs(exact).max()), float(np.abs(subject.q).max()))
            errors = {factor: float(np.abs(end - exact).max()) for factor, end in enumerate(ends, start=1)}
            if errors[1] <= SMALL_ERROR * size and not math.isnan(errors[2]):
                last = Measured(t_end, steps, exact, errors, ROUNDING_ERROR * size)
                if errors[2] > last.rounding:
                    return last
        if last is not None:
            return last
        t_end /= 2.0
    raise RuntimeError(f"{subject.scene.name} moves too fast for a lesson: rk4 misses it within {2.0 * t_end:g} s")


def _end(subject: Subject, t_end: float, steps: int, method: str = "rk4") -> Array:
    """The coordinates at the end of a motion; NaN of one that is not whole."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SimulationWarning)  # that an error is large is what is looked for
        run = simulate(subject.system, subject.q, subject.qd, t_end, method, dt=t_end / steps)
    return run.q[-1] if run.stats.success else np.full(len(subject.q), np.nan)
