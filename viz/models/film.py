"""Animations of a model: motions side by side, of a mechanism as sticks, of other systems as curves over time."""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cgraph import _shared
from cgraph._shared import Array
from dynamics import Trajectory, scenes
from dynamics.multibody.trees.joint_positions import skeleton
from dynamics.multibody.trees.mechanism import as_mechanism
from dynamics.systems.model import Model

from ..animation.panels import FRAME_ROWS, RATE, FilmPanel, Motion, curves, film, sticks
from ..plots.plot import check_can_plot

MOST_FRAMES, MOST_MOTIONS = 1000, 4
FILM = 10.0  # s, a length that is offered


class Animation(bytes):
    """The bytes of a GIF; a notebook plays it."""

    def __repr__(self) -> str:
        return f"<Animation of {len(self)} bytes>"

    def _repr_html_(self) -> str:
        return f'<img src="data:image/gif;base64,{base64.b64encode(self).decode()}" style="max-width:100%">'


def animate(
    model: Model,
    motions: Trajectory | Sequence[Trajectory] | Mapping[str, Trajectory],
    path: str | os.PathLike[str] | None = None,
    *,
    wanted: Callable[[Array], ArrayLike] | None = None,
    marked: Collection[str] = (),
    speed: float = 1.0,
    dark: bool = False,
    title: str = "",
) -> Animation:
    """A film of one motion of a model, or of several side by side, in real time.

    A mechanism is drawn as sticks between its joints, any other system as its coordinates over time.

    Parameters
    ----------
    model : Model
        What moves.
    motions : Trajectory, sequence of Trajectory, or mapping of str to Trajectory
        What `simulate` gave; a mapping has the words above each, up to four. One that ends early stays as it is.
    path : str or path, optional
        The file to write, a .gif.
    wanted : callable, optional
        The motion that was wanted, drawn faint behind each: a function of times (T,) that gives coordinates (T, nq).
    marked : collection of str
        Words of the motions that are wrong, in the color of what is wrong.
    speed : float
        Seconds of the motion in one of the film.
    dark : bool
        On a dark page.
    title : str
        Words above all.

    Returns
    -------
    Animation
        The file's bytes; a notebook plays it.

    Raises
    ------
    TypeError, ValueError
        For motions of another model, more than four or none, a path that ends otherwise, and for a film of fewer than 2
        frames or more than 1000, which are 40 s.
    ImportError
        Without matplotlib.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> arm = dyn.planar_arm([1.0, 0.5], [1.0, 0.8])
    >>> fall = dyn.simulate(arm, [1.5, 0.0], [0.0, 0.0], t_end=0.2)
    >>> film = viz.animate(arm, fall)
    >>> film[:6]
    b'GIF89a'
    """
    target = None if path is None else _shared.require_path("the film's file", path)
    if target is not None:
        require_film(target)
        _shared.check_writable(target)
    check_can_plot()
    _shared.require_kind("title", title, str, "text")
    model = scenes.of_model(model)
    known = _motions(model, motions)
    wrong = _shared.require_sequence("marked", marked, "words of motions", str)
    if unknown := [each for each in wrong if each not in known]:
        raise ValueError(f"marked: there is no motion {unknown[0]!r:.80} ({_shared.or_nearest(unknown[0], [*known])})")
    times = _times(known.values(), speed)
    panel = _panel(model, known, times, wanted, set(wrong))
    made = Animation(film(panel, times, _shared.require_flag("dark", dark), title))
    if target is not None:
        _shared.write_files({target: made})
    return made


def require_film(target: Path) -> None:
    """Raises ValueError for a file that is no GIF by its name."""
    if target.suffix != ".gif":
        raise ValueError(f"a film's file must end in .gif, got {str(target)!r:.80}")


def _motions(model: Model, motions: object) -> dict[str, Trajectory]:
    """The motions by their words, checked."""
    if isinstance(motions, Trajectory):
        known: dict[str, Trajectory] = {"": motions}
    elif isinstance(motions, Mapping):
        known = dict(motions)
    else:
        several = _shared.require_sequence("motions", motions, "Trajectory")
        known = {str(i + 1) if len(several) > 1 else "": each for i, each in enumerate(several)}
    if not 1 <= len(known) <= MOST_MOTIONS:
        raise ValueError(f"a film shows 1 to {MOST_MOTIONS} motions side by side, got {len(known)}")
    nq = len(model.coordinates)
    for name, each in known.items():
        if not isinstance(name, str) or not isinstance(each, Trajectory):
            raise TypeError(f"motions must be what simulate gives, with words, got {each!r:.60} for {name!r:.40}")
        if each.q.shape[1] != nq:
            raise ValueError(
                f"a motion of this model has {nq} coordinate(s), motion {name!r:.40} has {each.q.shape[1]}"
            )
        if not len(each.t) or not np.isfinite(each.q).all():
            raise ValueError(f"motion {name!r:.40} has no rows, or one that is not finite")
    return known


