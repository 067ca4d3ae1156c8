"""The rows of a mechanism's loops over its coordinates and velocities, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from cgraph import Node

from ..equations.constraints.nearly_redundant_rows import without_nearly_redundant
from ..systems.constraints import Constraints, LoopRow
from .body import Body, MechanismError
from .loops import check_loop, coupling_row, loop_rows, slip_rows
from .structure import Structure
from .sweeps.kinematic_chain import KinematicChain, kinematic_chains
from .sweeps.kinematic_tree import Carrier
from .sweeps.links import LinkState


def check_loops(structure: Structure) -> None:
    """Raises MechanismError for a loop that its bodies cannot have, and for two of one name."""
    bodies = {body.name: body for body in structure.bodies}
    for loop in structure.loops:
        check_loop(loop, bodies)
    labels = [loop.label for loop in structure.loops]
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise MechanismError(f"two loops have the name {twice!r}")


def position_rows(
    structure: Structure,
    moving: Sequence[Body],
    carriers: Mapping[str, Carrier],
    states: Sequence[LinkState],
) -> dict[str, Node]:
    """phi(q) of all loops.  states: of the links of the moving bodies."""
    q = [node for at in states for node in at.q]
    bodies = {body.name: body for body in structure.bodies}
    rows: dict[str, Node] = {}
    for loop in structure.loops:
        if loop.kind == "coupling":
            phi = [coupling_row(loop, moving, bodies, structure.locked, q)]
        else:
            ends = [carriers[name] for name in (loop.body, loop.to)]
            phi = loop_rows(loop, *kinematic_chains(ends, moving, states))
        rows |= dict(zip(loop.rows, phi, strict=True))
    return rows


def of_loops(constraints: Constraints, structure: Structure, moving: Sequence[Body]) -> Constraints:
    """The constraints with what is known of the rows of loops, less those that nearly follow from others.

    A coupling is exact: its row counts as it is.
    """
    constraints.turning = [unit == "rad/s" for body in moving for unit in body.joint.type.velocity_units]
    constraints.loop_rows = {
        name: LoopRow(loop.label, " about " in name.removeprefix(loop.label), loop.tolerance)
        for loop in structure.loops
        if loop.kind != "coupling"
        for name in (*loop.rows, *loop.velocity_rows)
    }
    return without_nearly_redundant(constraints)


def velocity_rows(structure: Structure, chain: Callable[[str], KinematicChain]) -> dict[str, Node]:
    """Velocities that are zero in loops that roll.  chain: the joints between a body and the world."""
    rows: dict[str, Node] = {}
    for loop in structure.loops:
        if loop.velocity_rows:
            rows |= dict(zip(loop.velocity_rows, slip_rows(loop, chain(loop.body), chain(loop.to)), strict=True))
    return rows
