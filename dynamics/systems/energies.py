"""Kinetic and potential energy of a Lagrangian: the terms with these tags, and of others what motion adds."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from cgraph import Node, extend
from cgraph._shared import shortened
from cgraph.extend import Builder, building, cotangents, folded, topological

from .kinematics import ONE, ZERO, dot


class Energies(NamedTuple):
    """K and P of a Lagrangian, L + P, and in words how K was taken.

    without_potential: L + P. It is K, or K and terms in neither: linear in velocities (gyroscopic), or not quadratic.
    """

    kinetic: Node
    potential: Node
    without_potential: Node
    source: str

    @property
    def taken(self) -> str:
        """Sentence on K as the formulations differentiate it, L + P."""
        more = ", and with it go the terms of L with velocities that are in neither K nor P"
        return f"K is {self.source}{more * (self.without_potential is not self.kinetic)}."


def energies(lagrangian: Node, velocities: Sequence[Node]) -> Energies:
    """K and P: terms tagged so, P without velocities; of all others P is the energy at rest, and K = E - P."""
    moving, kinds = _moving(lagrangian, velocities), dict[Node, str]()
    for node in topological([lagrangian]):
        tags = node.tags & {"kinetic", "potential"}
        kinds[node] = min(tags) if len(tags) == 1 and not ("potential" in tags and node in moving) else ""
    terms = list(signed_terms(lagrangian, [node for node, kind in kinds.items() if not kind]))
    kinetic, potential, rest = (
        [each for each in terms if kinds[each[1]] == kind] for kind in ("kinetic", "potential", "")
    )
    if len(rest) == len(terms):
        return Energies(*_by_rest(lagrangian, velocities), "E - P, the energy less that at rest")
    more, below, both = _by_rest(added(rest), velocities)
    found = added([*kinetic, (1, more)])
    both = found if both is more else added([*kinetic, (1, both)])
    still = added([*[(-sign, node) for sign, node in potential], (1, below)])
    return Energies(found, still, both, "the terms of L tagged 'kinetic'")


def split_by_motion(lagrangian: Node, velocities: Sequence[Node]) -> tuple[Node, Node]:
    """Sums of the terms of L with velocities and, their sign turned, without: sums are taken apart until that is so."""
    moving = _moving(lagrangian, velocities)
    terms = list(signed_terms(lagrangian, moving))
    still = [(-sign, node) for sign, node in terms if node not in moving]
    return added([each for each in terms if each[1] in moving]), added(still)


def signed_terms(total: Node, among: Collection[Node] | None = None) -> Iterator[tuple[int, Node]]:
    """The terms of a sum with their signs, in their order.  among: nodes that are taken apart, by default all."""
    stack = [(1, total)]
    while stack:
        sign, node = stack.pop()
        parts = among is None or node in among
        if parts and node.op.name in ("add", "sub"):
            a, b = node.args
            stack += [(-sign if node.op.name == "sub" else sign, b), (sign, a)]
        elif parts and node.op.name == "neg":
            stack.append((-sign, node.args[0]))
        else:
            yield sign, node


def added(terms: Sequence[tuple[int, Node]]) -> Node:
    """The sum of nodes with signs, without zeros; 0 of none."""
    total: Node | None = None
    for sign, node in terms:
        if node.value != 0.0:
            term = node if sign > 0 else -node
            total = term if total is None else total + term
    return ZERO if total is None else total


def _moving(lagrangian: Node, velocities: Sequence[Node]) -> set[Node]:
    """The velocities, and of L and what it is made from all that depends on them."""
    moving = set(velocities)
    for node in topological([lagrangian]):
        if any(arg in moving for arg in node.args):
            moving.add(node)
    return moving


def _by_rest(lagrangian: Node, velocities: Sequence[Node]) -> tuple[Node, Node, Node]:
    """K = E - P, P = -L at rest, and L + P: terms as they are written where those with velocities are 0 at rest."""
    moving, still = split_by_motion(lagrangian, velocities)
    build = Builder()
    (energy,) = folded([moving], build)  # in which the square of a hypot is smooth
    momenta = cotangents({energy: ONE}, velocities, build)
    at_rest = folded([energy, *momenta], build, dict.fromkeys(velocities, ZERO))
    lower = extend.hessian_nodes(energy, velocities, build)
    parts = [*at_rest, *[entry for row in lower for entry in row]]
    for value, *rest in (parts, shortened(parts)):
        slopes, masses = rest[: len(momenta)], rest[len(momenta) :]
        quadratic = set(velocities).isdisjoint(topological(masses))
        gyroscopic = any([slope.value != 0.0 for slope in slopes])
        if quadratic and value.value == 0.0 and not gyroscopic:
            return moving, still, moving
    with building(build):
        potential = still - value
        both = moving if value.value == 0.0 else energy - value
        if not quadratic:
            return dot(momenta, velocities) - energy + value, potential, both
        pairs = [(a, b) for i, a in enumerate(velocities) for b in velocities[: i + 1]]
        kinetic = dot(masses, [0.5 * a * b if a is b else a * b for a, b in pairs])
        return kinetic, potential, both if gyroscopic else kinetic
