"""MotionSteps: a motion as it goes on, step by step or from one instant to the next."""

from __future__ import annotations

import math
import warnings

from cgraph._shared import Array, real_number

from .outcome import MotionError
from .stepper import Stepper
from .trajectory import SimulationWarning


class MotionSteps:
    """A motion as it goes on, made by `Run.start`. One thread at a time may move it.

    By `step` to its end it has the states of the trajectory's rows, to the bit. An instant of `propagate_until` cuts a
    step, so that those that follow are others, within the same tolerance.

    Attributes
    ----------
    t : float
        Where the motion is [s].
    q, qd : ndarray
        The state there, (nq,) and (n,) [rad or m, per second]; of an OdeSystem q is the state, and qd empty.

    Examples
    --------
    >>> import dynamics as dyn
    >>> motion = dyn.prepare(dyn.planar_arm([1.0], [1.0]), "rk4", dt=0.25)
    >>> going = motion.start([0.1], [0.0], t_end=1.0)
    >>> while going.t < 1.0:
    ...     going.step()
    ...     print(going.t, going.q.round(3))
    0.25 [0.058]
    0.5 [-0.033]
    0.75 [-0.095]
    1.0 [-0.077]
    """

    def __init__(self, run: Stepper, x: Array, t0: float, t_end: float | None) -> None:
        self._run, self._x, self._t_end = run, x, None if t_end is None else float(t_end)
        self._begun, self._direction = False, 0.0
        run.begin(x, t0, t0 + 1.0 if t_end is None else t_end)

    @property
    def t(self) -> float:
        """Time that the motion has reached [s]."""
        return self._run.t

    @property
    def q(self) -> Array:
        """Coordinates, (nq,)."""
        return self._run.q.copy()

    @property
    def qd(self) -> Array:
        """Velocities, (n,)."""
        return self._run.qd.copy()

    def step(self) -> None:
        """Take one step on the way to t_end.

        Raises
        ------
        MotionError
            Where the step cannot be made; the motion stays where it is.
        ValueError
            At t_end, and for a motion that was started without one.
        """
        if self._t_end is None or self._t_end == self.t:
            where = "was started without one" if self._t_end is None else f"is there, at t = {self.t:g} s"
            raise ValueError(f"a step goes on to t_end, and the motion {where}: propagate_until(t) goes on to a time")
        self._go(self._t_end)
        self._run.step()
        self._judge()

    def propagate_until(self, t: float) -> None:
        """Steps to an instant, the last of which ends there.

        Parameters
        ----------
        t : float
            The instant [s], in the direction in which the motion goes.

        Raises
        ------
        MotionError
            Where the motion stops before; it stays there.
        TypeError, ValueError
            For what is no time, or one that the motion has left behind.
        """
        t = real_number("t", t)
        if t == self.t:
            return
        self._go(t)
        self._run.until(t)
        self._judge()

    def _go(self, t: float) -> None:
        if not math.isfinite(t):
            raise ValueError(f"t must be finite, got {t!r} s")
        if self._direction * (t - self.t) < 0.0:
            raise ValueError(f"the motion is at t = {self.t:g} s and does not go back to t = {t:g} s: start it anew")
        if not self._begun:
            self._run.begin(self._x, self.t, t if self._t_end is None else self._t_end)
            self._direction, self._begun = math.copysign(1.0, t - self.t), True

    def _judge(self) -> None:
        for text in self._run.warnings:
            warnings.warn(text, SimulationWarning, stacklevel=3)
        self._run.warnings.clear()
        if self._run.status:
            raise MotionError(f"the motion {self._run.status}")
