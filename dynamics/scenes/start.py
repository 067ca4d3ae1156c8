"""Starts: a scene from a start that somebody chose by names, or from one that shows something where rest does not."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cgraph import Graph
from cgraph._shared import Array, or_nearest, real_array, real_number

from ..equations.state_equation import state_equation
from ..equations.states.consistent_state import nearest_state
from ..multibody.bodies.joint_coordinates import display_units
from ..systems.model import Model
from .scenes import Scene, of_model

Known = TypeVar("Known", bound=Scene)
Start = Mapping[str, float] | Sequence[float] | str
AWAY, IN_ALL = 0.5, np.pi  # rad, and the unit of any other coordinate: how far from a place of rest a motion starts
SHOWN = 4  # values of a start that a line of text names
_ROUNDING = 1e-9  # of the largest acceleration nearby: less is what is left of a difference


def with_start(scene: Known, start: Start) -> Known:
    """The scene from another start.

    start: {name: value} of what differs from the scene's own, as "q0", "q.knee", "qd.knee" or a coordinate's name; or
    all numbers of q and then qd; or the name or the number of one of the model's `starts`, with its parameters.
    Raises ValueError for a name that is none, or twice, or another number of numbers.
    """
    named = scene.mechanism.starts if scene.mechanism else {}
    if named and not isinstance(start, str | Mapping) and real_array("start", start).shape == (1,):
        start = {float(k): name for k, name in enumerate(named)}.get(start[0], f"{start[0]:g}")
    if isinstance(start, str):
        if start not in named:
            form = "a start is such as q0=0.5,qd0=1, or all numbers of q and qd"
            raise ValueError(f"there is no start {start!r:.80}; {or_nearest(start, [*named]) if named else form}")
        given = {name: value for name, value in named[start].items() if name in scene.parameters}
        if given and scene.mechanism:
            scene = replace(scene, model=replace(scene.mechanism, parameters={**scene.mechanism.parameters, **given}))
        start = {name: value for name, value in named[start].items() if name in _meant(scene)}
    values = [*scene.q, *scene.qd]
    if not isinstance(start, Mapping):
        numbers = real_array("start", start)
        if numbers.shape != (len(values),):
            shown = ", ".join(_names(scene)[:12]) + (", .." if len(_names(scene)) > 12 else "")
            raise ValueError(f"the start needs {len(values)} numbers ({shown}), got {numbers.size}")
        values = numbers.tolist()
    else:
        meant = _meant(scene)
        taken: dict[int, str] = {}
        for name, value in start.items():
            if name not in meant:
                raise ValueError(f"start: there is no {name!s:.80}; {or_nearest(str(name), _names(scene))}")
            if meant[name] in taken:
                raise ValueError(f"start: {name} is given twice, once as {taken[meant[name]]}")
            taken[meant[name]] = name
            values[meant[name]] = real_number(f"start: {name}", value)
    nq = len(scene.q)
    return replace(scene, q=tuple(values[:nq]), qd=tuple(values[nq:]))


def start(model: Model, key: str | int) -> tuple[Array, Array]:
    """A state by its name: one of the model's `starts`, which are the keyframes of a MJCF file.

    Parameters
    ----------
    model : Model
        A `Mechanism` or a scene of one.
    key : str or int
        The name, or the place among all; one without a name is "key 0" at place 0.

    Returns
    -------
    q, qd : ndarray
        (nq,) [rad or m] and (n,) [rad/s or m/s], as `simulate` takes them; what the start does not name is at rest.
        Inputs of actuators, which a start has too, are in `model.starts[key]`.

    Raises
    ------
    ValueError
        For a start that the model has not.
    TypeError
        For what is no name and no number.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0], [1.0])
    >>> arm = dyn.Mechanism(arm.bodies, arm.gravity, starts={"home": {"q.joint 1": 0.3}})
    >>> dyn.start(arm, "home")
    (array([0.3]), array([0.]))
    """
    scene = of_model(model)
    numbered = not isinstance(key, str) and scene.mechanism is not None and bool(scene.mechanism.starts)
    scene = with_start(scene, [real_number("key", key)] if numbered else str(key))
    return np.array(scene.q), np.array(scene.qd)


def moving_start(scene: Known, *, free: bool = True) -> Known:
    """The scene; where it would rest at its start for ever, from a start that shows something.

    That is half a radian from there at every joint, of many joints half a turn in all, or half a unit of coordinates
    without one, or such a velocity. Where its start has no rates, such as a center that attracts, it moves past it.
    free: whether nothing drives it; if something does, only a start without rates is another.
    """
    rate = state_equation(scene)
    if np.isfinite(_rates(rate, scene)) and (any(scene.qd) or not free):
        return scene
    starts = [scene, *_nearby(scene)]
    found = [_rates(rate, each) for each in starts]
    if not np.isfinite(found[0]):
        starts, found = starts[::-1], found[::-1]  # from rest it would fall into it
    largest = max((rates for rates in found if np.isfinite(rates)), default=0.0)
    for each, rates in zip(starts, found, strict=True):
        if np.isfinite(rates) and (rates > _ROUNDING * largest or any(each.qd)):
            return each
    return scene


def rest_text(scene: Scene, moving: Scene) -> str:
    """Reason and place of a start that is not the scene's: a sentence without its capital and its stop."""
    finite = np.isfinite(_rates(state_equation(scene), scene))
    reason = "at rest nothing moves" if finite else "at its start the rates are not finite"
    return f"{reason}, so it starts at {start_text(moving)}"


