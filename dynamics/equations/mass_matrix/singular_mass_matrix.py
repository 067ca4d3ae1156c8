"""Singular mass matrices: their error, what a graph says of one, and motions without inertia, looked for by numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node, extend
from cgraph._shared import Array, real_array
from cgraph.extend import SingularError, solve_nodes, topological

from ...systems.kinematics import substitute
from ...systems.model import Model, as_system
from ...systems.system import System
from ..constraints.constraints import unknown_names
from ..equation import entries, mirrored

STATES = 3
TORQUE = 2.0**200  # so large that no other force counts
ROUNDINGS = 8  # of constants, tried at a state
PLACES = 8  # units in its last place, by which a constant of a body may be off that was made of others
SPARE = 1e-3  # what rounding may do to M^-1, relative, where M is not looked at closely


class SingularMassMatrixError(ValueError):
    """A coordinate or a motion of several has no inertia, so that its acceleration is not determined.

    The message names the coordinates. `forward_dynamics` and what is made from it raise it where the mass matrix is
    singular at every state, `raise_if_singular` where it is singular at one.

    Examples
    --------
    >>> import dynamics as dyn
    >>> massless = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - q[0] * q[1], ["x", "y"])
    >>> try:
    ...     dyn.forward_dynamics(massless)
    ... except dyn.SingularMassMatrixError as error:
    ...     print(error)
    the mass matrix is singular: coordinate 'y' has no inertia, or none that others do not share
    """


def raise_if_singular(model: Model, info: ArrayLike) -> None:
    """Raise SingularMassMatrixError, naming the coordinate, unless the output `info` of `forward_dynamics` is 0.

    Parameters
    ----------
    model : Model
        The one that forward dynamics was made from.
    info : array_like
        A number, or an array of any shape; the first entry that is not 0 is reported, with its index.

    Raises
    ------
    SingularMassMatrixError
        An entry is not 0: the mass matrix is not positive definite at that state.

    Examples
    --------
    >>> import dynamics as dyn
    >>> bead = dyn.System(lambda q, qd, t: 0.5 * q[0] * qd[0] ** 2, ["x"])  # its inertia is x
    >>> values = dyn.forward_dynamics(bead, check=True).evaluate({"q0": -1.0, "qd0": 0.0, "tau0": 1.0})
    >>> try:
    ...     dyn.raise_if_singular(bead, values["info"])
    ... except dyn.SingularMassMatrixError as error:
    ...     print(error)
    the mass matrix is not positive definite: coordinate 'x' has an inertia that is not positive
    """
    values, names = real_array("info", info), unknown_names(as_system(model))
    failed = np.argwhere(values != 0.0)
    if len(failed):
        at = tuple(failed[0].tolist())
        if values[at] not in range(1, len(names) + 1):
            raise ValueError(f"info must be 0, or from 1 to {len(names)} for a coordinate, got {values[at]:g}")
        name = names[int(values[at]) - 1]
        where = f" at state {', '.join(map(str, at))}" if at else ""
        if name.startswith("constraint"):
            raise SingularMassMatrixError(f"the constraints are singular{where}: {name} follows from others")
        raise SingularMassMatrixError(
            f"the mass matrix is not positive definite{where}: {name} has an inertia that is not positive"
        )


def no_inertia(system: System, error: SingularError) -> str:
    """Sentence on the coordinate whose pivot is not positive."""
    name = system.velocities[error.index]
    if error.regular:
        return f"the mass matrix is not positive definite: coordinate {name!r} has an inertia that is not positive"
    return f"the mass matrix is singular: coordinate {name!r} has no inertia, or none that others do not share"


def balanced(matrix: Array) -> Array:
    """s_i M_ij s_j with rows whose largest entries are about 1, for powers of two s: Ruiz's scaling, a few turns.

    matrix: (..., n, n), symmetric. A row of zeros stays.
    """
    scale = np.ones(matrix.shape[:-1])
    for _ in range(4):
        rows = np.abs(scale[..., :, None] * matrix * scale[..., None, :]).max(axis=-1)
        scale = scale * 2.0 ** -np.round(0.5 * np.log2(np.where(rows > 0.0, rows, 1.0)))
    return scale[..., :, None] * matrix * scale[..., None, :]


def coordinate_sizes(system: System) -> list[float]:
    """Sizes of coordinates, (nq,): of places the length [m] that an angle of 1 moves the bodies by; 1 of all others."""
    longest = next((length for length in system.lengths if length not in (0.0, 1.0)), 1.0)
    groups = list(system.kinematics.groups)
    places = [x == 1.0 and groups.count(k) == 1 for x, k in zip(system.lengths, groups, strict=False)]
    return [longest if place else 1.0 for place in places]  # several are one quantity, a quaternion


def require_inertia(system: System, accelerations: Graph) -> None:
    """Raises SingularMassMatrixError where M is singular at every state, though no pivot is the constant zero."""
    if moving := _without_inertia(system, accelerations):
        names = " and ".join([repr(system.velocities[i]) for i in moving])
        raise SingularMassMatrixError(
            f"the mass matrix is singular at every state: {'a motion of ' * (len(moving) > 1)}{names} has no inertia"
        )


def _without_inertia(system: System, accelerations: Graph) -> list[int]:
    """The coordinates of which no digit of the acceleration is certain at some random states; [] where M has full rank.

    accelerations: the graph of forward dynamics. Its M^-1 mostly shows at once that there is nothing to fear. A pivot
    that is all rounding leaves no digit; one that is small, since a mass is, leaves them all. Constants that are folded
    on the way do not tell how they were rounded. So where digits stay, M x = tau is solved anew with those of L as
    inputs, which are moved in their last place.
    """
    n, rng = system.n, np.random.default_rng(0)
    sizes = {f"q{i}": size for i, size in enumerate(coordinate_sizes(system))}
    found: set[int] = set()
    unfolded: tuple[Graph, dict[str, float]] | None = None
    for k in range(STATES):
        drawn = {name: 10.0**-k * float(rng.uniform(0.5, 1.5)) for name in accelerations.input_names}
        point = {name: sizes.get(name, 1.0) * x for name, x in drawn.items()}
        point |= {f"tau{i}": TORQUE * point[f"tau{i}"] for i in range(n)}
        inverse = _inverse(accelerations, point, n)
        finite = np.isfinite(inverse).all(axis=1)
        if not finite.all():
            rows = enumerate(entries(mirrored(system.mass_matrix(system.lagrangian))))
            graph = cg.simplify(system.graph({str(k): entry for k, entry in rows}, system.q, system.qd))
            numbers = graph.evaluate({name: point[name] for name in graph.input_names}).values()
            inertia = np.array([*numbers], dtype=np.float64).reshape(n, n)
            if not np.isfinite(inertia).all():
                continue  # there is no M at this state
            if np.linalg.eigvalsh(balanced(inertia))[0] * SPARE > np.finfo(float).eps * n:
                return []  # it is a force that overflows
            found |= set(np.flatnonzero(~finite).tolist())  # a pivot is zero
            continue
        if np.linalg.cond(balanced(inverse), 1) * np.finfo(float).eps * n < SPARE:
            return []
        digits = extend.certain_digits(accelerations, point)
        lost = {i for i in range(n) if digits[f"qdd{i}"] == 0.0}
        if not lost:
            unfolded = unfolded or _unfolded(system)
            lost = _moved_by_rounding(*unfolded, point)
        if not lost:
            return []
        found |= lost
    return sorted(found)


def _unfolded(system: System) -> tuple[Graph, dict[str, float]]:
    """The solution of M x = tau with the constants of L as inputs, and their values by name; exponents stay."""
    nodes = topological([system.lagrangian])
    exponents = {node.args[1].value for node in nodes if node.op.name == "pow"}
    values = {node.value for node in nodes if node.value is not None} - exponents - {0.0, 1.0, -1.0}
    inputs = {value: cg.variable(f"constant{k}#") for k, value in enumerate(sorted(values))}
    replacement = {node: inputs[node.value] for node in nodes if node.value in inputs}
    (lagrangian,) = substitute([system.lagrangian], replacement)
    solution = solve_nodes(lagrangian, system.qd, system.tau)
    variables: list[Node] = [node for node in topological(solution) if not node.args and node.value is None]
    graph = Graph(variables, {f"qdd{i}": node for i, node in enumerate(solution)})
    return graph, {str(node.name): value for value, node in inputs.items()}


def _moved_by_rounding(graph: Graph, constants: Mapping[str, float], point: Mapping[str, float]) -> set[int]:
    """The outputs that change by half of their size or more as the constants change in their last place."""
    steps = np.random.default_rng(0).integers(-PLACES, PLACES + 1, (len(constants), ROUNDINGS))
    moved = {name: x + steps[k] * np.spacing(x) for k, (name, x) in enumerate(constants.items())}
    with np.errstate(all="ignore"):
        results = graph.evaluate({name: moved.get(name, point.get(name, 0.0)) for name in graph.input_names})
        moves = [not np.isfinite(x).all() or np.ptp(x) > 0.5 * np.abs(x).max() for x in results.values()]
    return set(np.flatnonzero(moves).tolist())


def _inverse(accelerations: Graph, point: dict[str, float], n: int) -> Array:
    """M^-1 (n, n), from the accelerations at large torques on one coordinate at a time."""
    torques = {f"tau{i}": torque for i, torque in enumerate(TORQUE * np.eye(n))}
    with np.errstate(all="ignore"):
        values = accelerations.evaluate(point | torques)
        return np.array([np.broadcast_to(values[f"qdd{i}"], n) for i in range(n)]) / TORQUE
