"""Generalized forces: what forces on bodies and contacts are along the velocities of a mechanism."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, cotangents

from ...systems.kinematics import gathered
from ..algebra.spatial import ZERO
from ..sweeps.kinematic_chain import KinematicChain
from .contact import Contact, touch
from .external_force import FORCE, Force, powers


def generalized_forces(
    forces: Sequence[object],
    chain: Callable[[str], KinematicChain],
    qd: Sequence[Node],
    parameters: Mapping[str, Node],
) -> list[Node]:
    """Q = J^T f + J_w^T torque of all forces on bodies together, one node for each of qd.

    Virtual power is a sum of forces times velocities, linear in qd, so one reverse sweep from the velocities, seeded
    with the forces, gives its slope along qd. What a force itself depends on is not differentiated.
    chain: the joints between a body and the world.
    """
    build = Builder()
    total = [ZERO] * len(qd)
    for force in forces:
        if isinstance(force, Force | Contact):
            with building(build), cg.tag(force.body, FORCE):
                shares = cotangents(gathered(_powers(force, chain, parameters)), qd, build)
                total = [sum_ + share for sum_, share in zip(total, shares, strict=True)]
    return total


def _powers(
    force: Force | Contact, chain: Callable[[str], KinematicChain], parameters: Mapping[str, Node]
) -> list[tuple[Node, Node]]:
    """Velocities, and the forces on them."""
    if isinstance(force, Force):
        return powers(force, chain(force.body), parameters)
    state = touch(force, chain(force.body), chain(force.to))
    return list(zip(state.velocity, state.force, strict=True))
