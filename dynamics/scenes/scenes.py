"""Scenes: named models and models of files with a start, for examples, figures and the command line."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import nearest, or_nearest, real_array, real_number

from ..io.load import load_at_start
from ..io.smooth_forces import smooth
from ..multibody.bodies.body import NO_LIMITS, Limits
from ..multibody.builders import planar_arm
from ..multibody.trees.mechanism import Mechanism, as_mechanism
from ..systems.model import Model, as_ode, as_system
from ..systems.ode_system import OdeSystem
from ..systems.system import System
from .python_model import is_python, python_model, short_name


@dataclass(frozen=True)
class Scene:
    """A model, the state it starts from, and how long it is watched.

    Parameters
    ----------
    name, about : str
        Its name, and one line on it.
    model : Model
        A System, a Mechanism or an OdeSystem.
    q, qd : tuple of float
        The start [rad or m], [rad/s or m/s].
    t_end : float
        How long it is watched [s].

    Raises
    ------
    TypeError
        For what is no model.
    ValueError
        For a start that is not one finite number for each coordinate, or a time that is not positive and finite.

    Examples
    --------
    >>> import dynamics as dyn
    >>> scene = dyn.scenes.load("chain", n=2)
    >>> scene.coordinates, scene.t_end
    (('joint 1', 'joint 2'), 3.0)
    """

    name: str
    about: str  # one line
    model: Model  # a System, or what has one
    q: tuple[float, ...]  # rad or m
    qd: tuple[float, ...]  # rad/s or m/s
    t_end: float  # s

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not isinstance(self.about, str):
            raise TypeError(f"the name and about of a scene must be text, got {self.name!r:.40} and {self.about!r:.40}")
        if not hasattr(self.model, "coordinates") or isinstance(self.model, type):
            raise TypeError(f"a scene needs a model, got {type(self.model).__name__}: {self.model!r:.60}")
        counts = len(self.model.coordinates), len(self.model.velocities)
        for what, values, needed in (("q", self.q, counts[0]), ("qd", self.qd, counts[1])):
            array = real_array(f"scene {self.name!r}: {what}", values)
            if array.shape != (needed,) or not np.isfinite(array).all():
                raise ValueError(f"scene {self.name!r}: {what} needs {needed} finite numbers, got {values!r:.60}")
        if not (real_number("t_end", self.t_end) > 0.0 and math.isfinite(self.t_end)):
            raise ValueError(f"scene {self.name!r}: t_end must be positive and finite, got {self.t_end!r} s")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Coordinates of the model."""
        return self.model.coordinates

    @property
    def velocities(self) -> tuple[str, ...]:
        """Velocities of the model."""
        return self.model.velocities

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters of the model."""
        return self.model.parameters

    @property
    def system(self) -> System:
        """The Lagrangian system of the model. Raises TypeError where it has none."""
        return as_system(self.model)

    @property
    def mechanism(self) -> Mechanism | None:
        """The bodies of the model, if it has any."""
        return as_mechanism(self.model)

    @property
    def limits(self) -> dict[str, Limits]:
        """{coordinate: its limits} of the bodies, see `Limits`; of a model without bodies there are none."""
        return self.mechanism.limits if self.mechanism else dict.fromkeys(self.coordinates, NO_LIMITS)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Sentences on what a model has not of the file that it was read from."""
        return self.mechanism.left_out if self.mechanism else ()

    @property
    def ode(self) -> OdeSystem | None:
        """The first-order system of the model, if it is one."""
        return as_ode(self.model)


def spring_mass() -> Scene:
    """A rotor of inertia I held by a spring of stiffness k, the one-joint system of Figures 1 to 3."""

    def lagrangian(q: Sequence[Node], qd: Sequence[Node], t: Node, p: Mapping[str, Node]) -> Node:
        with cg.tag("kinetic"):
            kinetic = 0.5 * p["I"] * qd[0] ** 2
        with cg.tag("potential"):
            potential = 0.5 * p["k"] * q[0] ** 2
        return kinetic - potential

    system = System(lagrangian, coordinates=["theta"], parameters={"I": 1.0, "k": 1.0})
    about = "a rotor on a spring, L = I qd^2/2 - k q^2/2 (Figures 1 to 3)"
    return Scene("spring_mass", about, system, (1.0,), (0.0,), 10.0)


