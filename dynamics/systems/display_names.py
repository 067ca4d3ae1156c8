"""Names for a person of the inputs and outputs of a model's graphs: q.knee for q2, tau.base.wx for tau3."""

from __future__ import annotations

from .model import Model, as_ode, as_system

_OF_COORDINATES = ("q{}", "q{}_old", "q{}_dot")
_OF_VELOCITIES = ("qd{}", "qd{}_old", "qd{}_dot", "qdd{}", "tau{}", "bias{}", "gravity{}", "p{}", "p{}_dot")


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
