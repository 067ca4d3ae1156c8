"""Loops: frames of two bodies held together, and coordinates held to one another, as rows phi(q) = 0."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array, is_finite
from cgraph.extend import Builder, building

from ..equations.constraints.constraint_rank import without_nearly_redundant
from ..systems.constraints import ConstraintError, Constraints, LoopRow
from .algebra import spatial
from .algebra.spatial import ZERO, Triple
from .bodies.body import WORLD, Body, MechanismError, checked_name, checked_rotation, unknown_body, vector
from .joints import COMPOSITIONS
from .sweeps.kinematic_chain import KinematicChain, kinematic_chains
from .sweeps.kinematic_tree import Carrier
from .sweeps.links import LinkState

ROWS = {
    "point": ("x", "y", "z"),
    "hinge": ("x", "y", "z", "about x", "about y"),
    "weld": ("x", "y", "z", "about x", "about y", "about z"),
    "distance": ("",),
    "coupling": ("",),
    "rolling": ("height",),
}
SLIPS = ("slip x", "slip y")  # rows of velocities of a rolling wheel
CLOSURE_ROUNDING = 1e-9  # of the lengths of a loop: what is left of rows that numbers from text close


@dataclass(frozen=True, eq=False)
class Loop:
    """Constraint that holds a body of a tree to another, or the coordinate of its joint to another's.

    Parameters
    ----------
    kind : str
        "point": a point of the body is on a point of the other. "hinge": and an axis along an axis. "weld": and all
        axes. "distance": the points are `length` apart, as by a rod with ball joints. "coupling": the coordinate of the
        body's joint is a polynomial of that of the other's, as in gears (URDF `mimic`, MJCF `equality/joint`).
        "rolling": a wheel with a thin rim, about `axis` through `at`, of radius `length`, rolls without slip on the
        plane of the other through `to_at` with the normal `to_axis` (nonholonomic).
    body, to : str or mapping of str to float
        Names of the bodies; `to` may be "world", except in a coupling without a second joint. Of a "coupling" either
        may be {body: c}, which stands for the sum of c q over these joints, as a fixed tendon of MJCF does.
    at, to_at : array_like, (3,)
        The points, each in its body's frame [m].
    axis, to_axis : array_like, (3,)
        Of a "hinge" and a "rolling", each in its body's axes; need not have length 1.
    orientation : array_like, (3, 3)
        Of a "weld": the body's axes as columns in those of the other.
    length : float
        Of a "distance" and a "rolling", positive [m].
    coefficients : sequence of float
        Of a "coupling": c0, c1, .. of q = c0 + c1 q_to + c2 q_to^2 + ... [rad or m].
    name : str
        What its rows are called, by default "<body> to <to>".
    tolerance : float
        A row that nearly follows from the others, as those across the plane of a linkage whose axes are parallel but
        for the rounding of a file, is left out with a warning, if no more of it is new than this, of the largest row
        of the loop, and if it opens by no more than this, of the loop's longest lever. 0 leaves out none.

    Raises
    ------
    MechanismError
        For an unknown kind; for other fields when a mechanism is made of it.

    Notes
    -----
    Rows are in the axes of the body that carries both, or the world's. Their multipliers are the force on `body`
    [N] at the point, and, of a hinge and a weld, the torque on it [N m] about axes of the other: x and y across its
    axis, or its own. Of a distance it is the force that pushes them apart, of a coupling the force on the coordinate,
    of a rolling wheel the force of the plane across it and along two axes in it.

    Examples
    --------
    Two wheels geared one to two: a torque of 3 N m on the first turns both, and the gear pushes the second.

    >>> import dynamics as dyn
    >>> first, second = (dyn.Body(name, dyn.Joint("revolute"), inertia=(0.5, 0.5, 1.0)) for name in ("first", "second"))
    >>> gear = dyn.Loop("coupling", "second", "first", coefficients=[0.0, -2.0], name="gear")
    >>> wheels = dyn.Mechanism([first, second], loops=[gear])
    >>> at = {"q0": 0.0, "q1": 0.0, "qd0": 0.0, "qd1": 0.0, "tau0": 3.0, "tau1": 0.0}
    >>> {name: round(x, 9) for name, x in dyn.forward_dynamics(wheels).evaluate(at).items()}
    {'qdd0': 0.6, 'qdd1': -1.2, 'lambda0': -1.2}
    """

    kind: str
    body: str | Mapping[str, float]
    to: str | Mapping[str, float] = WORLD
    at: ArrayLike = (0.0, 0.0, 0.0)
    to_at: ArrayLike = (0.0, 0.0, 0.0)
    axis: ArrayLike = (0.0, 0.0, 1.0)
    to_axis: ArrayLike = (0.0, 0.0, 1.0)
    orientation: ArrayLike = field(default_factory=lambda: np.eye(3))
    length: float = 0.0
    coefficients: Sequence[float] = (0.0, 1.0)
    name: str = ""
    tolerance: float = 2e-4

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in ROWS:
            raise MechanismError(f"a loop must be one of {', '.join(ROWS)}, got {self.kind!r:.60}")

    @property
    def label(self) -> str:
        """Name of the loop, with which those of its rows begin."""
        ends = [", ".join([f"{name}" for name, _ in _shares(end)]) for end in (self.body, self.to)]
        return self.name or " to ".join(ends)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all its bodies, "world" among them."""
        return tuple([name for name, _ in [*_shares(self.body), *_shares(self.to)]])

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of its rows."""
        return tuple([f"{self.label} {row}".rstrip() for row in ROWS[self.kind]])

    @property
    def velocity_rows(self) -> tuple[str, ...]:
        """Names of its rows of velocities alone."""
        return tuple([f"{self.label} {row}" for row in SLIPS]) if self.kind == "rolling" else ()


def _shares(end: str | Mapping[str, float]) -> list[tuple[str, float]]:
    return [*end.items()] if isinstance(end, Mapping) else [(end, 1.0)]


def check_loops(loops: Sequence[Loop], bodies: Sequence[Body]) -> None:
    """Raises MechanismError for a loop that its bodies cannot have, and for two of one name."""
    named = {body.name: body for body in bodies}
    for loop in loops:
        _check_loop(loop, named)
    labels = [loop.label for loop in loops]
    if twice := [label for label in labels if labels.count(label) > 1]:
        raise MechanismError(f"two loops have the name {twice[0]!r}")


def position_rows(
    loops: Sequence[Loop],
    moving: Sequence[Body],
    carriers: Mapping[str, Carrier],
    locked: Mapping[str, ArrayLike],
    states: Sequence[LinkState],
) -> dict[str, Node]:
    """phi(q) of loops, but for those whose joints all stand still.  states: of the links that move.

    locked: coordinates of joints that stand still. Raises ConstraintError where a loop stays open between such.
    """
    coordinates = {name: cg.constant(float(np.ravel(at)[0])) for name, at in locked.items()}
    coordinates |= {at.name: at.q[0] for at in states}
    rows: dict[str, Node] = {}
    for loop in loops:
        if loop.kind == "coupling":
            phi, sizes = [_coupling_row(loop, coordinates)], [1.0]
        else:
            chains = kinematic_chains([carriers[name] for name in loop.bodies], moving, states)
            phi, sizes = _loop_rows(loop, *chains), [*chains[0].lengths(loop.at), *chains[1].lengths(loop.to_at)]
        if all([row.value is not None for row in phi]):
            _require_closed(loop, [float(row.value or 0.0) for row in phi], max(sizes))
            continue
        rows |= dict(zip(loop.rows, phi, strict=True))
    return rows


def of_loops(constraints: Constraints, loops: Sequence[Loop], moving: Sequence[Body]) -> Constraints:
    """The constraints with what is known of the rows of loops, less those that nearly follow from others.

    A coupling is exact: its row counts as it is.
    """
    constraints.turning = [unit == "rad/s" for body in moving for unit in body.joint.type.velocity_units]
    constraints.loop_rows = {
        name: LoopRow(loop.label, " about " in name.removeprefix(loop.label), loop.tolerance)
        for loop in loops
        if loop.kind != "coupling"
        for name in (*loop.rows, *loop.velocity_rows)
    }
    return without_nearly_redundant(constraints)


def coupled(loop: Loop, standing: Mapping[str, float | ArrayLike]) -> dict[str, float]:
    """The coordinate that a coupling gives the last of its joints, where the others stand still; else empty."""
    moving = [name for name in loop.bodies if name not in standing and name != WORLD]
    if loop.kind != "coupling" or len(moving) != 1 or not any([name in standing for name in loop.bodies]):
        return {}
    (share, own), (to_share, other) = (
        (
            dict(_shares(end)).get(moving[0], 0.0),
            sum([x * float(np.ravel(standing[name])[0]) for name, x in _shares(end) if name in standing]),
        )
        for end in (loop.body, loop.to)
    )
    polynomial = np.polynomial.Polynomial(np.asarray(loop.coefficients, dtype=np.float64))
    if share:
        return {moving[0]: (float(polynomial(other)) - own) / share}
    roots = (polynomial - own).trim().roots()
    real = roots[np.abs(roots.imag) <= CLOSURE_ROUNDING * np.abs(roots)].real
    return {moving[0]: (float(min(real, key=abs)) - other) / to_share} if len(real) and to_share else {}


def _require_closed(loop: Loop, gaps: Sequence[float], size: float) -> None:
    """Raises ConstraintError for a loop among joints that stand still which is open by more than its tolerance."""
    for name, gap in zip(loop.rows, gaps, strict=True):
        scale = 1.0 if " about " in name.removeprefix(loop.label) else size
        if abs(gap) > max(loop.tolerance, CLOSURE_ROUNDING) * scale:
            raise ConstraintError(
                f"the constraints cannot be met: {name!r} is open by {gap:.3g}, and its joints are locked"
            )


def velocity_rows(loops: Sequence[Loop], chain: Callable[[str], KinematicChain]) -> dict[str, Node]:
    """Velocities that are zero in loops that roll.  chain: the joints between a body and the world."""
    rows: dict[str, Node] = {}
    for loop in loops:
        if loop.velocity_rows:
            slips = _slip_rows(loop, *map(chain, loop.bodies))
            if any([slip.value is None for slip in slips]):
                rows |= dict(zip(loop.velocity_rows, slips, strict=True))
    return rows


def _check_loop(loop: Loop, bodies: Mapping[str, Body]) -> None:
    """Raises MechanismError unless the loop's bodies are there and its numbers are what its kind needs."""
    if loop.kind != "coupling" and any([isinstance(end, Mapping) for end in (loop.body, loop.to)]):
        raise MechanismError(f"loop {loop.label!r}: only a coupling has several bodies at one end")
    for name in loop.bodies:
        if not isinstance(name, str) or (name not in bodies and (name != WORLD or name is loop.body)):
            raise unknown_body(f"there is a loop on the unknown body {name!r:.80}", name, bodies)
    checked_name("a loop", loop.label if isinstance(loop.name, str) else loop.name)
    where = f"loop {loop.label!r}"
    for what in ("at", "to_at"):
        vector(f"{where}: {what}", getattr(loop, what))
    if loop.kind in ("hinge", "rolling"):
        for what in ("axis", "to_axis"):
            if not np.any(vector(f"{where}: {what}", getattr(loop, what))):
                raise MechanismError(f"{where}: {what} must not be zero")
    if not (is_finite(loop.tolerance) and 0.0 <= loop.tolerance < 1.0):
        raise MechanismError(f"{where}: tolerance must be at least 0 and less than 1, got {loop.tolerance!r:.60}")
    if loop.kind == "weld":
        checked_rotation(f"{where}: orientation", loop.orientation)
    if loop.kind in ("distance", "rolling") and not (is_finite(loop.length) and loop.length > 0.0):
        raise MechanismError(f"{where}: length must be positive and finite, got {loop.length!r:.60} m")
    if loop.kind == "coupling":
        _check_coupling(loop, where, bodies)