def two_link() -> Scene:
    """A two-link arm of the textbook: links of 1 m without mass, 1 kg at the end of each, in a vertical plane.

    Angles are relative, zero hanging straight down, as of `planar_arm`.
    """

    def lagrangian(q: Sequence[Node], qd: Sequence[Node], t: Node) -> list[Node]:
        with cg.tag("kinetic"):
            first, second = qd[0], qd[0] + qd[1]
            kinetic = first**2 + 0.5 * second**2 + first * second * cg.cos(q[1])
        with cg.tag("potential"):
            depth = 2.0 * cg.cos(q[0]) + cg.cos(q[0] + q[1])
            below = 9.81 * depth  # minus the potential energy
        return [kinetic, below]

    about = "a two-link arm in a vertical plane: links of 1 m without mass, 1 kg at the end of each"
    return Scene("two_link", about, System(lagrangian, ["shoulder", "elbow"]), (0.5, 1.5), (0.0, 0.0), 3.0)


def triple_pendulum(mass_model: str = "rod") -> Scene:
    """The paper's three-link arm: masses 1.0 0.8 0.7 kg, lengths 1.0 0.8 0.7 m, damping 0.1 N m s, in free fall.

    It starts at rest, straight out to the right: q = (pi/2, 0, 0). mass_model: "rod" or "point", as in `planar_arm`.
    """
    arm = planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], damping=0.1, mass_model=mass_model)
    about = "the three-link arm in free fall (Figures 4 to 6, Table 1)"
    return Scene("triple_pendulum", about, arm, (math.pi / 2, 0.0, 0.0), (0.0,) * 3, 3.0)


MOST_LINKS = 100_000  # of a chain; its equations take some kilobytes a link


def chain(n: int = 10) -> Scene:
    """A chain of n equal rods, 1 kg and 1 m in all, let go at 45 degrees."""
    if not isinstance(n, (int, np.integer)) or n < 1:
        raise ValueError(f"a chain needs at least one link, got {n!r:.60}")
    if n > MOST_LINKS:
        raise ValueError(f"a chain of {n} links is more than can be derived here, {MOST_LINKS}; see `planar_arm`")
    arm = planar_arm([1.0 / n] * n, [1.0 / n] * n)
    start = (math.pi / 4,) + (0.0,) * (n - 1)
    return Scene("chain", f"a chain of {n} equal rods, let go at 45 degrees", arm, start, (0.0,) * n, 3.0)


_SCENES: dict[str, Callable[..., Scene]] = {
    each.__name__: each for each in (spring_mass, two_link, triple_pendulum, chain)
}
_SUFFIXES = (".xml", ".urdf")


def of_file(
    path: str | os.PathLike[str],
    ignore: bool = False,
    floating: bool = False,
    *,
    limits: Sequence[float] | None = None,
    friction: float | None = None,
    actuators: bool = False,
    contacts: str | Mapping[str, float | str] | None = None,
) -> Scene:
    """The mechanism of a model file, at rest where the file has it, named as the file is without its suffix.

    Parameters
    ----------
    path : str or path
        MJCF or URDF.
    ignore : bool
        Leave out what a mechanism cannot have; `left_out` says what.
    floating : bool
        Of URDF, whether the root link moves freely.
    limits, friction, actuators, contacts
        Forces that stand for these, as `load_mjcf` and `load_urdf` take them. A URDF that floats and has contacts
        starts with its lowest sphere on the ground.

    Returns
    -------
    Scene

    Raises
    ------
    ValueError
        As `load_mjcf` and `load_urdf` do, for `floating` of MJCF, and for `actuators` of URDF.
    """
    mechanism, q = load_at_start(path, ignore, floating, smooth(limits, friction, actuators, contacts))
    about = f"{len(mechanism.moving)} moving bodies of {os.fspath(path)}"
    return Scene(Path(path).stem, about, mechanism, q, (0.0,) * mechanism.system.n, 3.0)


