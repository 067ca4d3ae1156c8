"""Kinematics: how the velocities of a system move its coordinates, and what that does to forces."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cached_property

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import is_finite, is_function, require_kind
from cgraph.extend import Builder, building, cotangents, folded, tangents, topological

from .arguments import names_of, node_or_number, require_known, sequence
from .quasi_velocities import Function, QuasiVelocities

ONE, ZERO = cg.constant(1.0), cg.constant(0.0)
TOLERANCE = 1e-9  # of the terms of a bracket: their rounding


def gathered(pairs: Iterable[tuple[Node, Node]]) -> dict[Node, Node]:
    """{node: sum of what stands beside it}: cotangents, of which two may be at one node."""
    sums: dict[Node, Node] = {}
    for node, value in pairs:
        sums[node] = sums[node] + value if node in sums else value
    return sums


def changes(seeds: Mapping[Node, Node], nodes: Collection[Node], build: Builder | None = None) -> list[Node]:
    """Changes of nodes along {node: its change}, 0 of those that do not change: one forward sweep."""
    dots = tangents(seeds, nodes, build)
    return [dots.get(node, ZERO) for node in nodes]


def dot(a: Sequence[Node], b: Sequence[Node]) -> Node:
    """The sum of products, 0 of none."""
    return sum([x * y for x, y in zip(a, b, strict=True)], ZERO)


def numbered_graph(inputs: Sequence[Node], nodes: Sequence[Node]) -> Graph:
    """The graph whose outputs are called 0, 1, ..."""
    return Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)})


class Kinematics:
    """qdot = G(q) u of a system, and its transpose.

    coordinates, velocities: names, nq and n.  q, u: variables q0.. and qd0...
    quasi: None where u are the rates of the coordinates, G = 1.
    neutral: the coordinates where nothing else is said, (nq,).  groups: see `QuasiVelocities`.
    """

    def __init__(self, coordinates: Sequence[str] | str, quasi: QuasiVelocities | None = None) -> None:
        self.coordinates = names_of("a system", "coordinate", coordinates)
        self.quasi = quasi
        require_kind("quasi_velocities", quasi, QuasiVelocities | None, "QuasiVelocities")
        self.velocities = self.coordinates if quasi is None else names_of("a system", "velocity", quasi.names)
        if len(self.velocities) > len(self.coordinates):
            raise ValueError(f"{len(self.coordinates)} coordinates cannot have {len(self.velocities)} velocities")
        self.neutral = self._numbers("neutral", quasi and quasi.neutral, [0.0] * len(self.coordinates))
        self.groups = self._numbers("groups", quasi and quasi.groups, range(len(self.coordinates)))

    @cached_property
    def q(self) -> list[Node]:
        """Coordinates, variables q0, q1, ..."""
        return cg.variables([f"q{i}" for i in range(len(self.coordinates))])

    @cached_property
    def u(self) -> list[Node]:
        """Velocities, variables qd0, qd1, ..."""
        return cg.variables([f"qd{i}" for i in range(len(self.velocities))])

    @cached_property
    def q_dot(self) -> list[Node]:
        """Rates of the coordinates, G(q) u."""
        return self.rate(self.u)

    def rate(self, u: Sequence[Node]) -> list[Node]:
        """G(q) u of any velocities."""
        return list(u) if self.quasi is None else self._called("rate", self.quasi.rate, len(self.q), self.q, list(u))

    def pulled_back(self, bars: Sequence[Node], build: Builder) -> list[Node]:
        """G^T bars: cotangents of the coordinates as those of the velocities, (n,)."""
        if self.quasi is None:
            return list(bars)
        with building(build):
            seeds = gathered(zip(folded(self.q_dot, build), bars, strict=True))
        return cotangents(seeds, self.u, build)

    def structure(self, momenta: Sequence[Node], build: Builder) -> list[Node]:
        """ad(u; p), (n,)."""
        if self.quasi is None or self.quasi.structure is None:
            return [ZERO] * len(self.u)
        with building(build):
            return self._called("structure", self.quasi.structure, len(self.u), self.u, list(momenta))

    def slopes(self, gradient: Sequence[Node], momenta: Sequence[Node], build: Builder) -> list[Node]:
        """dL/dq as the velocities feel it, less what their brackets take: G^T dL/dq - ad(u; p), (n,)."""
        pulled, taken = self.pulled_back(gradient, build), self.structure(momenta, build)
        with building(build):
            return [slope - term for slope, term in zip(pulled, taken, strict=True)]

    def brackets(self, build: Builder) -> list[list[Node]]:
        """Rows of C(u), (n, n), with C v = c(u, v): the rate of a small displacement is v + C(u) of it."""
        p = cg.variables([f"p{j}" for j in range(len(self.u))])
        terms = self.structure(p, build)
        columns = [cotangents({term: ONE}, p, build) for term in terms]  # ad_k = p . c(u, e_k)
        return [list(row) for row in zip(*columns, strict=True)]

    def normalized(self, q: Sequence[Node]) -> list[Node]:
        """The configuration with the constraint of the coordinates met."""
        if self.quasi is None or self.quasi.normalized is None:
            return list(q)
        return self._called("normalized", self.quasi.normalized, len(self.q), list(q))

    def require_consistent(self) -> None:
        """Raises ValueError unless G is linear in u, of full rank, and the structure that of its columns' brackets."""
        if self.quasi is None:
            return
        u, n = self.u, len(self.u)
        slopes = [cotangents({rate: ONE}, u) for rate in self.q_dot]
        if set(topological([node for row in slopes for node in row])) & set(u):
            raise ValueError("rate must be linear in the velocities u")
        v = cg.variables([f"v{i}" for i in range(n)])
        along, across = self.rate(u), self.rate(v)
        build = Builder()
        straight = changes(dict(zip(self.q, along, strict=True)), across, build)  # D(G v)[G u]
        bent = changes(dict(zip(self.q, across, strict=True)), along, build)  # D(G u)[G v]
        with building(build):
            c = [dot(row, v) for row in self.brackets(build)]
            spanned = self.rate(c)
        outputs = [*bent, *straight, *spanned, *[node for row in slopes for node in row]]
        graph = numbered_graph([*self.q, *u, *v], outputs)
        self._compare(graph, n)

    def _compare(self, graph: Graph, n: int) -> None:
        """Compare terms at random states about neutral coordinates and others, row by row: each may have its unit."""
        rng, nq, compared = np.random.default_rng(0), len(self.q), False
        neutral = np.array(self.neutral)
        for start in (neutral, neutral, np.zeros(nq), np.zeros(nq)):
            numbers = [*(start + rng.uniform(0.3, 1.2, nq)), *rng.uniform(0.3, 1.2, 2 * n)]
            values = graph.evaluate(dict(zip(graph.input_names, map(float, numbers), strict=True))).values()
            rows = np.array(list(values), dtype=np.float64)
            if not np.isfinite(rows).all():
                continue  # outside of where the coordinates are defined
            terms, matrix = rows[: 3 * nq].reshape(3, nq), rows[3 * nq :].reshape(nq, n)
            sizes = np.linalg.norm(matrix, axis=0)
            if np.linalg.matrix_rank(matrix / np.where(sizes > 0.0, sizes, 1.0)) < n:
                raise ValueError("rate must tell the velocities apart: two of them move the coordinates alike")
            bent, straight, spanned = terms
            if (np.abs(bent - straight - spanned) > TOLERANCE * np.abs(terms).sum(axis=0)).any():
                raise ValueError(
                    "structure does not belong to rate: ad_k(u, p) must be p . c(u, e_k) with "
                    "G c(u, v) = D(G u)[G v] - D(G v)[G u]"
                )
            compared = True
        if not compared:
            raise ValueError("rate is not finite about the neutral coordinates: give others, where it can be compared")

    def _called(self, what: str, function: Function, count: int, *arguments: Sequence[Node]) -> list[Node]:
        if not is_function(function):
            raise TypeError(f"{what} must be a function, got {function!r:.60}")
        given = sequence(f"{what} must give", function(*arguments))
        if len(given) != count:
            raise ValueError(f"{what} must give {count} values, got {len(given)}")
        nodes = [node_or_number(what, value) for value in given]
        known = set(topological([node for part in arguments for node in part])) | set(self.q)
        require_known(what, nodes, known, "none of its arguments")
        return nodes

    def _numbers(self, what: str, given: object, default: Sequence[float]) -> tuple[float, ...]:
        values = sequence(f"{what} must be", default if given is None else given)
        if len(values) != len(self.coordinates) or not all(map(is_finite, values)):
            raise ValueError(f"{what} must be {len(self.coordinates)} finite numbers, got {values!r:.60}")
        return tuple([float(value) for value in values])