def _check_coupling(loop: Loop, where: str, bodies: Mapping[str, Body]) -> None:
    given = loop.coefficients
    listed = isinstance(given, Sequence | np.ndarray) and not isinstance(given, str)
    if not (listed and len(given) and all([is_finite(each) for each in given])):
        raise MechanismError(f"{where}: coefficients must be finite numbers, at least one, got {given!r:.60}")
    for name, share in [*_shares(loop.body), *_shares(loop.to)]:
        if not is_finite(share):
            raise MechanismError(f"{where}: the coefficient of {name!r} must be finite, got {share!r:.60}")
        if name == WORLD:
            fits = len(given) == 1  # a constant
        else:
            joint = bodies[name].joint
            fits = joint.kind not in COMPOSITIONS and len(joint.type.coordinates) == 1
        if not fits:
            raise MechanismError(f"{where}: a coupling needs joints with one coordinate, which {name!r} has not")


def _loop_rows(loop: Loop, body: KinematicChain, to: KinematicChain) -> list[Node]:
    """phi of a loop that holds frames, of which these are the placements."""
    with building(Builder()), cg.tag(loop.label):
        gap = spatial.plus(body.place_of(loop.at), spatial.scaled(-1.0, to.place_of(loop.to_at)))
        if loop.kind == "distance":
            length = float(loop.length)
            return [(0.5 / length) * (spatial.dot(gap, gap) - length * length)]
        if loop.kind == "rolling":
            axis, target = _axes(loop)
            normal = to.axis(target[:, 2])
            tilt = spatial.dot(body.axis(axis[:, 2]), normal)
            return [spatial.dot(gap, normal) - float(loop.length) * cg.sqrt(1.0 - tilt * tilt)]
        rows = list(gap)
        if loop.kind == "hinge":
            axis, target = _axes(loop)
            along = body.axis(axis[:, 2])
            rows += [
                -spatial.dot(to.axis(target[:, 1]), along),
                spatial.dot(to.axis(target[:, 0]), along),
            ]
        if loop.kind == "weld":
            x, y, z = (body.axis(column) for column in np.asarray(loop.orientation, dtype=np.float64))
            x_to, y_to, z_to = (to.axis(column) for column in np.eye(3))
            rows += _rotation_rows((x, y, z), (x_to, y_to, z_to))
    return _without_rounding(rows, [*body.lengths(loop.at), *to.lengths(loop.to_at)])