def _times(motions: Collection[Trajectory], speed: float) -> Array:
    """The instants of the frames, and those between, from the first start to the last end."""
    if not 0.0 < _shared.real_number("speed", speed) < math.inf:
        raise ValueError(f"speed must be positive and finite, got {speed!r}")
    start = min(float(min(each.t[0], each.t[-1])) for each in motions)
    end = max(float(max(each.t[0], each.t[-1])) for each in motions)
    count = FRAME_ROWS * (frames(end - start, speed) - 1) + 1
    return np.asarray(start + speed / (RATE * FRAME_ROWS) * np.arange(count), dtype=np.float64)


def frames(length: float, speed: float) -> int:
    """Number of frames of a film of some seconds. Raises ValueError for fewer than 2, or too many."""
    if length == 0.0:
        raise ValueError("the motion ends where it starts, so there is nothing to film: pass --t-end or --start")
    count = length * RATE / speed
    if not 1.0 <= count < MOST_FRAMES:
        raise ValueError(
            f"a film has 2 to {MOST_FRAMES} frames, {RATE} a second, and {length:g} s at speed {speed:g} are "
            f"{count + 1.0:.4g}" + (f"; speed {length / FILM:.2g} makes it {FILM:g} s long" if length > 0.0 else "")
        )
    return int(count + 1e-9) + 1


def _panel(
    model: Model,
    known: Mapping[str, Trajectory],
    times: Array,
    wanted: Callable[[Array], ArrayLike] | None,
    wrong: Collection[str],
) -> FilmPanel:
    rows = [_at(each, times) for each in known.values()]
    if wanted is not None:
        rows.append(_wanted(wanted, times, len(model.coordinates)))
    mechanism, shown = as_mechanism(model), rows  # all at once, so that they are seen from one side
    seen = None if mechanism is None else skeleton(mechanism.bind(), np.concatenate(rows))
    if seen is not None:
        points = seen.points if seen.surfaces is None else np.concatenate([seen.points, seen.surfaces], axis=1)
        shown = np.split(points, len(rows))
    motions = [Motion(name, values, name in wrong) for name, values in zip(known, shown, strict=False)]
    ghost = None if wanted is None else shown[-1]
    if seen is None:
        return curves(motions, ghost, model.coordinates, times)
    return sticks(motions, ghost, seen.parents, seen.radii)


def _wanted(wanted: Callable[[Array], ArrayLike], times: Array, nq: int) -> Array:
    if not callable(wanted) or isinstance(wanted, type):
        raise TypeError(f"wanted must be a function of times, got {type(wanted).__name__}: {wanted!r:.60}")
    found = _shared.real_array("wanted", wanted(times))
    if found.shape != (len(times), nq) or not np.isfinite(found).all():
        raise ValueError(f"wanted must give finite coordinates (T, nq) = ({len(times)}, {nq}), got shape {found.shape}")
    return found


def _at(motion: Trajectory, times: Array) -> Array:
    """Coordinates at times, (T, nq): cubic between rows where velocities are their rates; beyond, the nearest row."""
    order = np.argsort(motion.t, kind="stable")  # of a run back in time
    t, q = motion.t[order], motion.q[order]
    if len(t) == 1:
        return np.repeat(q, len(times), axis=0)
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    h = t[k + 1] - t[k]
    s = np.clip(np.divide(times - t[k], h, out=np.ones_like(h), where=h > 0.0), 0.0, 1.0)[:, np.newaxis]
    straight: Array = (1.0 - s) * q[k] + s * q[k + 1]
    if motion.coordinates != motion.velocities:
        return straight
    v, h = motion.qd[order], h[:, np.newaxis]
    slope = q[k + 1] - q[k]
    curved: Array = straight + s * (1.0 - s) * ((1.0 - s) * (h * v[k] - slope) - s * (h * v[k + 1] - slope))
    return curved
