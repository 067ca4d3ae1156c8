"""The formulations of Lagrange's equation as graphs of a model: its torques, and the inertial term alone.

Equations and figures named here are those of T. Kusaka and T. Tanaka, Robotics 2025, 14(9), 115.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Remarks, remarked, require_flag

from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import LARGEST_REWRITTEN, Equation, Output
from .lagrange_terms import INERTIAL, chain_rule, formulation_name, momenta, newton_euler, shortest, torques


@Equation("q qd qdd", Output("tau{}", ("n",), "N m or N")).describes
def inverse_dynamics(model: Model, formulation: str | None = None, *, simplify: bool = True) -> Graph:
    """tau of the motion: tau = d/dt dL/dqd - dL/dq + damping * qd - forces, by one of the `FORMULATIONS`.

    Parameters
    ----------
    formulation : str, optional
        By default the smaller graph of "chain_rule", which is the paper's, and "newton_euler", which takes the
        velocities in L in place of qd, of a Lagrangian that identities such as sin^2 + cos^2 = 1 have shortened. By
        name no formulation is shortened so, and their sizes compare. "chain_rule_literal" is the first with every
        gradient written out.
        "by_definition", "kinetic_only" and "kinetic_only_exact" have the Euler relation in the graph; the first two
        are wrong, as the paper has them.
    simplify : bool
        False leaves the graph as derived.

    Returns
    -------
    With the Euler relation the inputs are the state before the step, q0_old.., qd0_old.., then qdd0.., dt, ...; tau is
    that of the state after the step, qd = qdd dt + qd_old, q = qd dt + q_old.

    Raises
    ------
    ValueError
        For an unknown formulation.

    Examples
    --------
    >>> import dynamics as dyn
    >>> block = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2, ["x"], damping=0.5)
    >>> dyn.inverse_dynamics(block).evaluate({"q0": 0.0, "qd0": 2.0, "qdd0": 3.0})
    {'tau0': 13.0}
    >>> list(dyn.FORMULATIONS)
    ['chain_rule', 'chain_rule_literal', 'by_definition', 'kinetic_only', 'kinetic_only_exact', 'newton_euler']
    """
    system = as_system(model)
    name = None if formulation is None else formulation_name(formulation)
    require_flag("simplify", simplify)
    name, graph = _smaller(system) if name is None else (name, cg.simplify(torques(system, name)))
    return remarked(graph if simplify else torques(system, name), partial(_remarks, model, name, torques))


@Equation("q qd qdd", Output("p{}_dot", ("n",), "N m or N")).describes
def momentum_rate(
    model: Model, formulation: str = "chain_rule", *, simplify: bool = True, keep_momentum: bool = False
) -> Graph:
    """The inertial term d/dt dL/dqd alone: the left side of Eq. (3) and of Figures 1 to 3 of the paper.

    Parameters
    ----------
    formulation : str
        Any but "newton_euler", which forms no momentum.
    simplify : bool
        False leaves the graph as derived.
    keep_momentum : bool
        The momenta p0.. = dL/dqd are outputs too.

    Returns
    -------
    With the Euler relation the inputs are those of `inverse_dynamics`.

    Raises
    ------
    ValueError
        For any other formulation.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2 - 0.5 * 9.0 * q[0] ** 2, ["x"])
    >>> dyn.momentum_rate(spring).evaluate({"q0": 1.0, "qd0": 2.0, "qdd0": 3.0})  # the spring has no part in it
    {'p0_dot': 12.0}
    """
    formulation = formulation_name(formulation, INERTIAL)
    derive = partial(momenta, keep_momentum=require_flag("keep_momentum", keep_momentum))
    graph = derive(as_system(model), formulation)
    graph = cg.simplify(graph) if require_flag("simplify", simplify) else graph
    return remarked(graph, partial(_remarks, model, formulation, derive))


def _remarks(model: Model, formulation: str, derive: Callable[..., Graph], graph: Graph) -> Remarks:
    from .verdict import remarks  # loaded when a notebook asks

    return remarks(model, formulation, derive, graph)


def _smaller(system: System) -> tuple[str, Graph]:
    """Name of the `SMALL` formulation whose shortened graph is the smaller, and this graph.

    Of bodies the chain rule gave it in none of 1600 random trees beyond 58 nodes, unless most joints are slides, which
    take 7 nodes each; so for large graphs, which take long, it is not asked.
    """
    by_velocities = newton_euler.__name__, shortest(system, newton_euler.__name__)
    if system.body_terms is not None and len(by_velocities[1].nodes) > max(LARGEST_REWRITTEN, 10 * system.n):
        return by_velocities
    by_state = chain_rule.__name__, shortest(system, chain_rule.__name__)
    return min(by_state, by_velocities, key=lambda pair: size(pair[1]))


def size(graph: Graph) -> tuple[int, int]:
    """Nodes, then edges: by which of two graphs of the same torques the smaller is taken."""
    return len(graph.nodes), len(graph.edges)
