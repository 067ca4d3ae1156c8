"""Model: what every function of `dynamics` takes, whatever it is made of, and the names that a person calls it by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    from .ode_system import OdeSystem
    from .system import System

Equations: TypeAlias = "System | OdeSystem"  # what is behind a model
_OF_COORDINATES = ("q{}", "q{}_old", "q{}_dot")
_OF_VELOCITIES = ("qd{}", "qd{}_old", "qd{}_dot", "qdd{}", "tau{}", "bias{}", "gravity{}", "p{}", "p{}_dot")


class Model(Protocol):
    """A system, a mechanism or a scene: names, parameters, and the equations behind them.

    A class of your own becomes a model by these six attributes. One of `system` and `ode` is None.
    coordinates: names, in the order of q0, q1, ...; of a first-order system its states.
    velocities: names, in the order of qd0, qd1, ...; none of a first-order system.
    parameters: {name: value}; each is an input of the graphs, and a run binds it to the value.
    system: the Lagrangian system.  ode: the first-order system.  mechanism: the bodies, None of a model without.
    """

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates, or of the states."""

    @property
    def velocities(self) -> tuple[str, ...]:
        """Names of the velocities."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values by name."""

    @property
    def system(self) -> System | None:
        """The Lagrangian system."""

    @property
    def ode(self) -> OdeSystem | None:
        """The first-order system."""

    @property
    def mechanism(self) -> object | None:
        """The bodies, a `Mechanism`; see `dynamics.multibody.trees.mechanism.as_mechanism`."""


def as_system(model: Model) -> System:
    """The Lagrangian system of a model.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene.

    Returns
    -------
    System

    Raises
    ------
    TypeError
        For a first-order system, and for what is no model.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.as_system(dyn.planar_arm(masses=[1.0, 0.5], lengths=[1.0, 1.0]))
    <System of 2 coordinate(s) joint 1, joint 2>
    """
    system: System | None = getattr(_made(model), "system", None)
    if system is None:
        what = "a first-order system, which has no Lagrangian" if getattr(model, "ode", None) is not None else ""
        what = what or f"{type(model).__name__}: {model!r:.60}"
        raise TypeError(f"expected a System, a mechanism or a scene, got {what}")
    return system


def as_ode(model: Model) -> OdeSystem | None:
    """The first-order system of a model; None for a mechanical one."""
    return getattr(_made(model), "ode", None)


def as_equations(model: Model) -> Equations:
    """The Lagrangian or the first-order system of a model, itself a model: what a run asks from its door on."""
    ode = as_ode(model)
    return as_system(model) if ode is None else ode


def _made(model: object) -> object:
    """The model. Raises TypeError for a class of models, which has no coordinates before one is made."""
    if isinstance(model, type):
        raise TypeError(f"expected a model, such as a System, a mechanism or a scene, got the class {model.__name__}")
    return model


def display_names(model: Model) -> dict[str, str]:
    """Names for a person of the inputs and outputs of a model's graphs: {"q2": "q.knee", "tau3": "tau.base.wx"}.

    Graphs number coordinates and velocities; `cg.why`, `cg.why_not`, `cg.lint`, `cg.to_c`, `viz.to_dot` and `viz.page`
    take these as their `names`, show them, and read them as well as the graph's.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene. A first-order system's graphs have the names of its states: none are needed.

    Returns
    -------
    dict of str to str
        {name in a graph: kind, a dot, name of the coordinate or of the velocity}. What is of an earlier instant or a
        rate has it in its kind: "q_old.knee", "q_dot.knee". Multipliers are "lambda.<constraint>".

    Raises
    ------
    TypeError
        For what is no model.

    Examples
    --------
    >>> import cgraph as cg
    >>> import dynamics as dyn
    >>> knee = dyn.Joint("revolute", axis=(0.0, 1.0, 0.0), name="knee")
    >>> leg = dyn.Mechanism([dyn.Body("shank", knee, mass=1.0, center=(0.0, 0.0, -0.2))])
    >>> names = dyn.display_names(leg)
    >>> names["q0"], names["tau0"]
    ('q.knee', 'tau.knee')
    >>> print(cg.why_not(dyn.inverse_dynamics(leg), "tau.knee", "qd.knee", names=names))
    tau.knee does not depend on qd.knee.
    Nothing uses qd.knee.
    tau.knee is made from q.knee and qdd.knee.
    """
    if as_ode(model) is not None:
        return {}
    system = as_system(model)
    shown: dict[str, str] = {}
    for patterns, names in ((_OF_COORDINATES, system.coordinates), (_OF_VELOCITIES, system.velocities)):
        for pattern in patterns:
            kind = pattern.replace("{}", "")
            shown |= {pattern.format(i): f"{kind}.{name}" for i, name in enumerate(names)}
    return shown | {f"lambda{k}": f"lambda.{name}" for k, name in enumerate(system.constraints.names)}
