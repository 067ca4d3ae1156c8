"""Equations of motion as graphs: mass matrix, bias, momentum, energy, and forward dynamics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import (
    Builder,
    SingularError,
    building,
    cotangents,
    folded,
    hessian_nodes,
    ldl_solve,
    solve_nodes,
    tangents,
)

from ..systems.model import Model, as_system
from ..systems.system import System
from .formulations import ONE, ZERO, substituted
from .velocity_nodes import rates


class SingularMassMatrixError(ValueError):
    """A coordinate that has no inertia, so that its acceleration is not determined."""


def mass_matrix(model: Model) -> Graph:
    """M(q), the part of tau that multiplies qdd: M = d2L/dqd2.

    Inputs q0.., qd0.. (M depends on qd only for a Lagrangian that is not quadratic), t if needed, parameters.
    Outputs M_0_0, M_0_1, .. row by row, (n, n) symmetric [kg m^2, kg m or kg].
    """
    system = as_system(model)
    lower = hessian_nodes(system.lagrangian, system.qd)
    n = system.n
    outputs = {f"M_{i}_{j}": lower[max(i, j)][min(i, j)] for i in range(n) for j in range(n)}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def bias(model: Model) -> Graph:
    """Coriolis, centrifugal and gravity force together: tau at qdd = 0 without damping and applied forces.

    Inputs q0.., qd0.., t if needed, parameters; outputs bias0.. [N m or N].
    """
    system = as_system(model)
    outputs = {f"bias{i}": node for i, node in enumerate(_bias(system))}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def gravity_force(model: Model) -> Graph:
    """The bias at rest: dP/dq, from gravity and springs.

    Inputs q0.., qd0.., t if needed, parameters; outputs gravity0.. [N m or N].
    """
    system = as_system(model)
    at_rest = substituted(_derived(system).bias(system, Builder()), dict.fromkeys(system.qd, ZERO))
    return cg.simplify(system.graph({f"gravity{i}": node for i, node in enumerate(at_rest)}, system.q, system.qd))


def momentum(model: Model) -> Graph:
    """Generalized momenta p = dL/dqd. Inputs q0.., qd0.., t if needed, parameters; outputs p0.. ."""
    system = as_system(model)
    bars = cotangents({system.lagrangian: ONE}, system.qd)
    return cg.simplify(system.graph({f"p{i}": bar for i, bar in enumerate(bars)}, system.q, system.qd))


def energy(model: Model) -> Graph:
    """Total energy E = qd . dL/dqd - L, which is K + P for a kinetic energy quadratic in qd.

    Inputs q0.., qd0.., t if needed, parameters; output E [J].
    """
    system = as_system(model)
    build = Builder()
    bars = cotangents({system.lagrangian: ONE}, system.qd, build)
    with building(build):
        total: Node = ZERO
        for p, qd in zip(bars, system.qd, strict=True):
            total = total + p * qd
        total = total - system.lagrangian
    return cg.simplify(system.graph({"E": total}, system.q, system.qd))


METHODS = ("auto", "recursive", "dense")
SHORT = 6  # coordinates; beyond, the dense graph is larger on a tree of bodies, and takes long to build


def forward_dynamics(model: Model, method: str = "auto", *, check: bool = False) -> Graph:
    """Accelerations: qdd = M^-1 (tau + forces - damping * qd - bias), from the Lagrangian.

    Inputs q0.., qd0.., tau0.., t if needed, parameters; outputs qdd0.. [rad/s^2 or m/s^2].
    A mechanism gives the bias itself (`System.bias_forces`); of others it is derived.
    method: "recursive", elimination on the graph of L without forming M (`cg.hessian_solve`): for a tree of bodies the
    number of nodes is linear in n. "dense", M factored as LDL^T: smaller for very short arms. "auto", the smaller of
    the two up to 6 coordinates, else recursive.
    check: one more output, `info`: 0 where M is positive definite, else 1 + the index of the coordinate that was
    found to have no inertia left, or a negative one; the accelerations mean nothing there. `raise_if_singular`
    raises on it. Three nodes a coordinate. Without, the result where M is singular is infinite, NaN or meaningless.

    Raises SingularMassMatrixError, naming the coordinate, when M is singular at every state; ValueError for an unknown
    method.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    system = as_system(model)
    methods = [method] if method != "auto" else ["recursive", "dense"] if system.n <= SHORT else ["recursive"]
    known = _terms(system)
    try:
        graphs = [_accelerations(system, known, each, check) for each in methods]
    except SingularError as error:
        name = system.coordinates[error.index]
        problem = "not positive definite" if error.pivot else "singular"
        raise SingularMassMatrixError(
            f"the mass matrix is {problem}: coordinate {name!r} has no inertia, or none that others do not share"
        ) from None
    return min(graphs, key=lambda graph: len(graph.nodes))


