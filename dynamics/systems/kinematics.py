"""Kinematics: how the velocities of a system move its coordinates, and what that does to forces."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import is_finite, is_function, require_kind
from cgraph.extend import Builder, building, cotangents, folded, tangents, topological

from .arguments import names_of, node_or_number, require_known, sequence

ONE, ZERO = cg.constant(1.0), cg.constant(0.0)
Function = Callable[..., Sequence[Node | float]]
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


def substitute(nodes: Sequence[Node], replacement: Mapping[Node, Node], tag: str | None = None) -> list[Node]:
    """Copies of nodes with `replacement` in place of variables, operations kept as written.

    tag: of copies of nodes that have none.
    """
    tags = frozenset() if tag is None else frozenset({tag})
    copies = dict(replacement)
    for node in topological(nodes):
        if node.args and node not in copies:
            label = node.label if node.tags or not tags else node.label.tagged(tags)
            copies[node] = Node(node.op, tuple([copies.get(arg, arg) for arg in node.args]), label, name=node.name)
    return [copies.get(node, node) for node in nodes]


def numbered_graph(inputs: Sequence[Node], nodes: Sequence[Node]) -> Graph:
    """The graph whose outputs are called 0, 1, ..."""
    return Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)})


@dataclass(frozen=True, eq=False)
class QuasiVelocities:
    """Motion of coordinates q, (nq,), by velocities u, (n,): qdot = G(q) u, with nq >= n.

    With the Lagrangian written in them, L(q, u, t), the equations of motion are those of Hamel, and of Euler and
    Poincare where q is a rotation:

        p = dL/du,   dp/dt + ad(u; p) - G^T dL/dq = tau + forces - damping * u

    ad comes of the brackets of the columns of G, ad_k = p . c(u, e_k) with G c(u, v) = D(G u)[G v] - D(G v)[G u].
    (G. Hamel, "Die Lagrange-Eulerschen Gleichungen der Mechanik", Z. Math. Phys. 50, 1904.)

    Parameters
    ----------
    names : sequence of str
        The velocities, or one string with spaces between them. Graphs have inputs qd0, qd1, ... in this order.
    rate : callable
        (q, u) to qdot = G(q) u: nq nodes or numbers, linear in u.
    structure : callable, optional
        (u, p) to ad(u; p): n nodes or numbers, linear in u and in p. Left out, it is 0: u are then rates of
        coordinates, if not of these.
    neutral : sequence of float, optional
        The coordinates where nothing else is said, (nq,); by default 0. About them `rate` has to be finite.
    normalized : callable, optional
        q to the same configuration with its constraint met, as q / |q| of a quaternion: nq nodes. L has to be the same
        of both, and is best written so that |q| has no part in it.
    groups : sequence of int, optional
        For each coordinate a number, the same for those that are one quantity, such as the entries of a quaternion:
        an entry counts as large as the largest of its group where tolerances are chosen. By default all differ.

    Examples
    --------
    A rigid body that turns about a fixed point: a quaternion, and its angular velocity in the body's axes.

    >>> import dynamics as dyn
    >>> def rate(e, w):
    ...     return [
    ...         0.5 * (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]),
    ...         0.5 * (e[0] * w[0] + e[2] * w[2] - e[3] * w[1]),
    ...         0.5 * (e[0] * w[1] + e[3] * w[0] - e[1] * w[2]),
    ...         0.5 * (e[0] * w[2] + e[1] * w[1] - e[2] * w[0]),
    ...     ]
    >>> def structure(w, p):
    ...     return [w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]]
    >>> turning = dyn.QuasiVelocities("wx wy wz", rate, structure, neutral=[1.0, 0.0, 0.0, 0.0])
    >>> def energy(e, w, t):
    ...     return 0.5 * (1.0 * w[0] ** 2 + 2.0 * w[1] ** 2 + 3.0 * w[2] ** 2)
    >>> rotor = dyn.System(energy, "ew ex ey ez", quasi_velocities=turning)
    >>> at = {"q0": 1.0, "q1": 0.0, "q2": 0.0, "q3": 0.0, "qd0": 1.0, "qd1": 1.0, "qd2": 1.0}
    >>> dyn.bias(rotor).evaluate(at)  # w x I w, Euler's equations
    {'bias0': 1.0, 'bias1': -2.0, 'bias2': 1.0}
    """

    names: Sequence[str]
    rate: Function
    structure: Function | None = None
    neutral: Sequence[float] | None = None
    normalized: Function | None = None
    groups: Sequence[int] | None = None


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
