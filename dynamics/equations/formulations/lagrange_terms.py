"""The terms of Lagrange's equation by the formulations: by definition, kinetic only, chain rule, by velocities.

Equations and figures named here are those of T. Kusaka and T. Tanaka, Robotics 2025, 14(9), 115.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import require_choice
from cgraph.extend import TANGENT, Builder, building, cotangents

from ...systems.kinematics import ONE, changes, dot, substitute
from ...systems.model import Model, as_system
from ...systems.system import System
from ..bias_terms import along_motion, bias_terms, state_rate
from ..equation import shortened

EULER = "Euler relation"  # tag of the embedded relations q = qd dt + q_old and qd = qdd dt + qd_old
COUPLING = "qd dt"  # tag of the product qd dt in the first of them, through which dL/dqd reaches dL/dq
LAGRANGIAN = "lagrangian"  # tag of what the author left untagged: derivatives of it would take a relation's tag instead


class LagrangeTerms(NamedTuple):
    """The two terms of tau = d/dt dL/dqd - dL/dq as one formulation writes them, and the state they are taken at."""

    inputs: list[Node]
    q: list[Node]
    qd: list[Node]
    momentum: list[Node] | None  # p = dL/dqd; None where it is not formed, but the two terms below are at fixed z
    momentum_rate: list[Node]  # d/dt dL/dqd
    gradient: list[Node]  # dL/dq; of quasi-velocities G^T dL/dq - ad(qd; p)


def chain_rule(system: System) -> LagrangeTerms:
    """Section 3: d/dt p = grad_x p . xdot for p = dL/dqd, x = (q, qd), contracted: one reverse sweep, one forward."""
    momentum, rate, gradient = lagrange_sweeps(system, system.lagrangian, Builder(), system.qdd)
    return LagrangeTerms([*system.q, *system.qd, *system.qdd], system.q, system.qd, momentum, rate, gradient)


def lagrange_sweeps(
    system: System, lagrangian: Node, build: Builder, qdd: Sequence[Node] | None
) -> tuple[list[Node], list[Node], list[Node]]:
    """p = dL/dqd, d/dt p, at qdd or at 0, and dL/dq of a Lagrangian or a part of it."""
    # The reverse sweep over L gives both dL/dq and p = dL/dqd; q and qd are independent inputs (Section 2.2).
    bars = cotangents({lagrangian: ONE}, [*system.q, *system.qd], build)
    momentum = bars[system.nq :]
    gradient = system.kinematics.slopes(bars[: system.nq], momentum, build)
    # Eq. (4) with y = p: a forward sweep along xdot = (qd, qdd) is the product grad_x p . xdot, never written out.
    return momentum, along_motion(system, momentum, build, qdd), gradient


def chain_rule_literal(system: System) -> LagrangeTerms:
    """Eq. (4) read literally: the 2n partials of each momentum, a reverse sweep each, then products with xdot."""
    bars = cotangents({system.lagrangian: ONE}, [*system.q, *system.qd])
    momentum = bars[system.nq :]
    gradient = system.kinematics.slopes(bars[: system.nq], momentum, Builder())
    x_dot = state_rate(system, system.qdd)
    rate = []
    for p in momentum:
        partials = cotangents({p: ONE}, list(x_dot))  # grad_x p, 2n nodes
        with building(Builder()) as labelled:
            labelled(p.label.derived(TANGENT))
            rate.append(dot(partials, list(x_dot.values())))
    return LagrangeTerms([*system.q, *system.qd, *system.qdd], system.q, system.qd, momentum, rate, gradient)


def by_definition(system: System) -> LagrangeTerms:
    """The definition, eq. (3) and Figure 1: dL/dqd is taken through q = qd dt + q_old, which is wrong."""
    return _embedded(system, system.lagrangian)


def kinetic_only(system: System) -> LagrangeTerms:
    """Figure 2: the same embedding with K in place of L in the velocity derivative; right where K is free of q."""
    return _embedded(system, system.kinetic)


def kinetic_only_exact(system: System) -> LagrangeTerms:
    """Kinetic only, exact: dK/dqd is taken at independent q and qd, and only then is the relation embedded.

    d/dt goes through each embedded quantity at its own rate, qd of q and qdd of qd, not through dt, along which q would
    move at qd + qdd dt.
    """
    momentum = cotangents({system.kinetic: ONE}, system.qd)
    embedding = Embedding(system)
    lagrangian, *embedded = embedding.embed(system.lagrangian, *momentum)
    gradient = cotangents({lagrangian: ONE}, embedding.q)
    rates = [*embedding.embed(*system.q_dot), *system.qdd]
    x_dot = dict(zip([*embedding.q, *embedding.qd], rates, strict=True))
    return embedding.terms(embedded, gradient, x_dot)


def newton_euler(system: System) -> LagrangeTerms:
    """Newton's and Euler's equations of bodies; of any Lagrangian the same, d/dt dL/dz at its velocity nodes z.

    tau = (dz/dqd)^T d/dt dL/dz - dL/dq at fixed z: what d/dt dL/dqd and dL/dq have in common is never formed. Slopes
    dz/dqd are the partial velocities of T. R. Kane and D. A. Levinson, "Dynamics: Theory and Applications" (1985); of
    bodies the forces at z are those of J. Y. S. Luh, M. W. Walker, R. P. C. Paul, "On-line computational scheme for
    mechanical manipulators", J. Dyn. Sys. Meas. Control 102(2), 1980.
    """
    free = system.without_constraints  # whose tags shared nodes would have
    terms = bias_terms(free, system.qdd)
    forces = cotangents(terms.inertial, system.qd, Builder())
    return LagrangeTerms([*system.q, *system.qd, *system.qdd], system.q, system.qd, None, forces, terms.gradient)


FORMULATIONS: dict[str, Callable[[System], LagrangeTerms]] = {
    formulation.__name__: formulation
    for formulation in (chain_rule, chain_rule_literal, by_definition, kinetic_only, kinetic_only_exact, newton_euler)
}
"""Formulations of Lagrange's equation by name, right and wrong ones: what `inverse_dynamics` takes."""
FORMER_NAMES = {"euler_embedded": "by_definition"}  # as versions before this one called them
INERTIAL = tuple([name for name in FORMULATIONS if name != newton_euler.__name__])  # those that form d/dt dL/dqd
SMALL = (chain_rule.__name__, newton_euler.__name__)  # right ones, of which the other may be the smaller
THROUGH_STEP: dict[str, Callable[[System], Node]] = {
    "by_definition": lambda system: system.lagrangian,
    "kinetic_only": lambda system: system.kinetic,
}  # the formulations that differentiate by qd through q = qd dt + q_old, and what they differentiate


