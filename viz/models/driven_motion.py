"""Driven motions: a scene moved by the torques that a formulation computes for a motion that is wanted."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array, real_array, real_number
from dynamics import Trajectory, inverse_dynamics, simulate
from dynamics.scenes import of_model
from dynamics.systems.model import Model

SWING = 0.5  # rad, and the unit of any other coordinate: how far the wanted motion goes
DT = 1e-3  # s, the step that the embedded formulations take


def driven(
    model: Model, formulation: str = "chain_rule", t_end: float | None = None
) -> tuple[Trajectory, Callable[[Array], Array]]:
    """The motion of a model under the torques of a formulation of inverse dynamics, and the motion that was wanted.

    Wanted is that every coordinate swings by half a radian (or half a unit) and back. The torques are computed
    beforehand, and nothing corrects them: with the right ones the model follows.

    Parameters
    ----------
    model : Model
        A System, a Mechanism or a Scene, which starts at its place, at rest.
    formulation : str
        One of `dyn.FORMULATIONS`; those that embed a step take one of 1 ms.
    t_end : float, optional
        How long the swing takes [s]; by default the scene's time, 3 s of another model.

    Returns
    -------
    Trajectory
        How the model moves.
    callable
        How it should: a function of times (T,) to coordinates (T, n).

    Raises
    ------
    ValueError
        For a model with constraints, or whose velocities are not the rates of its coordinates, and as `simulate` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> errors = []
    >>> for formulation in ("chain_rule", "by_definition"):
    ...     run, wanted = viz.driven(arm, formulation, t_end=1.0)
    ...     errors.append(float(abs(run.q - wanted(run.t)).max()))
    >>> errors[0] < 1e-6, errors[1] > 0.1
    (True, True)
    """
    scene = of_model(model, "the model")
    system = scene.system
    if system.kinematics.quasi is not None or system.constraints:
        why = "constraints" if system.constraints else "velocities that are not the rates of its coordinates"
        raise ValueError(f"{scene.name} has {why}: a wanted motion cannot be chosen coordinate by coordinate")
    end = scene.t_end if t_end is None else real_number("t_end", t_end)
    if not 0.0 < end < math.inf:
        raise ValueError(f"t_end must be positive and finite, got {end!r} s")
    rate, graph = 2.0 * math.pi / end, inverse_dynamics(system, formulation)

    def wanted(t: Array) -> Array:
        moved = SWING * 0.5 * (1.0 - np.cos(rate * real_array("t", t)))
        return np.array(scene.q) + moved[:, np.newaxis]

    def torques(_q: object, _qd: object, t: Node) -> list[Node]:
        moved = 0.5 * SWING * (1.0 - cg.cos(rate * t))
        qd, qdd = 0.5 * SWING * rate * cg.sin(rate * t), 0.5 * SWING * rate**2 * cg.cos(rate * t)
        values: dict[str, Node | float] = {name: cg.variable(name) for name in system.parameters}
        values |= {"t": t, "dt": DT}
        for i, place in enumerate([start + moved for start in scene.q]):
            values |= {f"q{i}": place, f"qd{i}": qd, f"qdd{i}": qdd}
            values |= {f"q{i}_old": place - DT * qd, f"qd{i}_old": qd - DT * qdd}
        return list(graph(**{name: values[name] for name in graph.input_names}).values())

    return simulate(scene, scene.q, np.zeros(system.n), end, tau=torques), wanted
