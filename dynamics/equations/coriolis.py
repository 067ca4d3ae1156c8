"""The Coriolis matrix of Christoffel's symbols as a graph."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cgraph import Node
from cgraph.extend import Builder, building, folded, topological

from ..systems.kinematics import ONE, ZERO, changes
from ..systems.system import System
from .equation import Equation, Output, entries, mirrored
from .equations_of_motion import bias
from .substitute import substitute


@Equation("q qd", Output("C_{}_{}", ("n", "n"), "N m s, N s or N s/m"), rewritten=False)
def coriolis(system: System) -> Iterator[list[Node]]:
    """Coriolis matrix C(q, qd) with C qd + gravity_force = bias and dM/dt - 2 C skew.

    The Coriolis force is quadratic in qd with Christoffel's symbols as coefficients, c_i = sum_jk Gamma_ijk qd_j qd_k,
    and these are symmetric in j and k. So C = (d bias / d qd) / 2: one forward sweep a column over the graph of the
    bias. Forces linear in qd (gyroscopic, magnetic) would be halved by that; they count in full, and being skew they
    leave dM/dt - 2 C skew. Where L depends on t, so do they, and dM/dt - 2 C is skew less twice dM/dt at fixed q.
    Quasi-velocities bring the brackets of their columns, C = (d bias / d qd) / 2 - M c(qd, .) / 2, without which
    dM/dt - 2 C would not be skew.

    Raises
    ------
    ValueError
        For an L that is not quadratic in the velocities.

    Examples
    --------
    >>> import dynamics as dyn
    >>> slider = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2), ["r", "theta"])
    >>> dyn.coriolis(slider).evaluate({"q0": 2.0, "q1": 0.0, "qd0": 3.0, "qd1": 5.0})
    {'C_0_0': 0.0, 'C_0_1': -10.0, 'C_1_0': 10.0, 'C_1_1': 6.0}
    """
    require_quadratic(system)
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], Builder())
    mass = [] if system.kinematics.quasi is None else system.mass_matrix(lagrangian, build)
    yield entries(coriolis_matrix(system, folded(bias(system).outputs.values(), build), build, mass))


def coriolis_matrix(
    system: System, forces: list[Node], build: Builder, mass: Sequence[Sequence[Node]]
) -> list[list[Node]]:
    """Rows of C from the nodes of the bias, b(q, qd) = c(q, qd) + G(q) qd + g(q), c of degree two in qd.

    mass: the lower triangle of M, which quasi-velocities need.

    db/dqd = dc/dqd + G, and at qd = 0 it is G. By Euler's theorem dc/dqd qd = 2 c, so C = (dc/dqd) / 2 + G, which is
    (db/dqd + db/dqd at qd = 0) / 2.
    """
    n = system.n
    columns = [changes({velocity: ONE}, forces, build) for velocity in system.qd]  # one sweep gives db/dqd_j
    partials = list(zip(*columns, strict=True))  # db/dqd
    linear = folded(substitute(entries(partials), dict.fromkeys(system.qd, ZERO)), build)  # G
    with building(build):
        halves = [0.5 * (a + b) for a, b in zip(entries(partials), linear, strict=True)]
    rows = [halves[i * n : (i + 1) * n] for i in range(n)]
    if system.kinematics.quasi is None:
        return rows
    brackets, whole = system.kinematics.brackets(build), mirrored(mass)
    with building(build):  # - M c(qd, .) / 2
        for i in range(n):
            for j in range(n):
                taken = sum([whole[i][k] * brackets[k][j] for k in range(n)], ZERO)
                rows[i][j] = rows[i][j] - 0.5 * taken
    return rows


def require_quadratic(system: System) -> None:
    """Raises ValueError unless L is quadratic in the velocities, that is, M does not depend on them."""
    (lagrangian,) = folded([system.lagrangian], Builder())
    reached = set(topological(entries(system.mass_matrix(lagrangian))))
    for name, velocity in zip(system.velocities, system.qd, strict=True):
        if velocity in reached:
            raise ValueError(
                "the Lagrangian must be quadratic in the velocities, "
                f"its mass matrix depends on that of {name!r} ({velocity.name})"
            )
