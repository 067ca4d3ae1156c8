"""Lagrangian systems: L(q, qd, t), its parameters, damping and applied forces, as nodes."""

from __future__ import annotations

import numbers
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property

from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node, _shared, extend
from cgraph._shared import HoldsNodes, require_sequence
from cgraph.extend import Builder, building, topological

from .arguments import (
    TIME,
    Parameters,
    call_user_function,
    dampers,
    node_or_number,
    one_for_each,
    parameters_of,
    require_known,
    sequence,
)
from .body_terms import BodyTerms
from .constraints import Constraints
from .energies import Energies, added, energies, split_by_motion
from .kinematics import Kinematics, QuasiVelocities, dot


class System(HoldsNodes):
    """A mechanical system with Lagrangian L(q, qd, t) = K - P.

    The equation of motion is  d/dt dL/dqd - dL/dq = tau + forces - damping * qd.

    Parameters
    ----------
    lagrangian : callable
        (q, qd, t) or (q, qd, t, p) to L [J], a node or a sequence of partial Lagrangians L_i that are summed.
        q, qd: lists of n nodes in the order of `coordinates`; t: a node; p: {parameter name: node}.
    coordinates : sequence of str
        The names of the n coordinates, or one string with spaces between them. Graphs have inputs q0, q1, ... in this
        order; messages and tables show the names.
    parameters : mapping of str to float
        Each is an input of the graphs, and `simulate` binds it to the value.
    forces : callable
        (q, qd, t) or (q, qd, t, p) to one generalized force for each coordinate, node or number [N m or N], beside the
        applied tau.
    damping : float or node, a sequence of them, or a matrix
        Viscous coefficient >= 0 for all coordinates or for each [N m s or N s/m], or (n, n) for dampers between them,
        of numbers so that qd D qd >= 0; the force is -D qd. A node is over parameters.
    quasi_velocities : QuasiVelocities
        Where the velocities qd are no rates of the coordinates, how they move them. L is then L(q, qd, t) of these
        velocities, and forces, damping and tau belong to them, n of each; of the coordinates there are nq.
    constraints : callable
        (q, t) or (q, t, p) to m nodes that are 0, phi(q, t) = 0: a sequence, or {name: node}. They hold the motion by
        forces J^T lambda, and `forward_dynamics` gives both. Energies, mass matrix, bias and inverse dynamics are those
        of the system without them.
    velocity_constraints : callable
        (q, qd, t) or (q, qd, t, p) to rows that are 0 and linear in qd, such as those of rolling (nonholonomic).
    body_terms : BodyTerms, optional
        What rigid bodies know of their equations beside L; a `Mechanism` hands it in.

    Attributes
    ----------
    coordinates, velocities : tuple of str
        Names, nq and n; of the coordinates alone, unless there are quasi-velocities.
    q, qd : list of Node
        Coordinates and velocities, variables q0, q1, .. and qd0, qd1, ...
    nq, n : int
        Numbers of coordinates, and of velocities, the degrees of freedom.

    Raises
    ------
    TypeError, ValueError
        Say what was given and what was needed.

    Examples
    --------
    >>> import dynamics as dyn
    >>> def lagrangian(q, qd, t, p):
    ...     return 0.5 * p["m"] * qd[0] ** 2 - 0.5 * p["k"] * q[0] ** 2
    >>> dyn.System(lagrangian, ["x"], parameters={"m": 2.0, "k": 8.0})
    <System of 1 coordinate(s) x, parameters m, k>
    """

    ode = mechanism = None  # neither a first-order system nor bodies, see `Model`

    def __init__(
        self,
        lagrangian: Callable[..., Node | Sequence[Node]],
        coordinates: Sequence[str],
        parameters: Mapping[str, float] | None = None,
        forces: Callable[..., Sequence[Node | float]] | None = None,
        damping: float | Node | Sequence[float | Node | Sequence[float | Node]] = 0.0,
        quasi_velocities: QuasiVelocities | None = None,
        constraints: Callable[..., object] | None = None,
        velocity_constraints: Callable[..., object] | None = None,
        body_terms: BodyTerms | None = None,
    ) -> None:
        _shared.require_kind("body_terms", body_terms, BodyTerms | None, "BodyTerms")
        self.kinematics, self.body_terms = Kinematics(coordinates, quasi_velocities), body_terms
        self.coordinates, self.velocities = self.kinematics.coordinates, self.kinematics.velocities
        self.q, self.qd = self.kinematics.q, self.kinematics.u
        self.nq, self.n = len(self.q), len(self.qd)
        if body_terms is None:  # the types of joints are known to be consistent
            self.kinematics.require_consistent()
        self.parameters = parameters_of(parameters)
        self.damping = dampers(damping, self.velocities)
        p = Parameters(self.parameters)
        energy = call_user_function("lagrangian", lagrangian, self.q, self.qd, self.t, p)
        single = isinstance(energy, (Node, numbers.Real))
        partials = [energy] if single else sequence("the lagrangian must give a node or", energy)
        if not partials:
            raise ValueError("the lagrangian gave no partial Lagrangians")
        self.partial_lagrangians = tuple([node_or_number("the lagrangian", partial) for partial in partials])
        self.forces = tuple([cg.constant(0.0)] * self.n)
        if forces is not None:
            with cg.tag("force"):
                self.forces = tuple(generalized_forces("forces", forces, self, p))
        damped = [each for row in self.damping_rows for each in row if isinstance(each, Node)]
        require_known("damping", damped, p.values(), f"no parameter (it has {', '.join(p) or 'none'})")
        self.constraints = Constraints(self.kinematics, self.t, self.parameters, constraints, velocity_constraints)
        self.require_known("the system", self._given, p)
        if body_terms is None:  # rows of loops may be 0, such as those across a plane
            self.constraints.require_slopes()

    def require_known(self, what: str, nodes: Sequence[Node], parameters: Mapping[str, Node]) -> None:
        """Raises ValueError for a variable that is neither of the state, nor t, nor one of these parameters."""
        names = ", ".join((*self.coordinates, *parameters))
        known = {*self.q, *self.qd, self.t, *parameters.values()}
        require_known(what, nodes, known, f"no coordinate, parameter or t (it has {names})")

    def require_values(self, values: Mapping[str, ArrayLike]) -> None:
        """Raises ValueError for values of the parameters, one or N of each, with which the bodies cannot be."""
        if self.body_terms is not None:
            self.body_terms.require_values(values)

    @property
    def system(self) -> System:
        """The system itself, as a `Model` has it."""
        return self

    @cached_property
    def forms(self) -> list[System]:
        """The system, and of bodies one with the energy of base numbers, which is another but for its derivatives."""
        if self.body_terms is None:
            return [self]
        fewest = self.body_terms.equations.regrouped_lagrangians(self.q, self.qd)
        return [self, self.changed(partial_lagrangians=tuple(fewest), extra_inputs=self.extra_inputs)]

    @property
    def whole(self) -> System | None:
        """The system with all inertial numbers of all bodies, where fewer may cost digits; else None."""
        if self.body_terms is None or (equations := self.body_terms.equations.whole) is None:
            return None
        return self.changed(body_terms=replace(self.body_terms, equations=equations))

    @property
    def lengths(self) -> tuple[float, ...]:
        """Scale of each coordinate and velocity in comparisons of size [m, of bodies]; 0 if it has none.

        1 of lengths, and of angles what they move the bodies by.
        """
        return (1.0,) * (self.nq + self.n) if self.body_terms is None else self.body_terms.lengths

    @property
    def q_dot(self) -> list[Node]:
        """Rates of the coordinates: qd, or G(q) qd of quasi-velocities."""
        return self.kinematics.q_dot

    @cached_property
    def qdd(self) -> list[Node]:
        """Accelerations, variables qdd0, qdd1, ..."""
        return cg.variables([f"qdd{i}" for i in range(self.n)])

    @cached_property
    def tau(self) -> list[Node]:
        """Applied forces, variables tau0, tau1, ..."""
        return cg.variables([f"tau{i}" for i in range(self.n)])

    @cached_property
    def t(self) -> Node:
        """Time."""
        return cg.variable(TIME)

    @cached_property
    def extra_inputs(self) -> list[Node]:
        """Inputs that every graph of the system has after its state: t if anything depends on it, and parameters."""
        reached = set(topological(self._given))
        time = [self.t] if self.t in reached else []
        return [*time, *cg.variables(list(self.parameters))]

    @property
    def _given(self) -> tuple[Node, ...]:
        """List of the nodes that the caller gave."""
        return (
            *self.partial_lagrangians,
            *self.forces,
            *self.constraints.positions,
            *self.constraints.velocities,
        )

    @cached_property
    def lagrangian(self) -> Node:
        """L, the sum of the partial Lagrangians (the paper, section 4.3)."""
        return added([(1, partial) for partial in self.partial_lagrangians])

    @cached_property
    def energies(self) -> Energies:
        """The kinetic and the potential energy in L."""
        if self.body_terms is None:
            return energies(self.lagrangian, self.qd)
        kinetic, potential = split_by_motion(self.lagrangian, self.qd)
        return Energies(kinetic, potential, kinetic, "the kinetic energy of the bodies")

    @property
    def kinetic(self) -> Node:
        """L + P: the kinetic energy, and terms of L that are in neither energy, such as those linear in velocities."""
        return self.energies.without_potential

    @property
    def potential(self) -> Node:
        """P, the potential energy: L = kinetic - potential."""
        return self.energies.potential

    @cached_property
    def shortened(self) -> System | None:
        """The system with K, P and the forces written anew by identities such as sin^2 + cos^2 = 1; None where as long.

        P, whose sums could lose digits that a product of differences keeps, only where it then depends on less.
        """
        moving, still = split_by_motion(self.lagrangian, self.qd)
        kinetic, potential, forces = (_shared.shortened(part) for part in ([moving], [still], self.forces))
        if [*kinetic, *potential, *forces] == [moving, still, *self.forces]:
            return None
        given = {"partial_lagrangians": (kinetic[0], -potential[0]), "forces": tuple(forces)}
        return self.changed(**given, extra_inputs=self.extra_inputs, shortened=None)

    @cached_property
    def without_constraints(self) -> System:
        """The system without what holds it."""
        free = Constraints(self.kinematics, self.t, self.parameters, None, None)
        return self.changed(constraints=free, extra_inputs=self.extra_inputs)

    def changed(self, **given: object) -> System:
        """A copy with these attributes in place of its own; what follows from attributes is derived anew."""
        other = copy(self)
        vars(other).update(given)
        return other

    @property
    def surely_regular(self) -> bool:
        """Whether M is known to be positive definite; where it is not, `forward_dynamics` looks at its rank."""
        return self.body_terms is not None and self.body_terms.surely_regular

    def mass_matrix(self, lagrangian: Node, build: Builder | None = None) -> list[list[Node]]:
        """The lower triangle of M, the Hessian of L by the velocities; of bodies by their composites where smaller.

        lagrangian: L, folded where other nodes are.
        """
        if self.body_terms is None:
            return extend.hessian_nodes(lagrangian, self.qd, build)
        return self.body_terms.equations.mass_matrix(self.q, self.qd, lagrangian, build or Builder())

    @property
    def damping_rows(self) -> list[list[float | Node]]:
        """The rows of D."""
        if self.n and isinstance(self.damping[0], tuple):
            return [list(row) for row in self.damping]
        return [[each if i == k else 0.0 for k in range(self.n)] for i, each in enumerate(self.damping)]

    def braking(self, build: Builder, velocities: Sequence[Node] | None = None) -> list[Node]:
        """The force that damping takes, D qd."""
        qd = self.qd if velocities is None else velocities
        with building(build), cg.tag("damping"):
            if not (self.n and isinstance(self.damping[0], tuple)):
                return [damping * each for damping, each in zip(self.damping, qd, strict=True)]
            rows = [[each if isinstance(each, Node) else cg.constant(each) for each in row] for row in self.damping]
            return [dot(row, qd) for row in rows]

    def graph(self, outputs: Mapping[str, Node], *state: Sequence[Node]) -> Graph:
        """A graph over state variables, then t if needed, then the parameters."""
        parts = [require_sequence("state", part, "variables") for part in state]
        return Graph([node for part in parts for node in part] + self.extra_inputs, outputs)

    def _repr_html_(self) -> str | None:
        """The equations that a notebook shows as formulas, when a drawing package is installed (extra `viz`)."""
        return _shared.render_html("model", self)

    def __repr__(self) -> str:
        parameters = f", parameters {', '.join(self.parameters)}" if self.parameters else ""
        return f"<System of {self.nq} coordinate(s) {', '.join(self.coordinates[:6])}{parameters}>"


def generalized_forces(what: str, function: Callable[..., object], system: System, p: Parameters) -> list[Node]:
    """Forces of a function of (q, qd, t) or (q, qd, t, p), a node for each velocity. Raises what is wrong with it."""
    given = call_user_function(what, function, system.q, system.qd, system.t, p)
    return one_for_each(what, given, system.velocities, "the force on")
