"""Energy and the step: how fast the error of a motion shrinks with the step, by the order of its method."""

from __future__ import annotations

import warnings

import numpy as np

from cgraph.extend import Array
from dynamics import SimulationWarning, energy, simulate, state_equation

from .. import theme
from ..pages.document import Table
from ..pages.operations import graph_data
from .subject import Screen, Subject, number

FACTORS = (2, 4, 16)
STEPS, FINE = 100, 16  # of the coarse motion, and how many of the reference's there are in one
LONGEST_MOTION, HALVINGS = 1.0, 20  # s, of the motion whose order is measured, and how often it is halved
ROUNDING_ERROR = 1e-13  # of some hundred steps: an error that says nothing about a method
SMALL_ERROR = 1e-5  # of the largest coordinate: an error that has not grown beyond its order


_BRAKED = (
    " This system is braked or driven, so its energy changes by right: the dashed line is what a method should follow."
)


def energy_and_step(subject: Subject) -> Screen:
    """The screen of a system."""
    rate, total = state_equation(subject.system), energy(subject.system)
    forces = (*subject.system.damping, *subject.system.forces)
    braked = any([getattr(each, "value", each) != 0.0 for each in forces])
    t_end, errors = _measured(subject)
    told = (
        f"Measured here: a factor of {number(errors[1] / errors[2])}."
        if errors[2] > ROUNDING_ERROR * max(1.0, float(np.abs(subject.q).max()))
        else "This system moves so evenly that both are rounding."
    )
    rows = [[f"{t_end / (factor * STEPS):.3g}", number(error)] for factor, error in errors.items()]
    play = subject.play(
        "energy",
        {"rate": rate},
        energy=graph_data(total),
        nq=subject.system.nq,
        n=subject.system.n,
        t_end=min(subject.scene.t_end, 3.0),
        fine=2000 if len(rate.nodes) < 1000 else 500,
        colors=[theme.ORANGE, theme.BLUE],
    )
    return Screen(
        "energy-and-step",
        "Energy and the step",
        4,
        "<p>Now the system moves on its own, step by step. Euler's method follows the slope at the start of a step; the "
        "classical Runge-Kutta method, rk4, weighs four slopes. Where nothing brakes, energy must stay what it is, so its "
        f"change is an error that everybody can see.{_BRAKED if braked else ''}</p>",
        f"rk4 takes {STEPS} steps to t = {number(t_end)} s. We halve the step. The error of where "
        "everything is then becomes smaller by a factor of about …",
        tuple([str(factor) for factor in FACTORS]),
        FACTORS.index(16),
        "<p>The slopes of rk4 are weighed so that all terms of the error up to dt⁴ cancel. So half the step leaves about a "
        f"sixteenth of the error, a tenth of the step a ten-thousandth. {told} "
        "Euler's error is only halved.</p>"
        + Table("rk4: largest error of a coordinate", ["dt [s]", "at the end"], rows).html(),
        "Move the number of steps. Orange: Euler's energy over time; blue: that of rk4; dashed: that of rk4 with very small steps.",
        play,
        "Of a braked system energy falls by right: the line to compare with is the dashed one.",
    )


def _measured(subject: Subject) -> tuple[float, dict[int, float]]:
    """A time over which the coarse motion's error is small, so that its order shows; and errors {1: .., 2: ..}.

    Raises RuntimeError for a motion that has none.
    """
    t_end = min(subject.scene.t_end, LONGEST_MOTION)
    for _ in range(HALVINGS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SimulationWarning)  # that the error is large is what is looked for
            exact, coarse, finer = (_end(subject, t_end, factor * STEPS) for factor in (FINE, 1, 2))
        if exact is not None and coarse is not None and finer is not None:
            errors = {1: float(np.abs(coarse - exact).max()), 2: float(np.abs(finer - exact).max())}
            if errors[1] <= SMALL_ERROR * float(np.abs(exact).max()):
                return t_end, errors
        t_end /= 2.0
    raise RuntimeError(f"{subject.scene.name} moves too fast for a lesson: rk4 misses it within {2.0 * t_end:g} s")


def _end(subject: Subject, t_end: float, steps: int) -> Array | None:
    """The coordinates at the end of a motion by rk4; None of one that is not whole."""
    run = simulate(subject.system, subject.q, subject.qd, t_end, "rk4", dt=t_end / steps)
    end: Array = run.q[-1]
    return end if run.stats.success else None