def raise_if_singular(model: Model, info: ArrayLike) -> None:
    """Raise SingularMassMatrixError, naming the coordinate, unless the output `info` of `forward_dynamics` is 0.

    info: a number, or an array of any shape; the first entry that is not 0 is reported, with its index.
    """
    values = np.asarray(info)
    failed = np.argwhere(values != 0.0)
    if len(failed):
        at = tuple(failed[0].tolist())
        name = as_system(model).coordinates[int(values[at]) - 1]
        where = f" at state {', '.join(map(str, at))}" if at else ""
        raise SingularMassMatrixError(
            f"the mass matrix is not positive definite{where}: coordinate {name!r} has an inertia that is not positive"
        )


def _accelerations(system: System, known: _Terms, method: str, check: bool) -> Graph:
    build = Builder()
    with building(build):
        slopes = known.gradient if method == "recursive" else [-bias for bias in known.bias(system, build)]
        with cg.tag("damping"):
            braking = [damping * qd for damping, qd in zip(system.damping, system.qd, strict=True)]
        rhs = [
            tau + slope - brake + force
            for tau, slope, brake, force in zip(system.tau, slopes, braking, known.forces, strict=True)
        ]
        inertial = {velocity: -rate for velocity, rate in known.inertial.items()}
    if method == "recursive":  # carries the inertial terms to the coordinates on its way
        solved = solve_nodes(known.lagrangian, system.qd, rhs, build, at=inertial, check=check)
    else:
        solved = ldl_solve(hessian_nodes(known.lagrangian, system.qd, build), rhs, build, check=check)
    names = [f"qdd{i}" for i in range(system.n)] + ["info"] * check
    outputs = dict(zip(names, solved, strict=True))
    return cg.simplify(system.graph(outputs, system.q, system.qd, system.tau))


class _Terms(NamedTuple):
    """Lagrange's equation at qdd = 0 by its rates z: d/dt dL/dqd - dL/dq = (sum of inertial_z dz/dqd) - gradient."""

    lagrangian: Node  # folded and shared
    forces: list[Node]  # applied ones, the same
    inertial: dict[Node, Node]  # d/dt dL/dz
    gradient: list[Node]  # dL/dq at fixed z

    def bias(self, system: System, build: Builder) -> list[Node]:
        """The terms at the coordinates."""
        inertial = cotangents(self.inertial, system.qd, build)
        with building(build):
            return [rate - slope for rate, slope in zip(inertial, self.gradient, strict=True)]


def _terms(system: System) -> _Terms:
    """As the system gives its bias, or else derived from L."""
    given = system.bias_forces()
    if given is None:
        return _derived(system)
    pairs = [node for pair in given for node in pair]
    build = Builder()
    lagrangian, *nodes = folded([system.lagrangian, *system.forces, *pairs], build)
    forces, pairs = nodes[: system.n], nodes[system.n :]
    inertial: dict[Node, Node] = {}
    with building(build):
        for velocity, force in zip(pairs[::2], pairs[1::2], strict=True):
            if velocity.value is None:  # else nothing moves there
                inertial[velocity] = inertial.get(velocity, ZERO) + force
    return _Terms(lagrangian, forces, inertial, [ZERO] * system.n)


def _derived(system: System) -> _Terms:
    # Two builders: a term of L must not get the tags of an equal term that derives from it, and hand them on.
    written, build = Builder(), Builder()
    lagrangian, *forces = folded([system.lagrangian, *system.forces], written)
    velocities = rates(lagrangian, system.q, system.qd, system.t, written)
    bars = cotangents({lagrangian: ONE}, [*system.q, *velocities], build, fixed=set(velocities))
    gradient, momenta = bars[: system.n], bars[system.n :]
    x_dot = dict(zip(system.q, system.qd, strict=True)) | ({system.t: ONE} if system.t in system.extra_inputs else {})
    dots = tangents(x_dot, momenta, build)
    inertial = {velocity: dots[p] for velocity, p in zip(velocities, momenta, strict=True) if p in dots}
    return _Terms(lagrangian, forces, inertial, gradient)


def _bias(system: System) -> list[Node]:
    return _terms(system).bias(system, Builder())
