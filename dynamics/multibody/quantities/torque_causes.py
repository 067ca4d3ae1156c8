"""Torque by cause: tau taken apart by what makes it, gravity, springs, inertia, Coriolis forces, and by the body.

Torques are linear in the Lagrangian, so that of every body has a share of its own (the paper's Section 4.3), and its
energies part the share: L_k = K_k - P_k, with d/dt dK_k/dqd along qdd alone the inertia, along qd less dK_k/dq the
Coriolis force, and dP_k/dq gravity and springs. No part is a difference of two torques.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, Names, building, cotangents, folded

from ...equations.equation import documented
from ...equations.formulations.lagrange_terms import (
    THROUGH_STEP,
    Embedding,
    formulation_name,
    kinetic_only_exact,
    lagrange_sweeps,
    through_step,
)
from ...equations.torque_parts.torque_table import TorqueTable, names_of_partials
from ...systems.arguments import new_variables
from ...systems.energies import signed_terms
from ...systems.kinematics import ONE, ZERO, changes
from ...systems.model import Model, as_system, display_names
from ...systems.system import System
from ..changes.pruning import without_effect
from ..forces.contact import Contact, Force
from ..forces.joint_force import JointForce, generalized_forces
from ..trees.mechanism import Mechanism, as_mechanism

SPURIOUS = "spurious"  # what a derivative through q = qd dt + q_old adds
STEP = "step of dt"  # what a derivative by dt has beside the one along the motion: it vanishes with dt
LONGEST_TERM = 40  # characters of a term of the potential energy that stands for its name


@documented
def torque_by_cause(model: Model, formulation: str = "chain_rule") -> TorqueTable:
    """Rows: what of tau is made by gravity, springs, Coriolis forces and inertia of each body, damping, and forces.

    tau = d/dt dL/dqd - dL/dq + damping * qd - forces is a sum over bodies, L = sum of L_k = K_k - P_k. In row
    "inertia of k" is what of d/dt dK_k/dqd comes along qdd, in "Coriolis of k" what comes along qd and t, less dK_k/dq:
    centrifugal, gyroscopic and magnetic forces too. "gravity of k" and "spring of k" are dP_k/dq; of a Lagrangian that
    is no body's, a row is a term of P by its formula. Rows of damping and of each kind of force follow. A row that is
    zero at every state is left out.

    Parameters
    ----------
    formulation : str
        One of `FORMULATIONS`. Of those that are wrong, "spurious of k" is what the derivative through
        q = qd dt + q_old adds, of body k; and "step of dt" what the derivative by dt has beside the rate along the
        motion.

    Returns
    -------
    TorqueTable
        (causes, n) torques [N m or N]; columns add up to tau. Its graph has the inputs of `inverse_dynamics`.

    Raises
    ------
    ValueError
        For an unknown formulation.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0], gravity=10.0, damping=0.5)
    >>> print(dyn.torque_by_cause(arm).at([1.5707963267948966, 0.0], qd=[1.0, 0.0]))
                        joint 1  joint 2
    gravity of link 1         5        ·
    gravity of link 2        15        5
    Coriolis of link 2        0        0
    inertia of link 1         0        ·
    inertia of link 2         0        0
    damping                 0.5        0
    tau                    20.5        5
    """
    formulation = formulation_name(formulation)
    mechanism = as_mechanism(model)
    if mechanism is not None and mechanism.base_parameters:  # whose partial Lagrangians are no body's
        mechanism = replace(mechanism, base_parameters=False)
    system = as_system(model if mechanism is None else mechanism)
    build, inputs, of_step = Builder(), [*system.q, *system.qd, *system.qdd], formulation in THROUGH_STEP
    rows = dict(_potentials(system, mechanism, build))
    shares = {name: _kinetic(_with(system, partial).kinetic, system, build) for name, partial in _bodies(system)}
    for place, cause in enumerate(("Coriolis", "inertia")):
        rows |= {_of(cause, name): share[place] for name, share in shares.items()}
    outside = dict(_of_forces(system, mechanism, build))
    if of_step or formulation == kinetic_only_exact.__name__:
        embedding = Embedding(system)
        inputs = embedding.inputs
        rows, outside = ({name: embedding.embed(*row) for name, row in each.items()} for each in (rows, outside))
    rows |= (_of_step(system, formulation, list(rows.values()), build) if of_step else {}) | outside
    kept = {name: row for name, row in rows.items() if any(entry.value != 0.0 for entry in row)}
    rows = kept or {"inertia": [ZERO] * system.n}
    outputs = {f"tau{i}_{k}": entry for k, row in enumerate(rows.values()) for i, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, inputs))
    return TorqueTable("torque by cause", tuple(rows), system.velocities, system, graph, sum_axis=0)


def _bodies(system: System) -> list[tuple[str, Node]]:
    """(name, Lagrangian) of every part, no name where there is but one that its author has not named."""
    partials = folded(system.partial_lagrangians, Builder())
    names = names_of_partials(system)
    return [("" if names == ["L1"] else name, partial) for name, partial in zip(names, partials, strict=True)]


def _of(cause: str, body: str) -> str:
    return f"{cause} of {body}" if body else cause


def _with(system: System, partial: Node) -> System:
    """The system with this partial Lagrangian alone."""
    return system.changed(partial_lagrangians=(partial,), body_terms=None, extra_inputs=system.extra_inputs)


def _kinetic(kinetic: Node, system: System, build: Builder) -> tuple[list[Node], list[Node]]:
    """Coriolis force and inertia of a kinetic energy K.

    d/dt dK/dqd - dK/dq: the rate along (q_dot, 0) and t less the slope, and the rate along (0, qdd), M qdd.
    """
    momentum, along, slopes = lagrange_sweeps(system, kinetic, build, None)
    with building(build):
        coriolis = [rate - slope for rate, slope in zip(along, slopes, strict=True)]
    return coriolis, changes(dict(zip(system.qd, system.qdd, strict=True)), momentum, build)


def _potentials(system: System, mechanism: Mechanism | None, build: Builder) -> Iterator[tuple[str, list[Node]]]:
    """(name, dP/dq) of the terms of the potential energies: of bodies gravity and springs, else term by term."""
    if mechanism is not None:
        for cause, without in (("gravity", "springs"), ("spring", "gravity")):
            alone = as_system(without_effect(mechanism, without))
            for name, partial in _bodies(alone):
                yield _of(cause, name), _slope(_with(alone, partial).potential, system, build)
        return
    called, seen = display_names(system), dict[str, int]()
    for name, partial in _bodies(system):
        potential = _with(system, partial).potential
        sloping = [each for each in signed_terms(potential) if each[1].value is None]
        for sign, node in sloping:
            term = node if sign > 0 else -node
            text = Names(Graph([*system.q, *system.extra_inputs], {"P": term}), called).text(term, LONGEST_TERM)
            cause = f"potential {text}" if "%" not in text else "potential"
            cause = _of(cause, name)
            seen[cause] = seen.get(cause, 0) + 1
            yield cause + (f" ({seen[cause]})" if seen[cause] > 1 else ""), _slope(term, system, build)


def _slope(potential: Node, system: System, build: Builder) -> list[Node]:
    return system.kinematics.pulled_back(cotangents({potential: ONE}, system.q, build), build)


def _of_forces(system: System, mechanism: Mechanism | None, build: Builder) -> Iterator[tuple[str, list[Node]]]:
    """(name, torques) against damping, and against the forces of a kind on a body, or all that a function gives."""
    yield "damping", system.braking(build)
    if mechanism is None:
        forces = {"applied forces": system.forces}
    else:
        together: dict[str, list[Force | JointForce | Contact]] = {}
        for force in mechanism.forces:
            on = f"of {', '.join(force.shares)}" if isinstance(force, JointForce) else f"on {force.body}"
            together.setdefault(f"{type(force).__name__.removeprefix('Joint').lower()} {on}", []).append(force)
        given, state = {name: cg.variable(name) for name in mechanism.parameter_values}, (system.q, system.qd)
        at = mechanism.chain, mechanism.moving, state, given, mechanism.locked
        forces = {name: tuple(generalized_forces(each, *at)) for name, each in together.items()}
    for name, nodes in forces.items():
        with building(build):
            yield name, [-each for each in folded(nodes, build)]


def _of_step(
    system: System, formulation: str, right: Sequence[Sequence[Node]], build: Builder
) -> dict[str, list[Node]]:
    """{name: torques} of what a formulation adds that differentiates through the step, by body, and of d/d(dt).

    With a factor s of what comes through q = qd dt + q_old the torque is affine in s: its slope by s is spurious, and
    at s = 0 it differs from the sum of the right rows by the step alone.
    """
    (through,) = new_variables("through", 1, system.parameters)
    rows: dict[str, list[Node]] = {}
    rest = [ZERO] * system.n
    for name, partial in _bodies(system):
        one = _with(system, partial)
        torques = through_step(one, THROUGH_STEP[formulation](one), through)
        rows[_of(SPURIOUS, name)] = folded(changes({through: ONE}, torques, build), build, {through: ZERO})
        held = folded(torques, build, {through: ZERO})
        with building(build):
            rest = [total + each for total, each in zip(rest, held, strict=True)]
    with building(build):
        for row in right:
            rest = [total - each for total, each in zip(rest, row, strict=True)]
    return rows | {STEP: rest}