def of_model(model: Model, name: str = "model") -> Scene:
    """The scene of a model: at rest at its zero, watched for 3 s.

    Parameters
    ----------
    model : Model
        A System, an OdeSystem or a Mechanism; a Scene is given back as it is.
    name : str
        What pages and files call it.

    Returns
    -------
    Scene
        Quaternions of ball and free joints start as no turn.

    Raises
    ------
    TypeError
        For what is no model.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.scenes.of_model(dyn.planar_arm([1.0, 0.5], [1.0, 0.8])).q
    (0.0, 0.0)
    """
    if all([hasattr(model, each) for each in ("model", "t_end")]):
        return model  # type: ignore[return-value]  # with the attributes of a scene
    if as_ode(model) is not None:
        return Scene(name, f"{len(model.coordinates)} states", model, (0.0,) * len(model.coordinates), (), 3.0)
    system = as_system(model)
    count, more = len(system.coordinates), ", .." if len(system.coordinates) > 12 else ""
    about = f"{count} coordinate{'s' * (count != 1)}: {', '.join(system.coordinates[:12])}{more}"
    return Scene(name, about, model, tuple(system.kinematics.neutral), (0.0,) * system.n, 3.0)


def is_model_file(name: object) -> bool:
    """Whether a name stands for a model file, MJCF or URDF: it ends in .xml or .urdf, or is there as a file.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.scenes.is_model_file("robot.urdf"), dyn.scenes.is_model_file("chain")
    (True, False)
    """
    if not (isinstance(name, str | os.PathLike) and name) or name in _SCENES or is_python(os.fspath(name)):
        return False
    return Path(name).suffix.lower() in _SUFFIXES or Path(name).exists()


def _of_python(name: str, /) -> Scene:
    return of_model(python_model(name), short_name(name))


def names() -> list[str]:
    """Names of the scenes."""
    return list(_SCENES)


def load(name: str | os.PathLike[str], /, **options: Any) -> Scene:
    """The scene of a name, of the MJCF or URDF file at a path, or of a model in Python.

    Parameters
    ----------
    name : str or path
        One of `names()`, "robot.xml", or a model in Python as "arm.py:system" or "package.module:system": any model, or
        a function without arguments that returns one. The file is executed, so that it must be one that you trust.
    **options
        Of the scene's function, as `load("chain", n=20)`, or of a model file, `load("robot.xml", ignore=True)`.

    Returns
    -------
    Scene
        A model that has no start of its own is at rest, at its zero or where its file has it.

    Raises
    ------
    ValueError
        For a name that is none of these, a Python file without that model or that raises, and as `of_file` does.
    TypeError
        For an option that the scene's function has not.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.scenes.load("chain", n=2).coordinates
    ('joint 1', 'joint 2')
    """
    make: Callable[..., Scene]
    if isinstance(name, str) and name in _SCENES:
        make = _SCENES[name]
    elif is_model_file(name):
        make = partial(of_file, name)
    elif isinstance(name, str | os.PathLike) and is_python(text := os.fspath(name)):
        make = partial(_of_python, text)
    else:
        if isinstance(name, str) and nearest(name, _SCENES):
            raise ValueError(f"there is no scene {name!r:.200}; {or_nearest(name, [*_SCENES])}")
        raise ValueError(
            f"there is no scene {name!r:.200}; the scenes are {', '.join(_SCENES)}, "
            f"any file that ends in {' or '.join(_SUFFIXES)}, and a model in Python as file.py:name"
        )
    known = list(inspect.signature(make).parameters)
    if unknown := [option for option in options if option not in known]:
        has = f"its options are {', '.join(known)}" if known else "it has none"
        raise TypeError(f"scene {os.fspath(name)!r} has no option {unknown[0]!r}; {has}")
    return make(**options)