def _rotation_rows(axes: Sequence[Triple], to: Sequence[Triple]) -> list[Node]:
    """2 tan(angle / 2) about the axis of the rotation between two frames, zero where they are the same and only there.

    Its rate is then the angular velocity, and Newton's method takes angle - sin(angle): it turns by less than half a
    turn and back.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = ([spatial.dot(axis, each) for each in to] for axis in axes)
    scale = 2.0 / (1.0 + xx + yy + zz)
    return [scale * (yz - zy), scale * (zx - xz), scale * (xy - yx)]


def _slip_rows(loop: Loop, body: KinematicChain, to: KinematicChain) -> list[Node]:
    """The velocity of a rolling wheel's lowest point against the plane, along two axes of it; in the world's axes."""
    with building(Builder()), cg.tag(loop.label):
        axis, target = _axes(loop)
        x, y, normal = (to.direction(spatial.constant(column)) for column in target.T)
        along = body.direction(spatial.constant(axis[:, 2]))
        tilt = spatial.dot(along, normal)
        down = spatial.plus(spatial.scaled(tilt, along), spatial.scaled(-1.0, normal))
        arm = spatial.scaled(float(loop.length) / cg.sqrt(1.0 - tilt * tilt), down)
        wheel, ground = body.motion(loop.at), to.motion(loop.to_at)
        slip = spatial.plus(wheel.velocity, spatial.cross(wheel.omega, arm))
        reach = spatial.plus(spatial.plus(wheel.position, arm), spatial.scaled(-1.0, ground.position))
        moving = spatial.plus(ground.velocity, spatial.cross(ground.omega, reach))
        slip = spatial.plus(slip, spatial.scaled(-1.0, moving))
        return [spatial.dot(x, slip), spatial.dot(y, slip)]


def _coupling_row(loop: Loop, coordinates: Mapping[str, Node]) -> Node:
    """q - (c0 + c1 q_to + ..) of a coupling; a locked joint is a number."""
    with building(Builder()), cg.tag(loop.label):
        own, other = (
            sum([float(share) * coordinates[name] for name, share in _shares(end) if name != WORLD], ZERO)
            for end in (loop.body, loop.to)
        )
        value = ZERO
        for coefficient in reversed(loop.coefficients[1:]):
            value = (value + float(coefficient)) * other
        return own - (value + float(loop.coefficients[0]))


def _axes(loop: Loop) -> list[Array]:
    """Axes whose third column is that of the loop, (3, 3), of each of its bodies."""
    given = [np.asarray(axis, dtype=np.float64) for axis in (loop.axis, loop.to_axis)]
    return [spatial.to_z(spatial.snapped(spatial.unit(axis))) for axis in given]


def _without_rounding(rows: Sequence[Node], lengths: Sequence[float]) -> list[Node]:
    """The rows, with 0 for constants that are rounding of the loop's lengths, or, of angles, of 1."""
    scale = [max(lengths, default=0.0)] * 3 + [1.0] * 3
    return [
        ZERO if row.value is not None and abs(row.value) <= CLOSURE_ROUNDING * size else row
        for row, size in zip(rows, scale, strict=False)
    ]