def formulation_name(name: str, among: Collection[str] = FORMULATIONS) -> str:
    """The name of a formulation, checked; a former name is taken for the present one, with a warning."""
    if isinstance(name, str) and name in FORMER_NAMES:
        present = FORMER_NAMES[name]
        warnings.warn(f"the formulation {name!r} is called {present!r} now", FutureWarning, stacklevel=3)
        name = present
    return require_choice("formulation", name, among)


def shortest(model: Model, formulation: str) -> Graph:
    """Inverse dynamics by one of the `SMALL` formulations, simplified and shortened by identities."""
    return shortened(as_system(model), lambda form: cg.simplify(torques(form, formulation)))


def torques(system: System, formulation: str = "chain_rule", through: Node = ONE) -> Graph:
    """Inverse dynamics from the Lagrangian as it is written, not simplified. Raises as `inverse_dynamics`.

    through: a factor of what `THROUGH_STEP` lets through q = qd dt + q_old; an input of the graph if it is a variable.
    """
    terms = _lagrange_terms(system, formulation, through)
    applied: Sequence[Node] = system.forces
    if terms.q is not system.q:  # at the embedded state
        applied = substitute(applied, dict(zip([*system.q, *system.qd], [*terms.q, *terms.qd], strict=True)))
    build = Builder()
    braking = system.braking(build, terms.qd)
    outputs = {}
    with building(build):
        for i in range(system.n):
            tau = terms.momentum_rate[i] - terms.gradient[i]
            with cg.tag("damping"):
                tau = tau + braking[i]
            outputs[f"tau{i}"] = tau - applied[i]
    return system.graph(outputs, terms.inputs, [through] if through is not ONE else [])


def momenta(system: System, formulation: str, through: Node = ONE, *, keep_momentum: bool = True) -> Graph:
    """The inertial term, with or without the momenta, as derived.  through: as of `torques`."""
    formulation = formulation_name(formulation, INERTIAL)
    terms = _lagrange_terms(system, formulation, through)
    outputs = {f"p{i}": p for i, p in enumerate(terms.momentum or ())} if keep_momentum else {}
    outputs |= {f"p{i}_dot": rate for i, rate in enumerate(terms.momentum_rate)}
    return system.graph(outputs, terms.inputs, [through] if through is not ONE else [])


def _lagrange_terms(system: System, formulation: str, through: Node = ONE) -> LagrangeTerms:
    if through is not ONE:
        return _embedded(system, THROUGH_STEP[formulation](system), through)
    return FORMULATIONS[formulation_name(formulation)](system)


