"""Gradients of many motions of one model, by programs that are made once."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array

from ...systems.model import Model
from ..outcome import MotionError
from ..run_options import Options
from ..trajectory import SimulationWarning
from .doubts import doubts
from .gradient import differentiated
from .motions import START, TORQUE, VELOCITY, Loss, Motions, motions_of

FEW_MOTIONS = 4  # motions: fewer by a method that iterates are done sooner one by one
WIDE_BLOCK = 16  # motions side by side: whole vectors of any processor, of which what is recorded stays in its caches


@dataclass(frozen=True, eq=False)
class MotionGradients:
    """The losses of N motions, and their gradients.

    Attributes
    ----------
    value : ndarray, (N,)
        The losses; NaN, as all else, of a motion that does not stay finite or does not reach its end.
    gradients : dict of str to ndarray
        As of `MotionGradient`, with an axis of N first.
    t : ndarray, (steps + 1,)
        Where equal steps begin, and the last one ends [s]. Of chosen steps, which each motion has for itself, its start
        and end alone, (2,).
    q, qd : ndarray, (N, nq) and (N, n)
        Where the motions end.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> fan = dyn.gradient_many(arm, lambda q, qd, t: q[0], [[0.1], [0.2], [0.3]], [0.0], t_end=0.1, dt=0.05)
    >>> fan.value.shape, fan["q"].shape, fan.q.shape
    ((3,), (3, 1), (3, 1))
    """

    value: Array
    gradients: dict[str, Array]
    t: Array
    q: Array
    qd: Array

    def __getitem__(self, name: str) -> Array:
        """The gradients by one of `wrt`. Raises KeyError for another name."""
        return self.gradients[name]


def gradient_many(
    model: Model,
    loss: Loss | None,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str | None = None,
    *,
    running: Loss | None = None,
    wrt: str | Iterable[str] | None = None,
    tau: ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    **options: Unpack[Options],
) -> MotionGradients:
    """Losses of N motions and their gradients, each by its own start, forces and parameters: `gradient`, N times.

    Motions in equal steps go side by side, a vector of them at a time; those that choose their steps go one by one, as
    do fewer than four by a method that iterates. One that does not stay finite, whose equations are not solved, or
    which does not reach its end, is NaN, and a `SimulationWarning` says how many are, and of the first when and why.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The starts, (N, nq) and (N, n), or (nq,) and (n,) for all; of an OdeSystem q is the state, and qd None.
    loss, t_end, running, wrt, **options
        As for `gradient`.
    method : str, optional
        As for `gradient`: "dop853", and "rk4" where `dt` or a row of forces a step asks for equal steps.
    tau : float, array_like or callable
        Applied force [N m or N]: constant, (n,) or (N, n); a row a step, (N, steps, n); or a controller in closed form.
    parameters : mapping, optional
        As for `gradient`, a number for all or one for each motion, (N,).

    Returns
    -------
    MotionGradients
        `value`, (N,), and the gradients by each name of `wrt`.

    Raises
    ------
    TypeError, ValueError, SingularMassMatrixError
        As `gradient` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> fan = dyn.gradient_many(arm, lambda q, qd, t: q[0], [[0.5], [1.0], [2.0]], [0.0], t_end=1.0, wrt="q")
    >>> fan["q"].round(4).tolist()
    [[-0.8804], [-1.1123], [-0.595]]
    """
    losses = loss, running
    motions = motions_of(model, q, qd, t_end, method, tau, parameters, wrt, (), losses, options, many=True)
    count, problem = motions.many, motions.problem
    value, end = np.full(count, np.nan), np.full((count, problem.size), np.nan)
    by_name = {name: np.full((count, *shape), np.nan) for name, shape in _shapes(motions).items()}
    early, said, parts = dict[int, str](), dict[int, str](), _parts(motions)
    for part in parts:
        try:
            run, losses_of_part, slopes, bars = differentiated(motions.of(slice(part.start, part.stop)), *losses)
        except MotionError as error:
            if len(part) == 1:
                early[part[0]] = str(error)
            else:  # one of them has no derivative
                parts += [range(k, k + 1) for k in part]
            continue
        arrived = np.asarray(np.isfinite(run.end).all(axis=0))
        rows = part.start + np.flatnonzero(arrived)
        results = [(value, losses_of_part), (end, run.end), *[(by_name[name], slopes[name]) for name in slopes]]
        for table, array in results:
            table[rows] = np.moveaxis(array, -1, 0)[arrived]
        for number, whole, sentences in zip(part, arrived, doubts(run, losses_of_part, slopes, bars), strict=True):
            if not whole:
                early[number] = f"the motion {run.stopped(number - part[0], run.segments[0])}"
            elif sentences:
                said[number] = sentences[0]
    for each, what in ((early, "stopped early"), (said, "doubtful")):
        if each:
            first, text = min(each.items())
            text = f"{len(each)} of {count} motions {what}: motion {first}: {text}"
            warnings.warn(text, SimulationWarning, stacklevel=2)
    t = motions.steps[0].t if motions.steps else np.array([motions.options.t0, motions.options.t_end])
    return MotionGradients(value, by_name, t, end[:, : problem.nq], end[:, problem.nq :])


def _parts(motions: Motions) -> list[range]:
    """The motions that go one by one, or side by side, of which a last one goes with those before it."""
    count = motions.many
    alone = motions.options.adaptive or (count < FEW_MOTIONS and motions.method.step(motions.problem).iterates)
    begins = [*(range(count) if alone else range(0, max(1, count - 1), WIDE_BLOCK)), count]
    return [range(begin, end) for begin, end in itertools.pairwise(begins)]


def _shapes(motions: Motions) -> dict[str, tuple[int, ...]]:
    """Shapes of the gradients of a motion, by the names of `wrt`."""
    problem, nq = motions.problem, motions.problem.nq
    n = problem.size - nq
    shapes = {START: (nq if problem.system is None else n,), VELOCITY: (n,), TORQUE: motions.tau.shape[:-1]}
    return {name: shapes.get(name, ()) for name in motions.wrt}