def start_text(scene: Scene) -> str:
    """`q.shoulder=0.5, qd.elbow=0.5`: what of the start is not zero."""
    shown = [f"{name}={value:.4g}" for name, value in zip(_names(scene), (*scene.q, *scene.qd), strict=True) if value]
    return ", ".join(shown[:SHOWN] + ([f"and {len(shown) - SHOWN} more"] if len(shown) > SHOWN else [])) or "0"


def _names(scene: Scene) -> list[str]:
    """Display names of the states, in the order of q and qd."""
    if scene.ode:
        return list(scene.coordinates)
    return [f"q.{name}" for name in scene.coordinates] + [f"qd.{name}" for name in scene.velocities]


def _meant(scene: Scene) -> dict[str, int]:
    """{name that a start may have: its place among q and qd}; the graphs' names come first."""
    nq = len(scene.q)
    meant = {name: i for i, name in enumerate(scene.coordinates)} | {name: i for i, name in enumerate(_names(scene))}
    return meant | {f"q{i}": i for i in range(nq)} | {f"qd{i}": nq + i for i in range(len(scene.qd))}


def _nearby(scene: Known) -> list[Known]:
    """The scene a little away from its start, at rest and then moving; only from what can be reached."""
    units = {} if scene.mechanism is None else display_units(scene.mechanism.moving)
    step = min(AWAY, IN_ALL / len(scene.q))
    away = [step * (units.get(f"q{i}", "rad") == "rad") for i in range(len(scene.q))]
    q = tuple([value + more for value, more in zip(scene.q, away, strict=True)])
    starts = []
    across = tuple([step * (-1.0) ** i for i in range(len(scene.qd))])
    for qd in ((0.0,) * len(scene.qd), (step,) * len(scene.qd), across):
        try:
            place, velocity = (q, qd) if scene.ode else nearest_state(scene, q, qd)
        except (ValueError, ArithmeticError):
            continue
        starts.append(replace(scene, q=tuple(map(float, place)), qd=tuple(map(float, velocity))))
    return starts


def _rates(rate: Graph, scene: Scene) -> float:
    """The largest rate of the state at the start without forces; not finite where there is none."""
    states = zip(rate.input_names, (*scene.q, *scene.qd), strict=False)
    values = dict.fromkeys(rate.input_names, 0.0) | dict(scene.parameters) | dict(states)
    try:
        with np.errstate(all="ignore"):
            return float(np.max(np.abs([float(value) for value in rate.evaluate(values).values()])))  # a NaN wins
    except (ValueError, ArithmeticError):
        return np.inf