class Embedding:
    """The Euler relation of Section 2.1 as nodes: the state after a step from variables of the state before it."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.dt = cg.variable("dt")
        q_old = cg.variables([f"q{i}_old" for i in range(system.nq)])
        qd_old = cg.variables([f"qd{i}_old" for i in range(system.n)])
        self.inputs = [*q_old, *qd_old, *system.qdd, self.dt]
        q_dot = system.q_dot  # kept by the system once they are made: not in here, where they would be tagged
        with cg.tag(EULER):
            self.qd = [
                cg.with_name(a * self.dt + old, f"qd{i}")
                for i, (a, old) in enumerate(zip(system.qdd, qd_old, strict=True))
            ]
            rates = substitute(q_dot, dict(zip([*system.q, *system.qd], [*q_old, *self.qd], strict=True)))
            with cg.tag(COUPLING):
                moved = [rate * self.dt for rate in rates]
            self.q = [cg.with_name(m + old, f"q{i}") for i, (m, old) in enumerate(zip(moved, q_old, strict=True))]

    def embed(self, *nodes: Node) -> list[Node]:
        """Nodes over (q, qd) as nodes over the embedded state, all of them with tags."""
        state = dict(zip([*self.system.q, *self.system.qd], [*self.q, *self.qd], strict=True))
        return substitute(nodes, state, LAGRANGIAN)

    def terms(
        self, momentum: Sequence[Node], gradient: list[Node], x_dot: Mapping[Node, Node] | None = None
    ) -> LagrangeTerms:
        """d/dt as the derivative with respect to dt, or along `x_dot`; and to t if the Lagrangian has it."""
        time = {self.system.t: ONE} if self.system.t in self.system.extra_inputs else {}
        rate = changes({**(x_dot or {self.dt: ONE}), **time}, momentum)
        slopes = self.system.kinematics.slopes(gradient, momentum, Builder())
        if self.system.kinematics.quasi is not None:
            slopes = self.embed(*slopes)
        return LagrangeTerms(self.inputs, self.q, self.qd, list(momentum), rate, slopes)


def after_a_step(system: System) -> Graph:
    """L of the state after a step, which the formulation by definition differentiates, and that state's q0...

    Inputs are those of `inverse_dynamics` by it; the nodes of the Euler relation have the tag `EULER`.
    """
    embedding = Embedding(system)
    (lagrangian,) = embedding.embed(system.lagrangian)
    return system.graph({"L": lagrangian} | {f"q{i}": node for i, node in enumerate(embedding.q)}, embedding.inputs)


def _embedded(system: System, energy: Node, through: Node = ONE) -> LagrangeTerms:
    """d/dt of d(energy)/dqd with the Euler relation in the graph, the middle of eq. (3), and dL/dq.

    through: a factor of all that comes through q: 1 in the formulation, and at 0 the momentum is the right one.
    """
    embedding = Embedding(system)
    lagrangian, energy = embedding.embed(system.lagrangian, energy)
    factors = dict.fromkeys(embedding.q, through)
    momentum = cotangents({energy: ONE}, embedding.qd, through=factors)  # through q as well: the unwanted coupling
    gradient = cotangents({lagrangian: ONE}, embedding.q)
    return embedding.terms(momentum, gradient)


def through_step(system: System, energy: Node, through: Node) -> list[Node]:
    """The torques without damping and forces of `_embedded`.  through: a variable."""
    terms = _embedded(system, energy, through)
    with building(Builder()):
        return [rate - slope for rate, slope in zip(terms.momentum_rate, terms.gradient, strict=True)]


ROUNDS = 100  # of q_old, where G depends on it


def after_step(system: System, at: Mapping[str, float]) -> dict[str, float]:
    """{q0.., qd0..: the state after the step} of numbers of all inputs of an embedded graph."""
    qd = {f"qd{i}": at[f"qdd{i}"] * at["dt"] + at[f"qd{i}_old"] for i in range(system.n)}
    moved = _moved(system, at, qd)
    return {f"q{i}": rate * at["dt"] + at[f"q{i}_old"] for i, rate in enumerate(moved)} | qd


def before_step(system: System, at: Mapping[str, float], after: Mapping[str, float]) -> dict[str, float]:
    """`at`, with the old state that leads to `after`, some of q0.., qd0.., in place of its own; the rest is held."""
    found = dict(at)
    for i in range(system.n):
        if f"qd{i}" in after:
            found[f"qd{i}_old"] = after[f"qd{i}"] - at[f"qdd{i}"] * at["dt"]
    for _ in range(ROUNDS):
        moved = _moved(system, found, after_step(system, found))
        old = {f"q{i}_old": after[f"q{i}"] - rate * at["dt"] for i, rate in enumerate(moved) if f"q{i}" in after}
        if found.items() >= old.items():
            break
        found |= old
    return found


def _moved(system: System, at: Mapping[str, float], qd: Mapping[str, float]) -> list[float]:
    """The rates G(q_old) qd."""
    rates = Graph([*system.q, *system.qd], {f"q{i}": rate for i, rate in enumerate(system.q_dot)})
    state = {f"q{i}": at[f"q{i}_old"] for i in range(system.nq)}
    state |= {name: qd[name] for name in rates.input_names[system.nq :]}
    return [float(rate) for rate in rates.evaluate(state).values()]
