"""Accelerations: M qdd = tau + forces - D qd - bias solved on the graph, by elimination or by a dense factorization.

And solving with M for any number of right-hand sides by one factorization.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Order, rounding_spread
from cgraph.extend import OPS, Builder, SingularError, building, cotangents, folded, topological

from ...systems.constraints import ConstraintError
from ...systems.kinematics import ONE, ZERO
from ...systems.system import System
from ..bias_terms import BiasTerms, bias_terms
from ..constraints.constraints import constraint_rows, multiplier_outputs, unknown_names
from ..equation import mirrored
from .singular_mass_matrix import TORQUE, SingularMassMatrixError, coordinate_sizes, no_inertia, require_inertia

DENSE_UP_TO = 7  # coordinates; beyond, the dense graph is larger on a tree of bodies, and takes long to build
WORTH = 0.9  # of the recursive graph's nodes, at most, for the dense one: elimination keeps more digits
BY_ENERGY = "dense by energy"  # with the Hessian of L, also where bodies give an M of fewer nodes
TURN = 10  # products that a sine takes as long as, about
DRAWN = 64  # states at which accelerations are looked at for their size
LITTLE = 0.01  # of the torques by which bodies are accelerated as by their weight
GROWTH = 3.0  # times the rounding of the safest graph, at most, at sample points


def accelerations(system: System, method: str = "auto", check: bool = False) -> Graph:
    """Forward dynamics from the Lagrangian as it is written, by one of `SOLUTIONS` or `BY_ENERGY`.

    Raises SingularMassMatrixError, see `forward_dynamics`.
    """
    constrained = bool(len(system.constraints))
    short = system.n <= DENSE_UP_TO and not (constrained and check)
    methods = [method] if method != "auto" else ["recursive", "dense"] if short else ["recursive"]
    terms = bias_terms(system)
    ways = [(system, terms, each) for each in methods]
    if (whole := system.whole) is not None:
        ways.insert(0, (whole, bias_terms(whole), methods[0]))
    graphs: list[Graph] = []  # the safest first
    written: list[Graph] = []  # these before they were simplified
    for form, given, each in ways:  # the dense matrix may lose in its entries what elimination keeps
        if graphs and each == "dense":  # what both need of a potential of many terms may be too much already
            merged = _cost(written[-1].nodes) - _cost(graphs[-1].nodes)
            if _cost(topological(given.gradient)) - merged >= WORTH * _cost(graphs[-1].nodes):
                break
        try:
            written.append(_solved(form, given, each, check))
            graphs.append(cg.simplify(written[-1]))
        except SingularError as error:
            failure = error
    if not graphs and failure.index >= system.n:
        raise ConstraintError(
            f"the constraints are singular: {unknown_names(system)[failure.index]} does nothing, or holds a direction "
            "without inertia"
        ) from None
    if not graphs:
        raise SingularMassMatrixError(no_inertia(system, failure)) from None
    chosen = _smallest(system, graphs, WORTH if methods[-1] == "dense" else 1.0)
    if system.surely_regular:
        return chosen
    free, graph = system, chosen
    if constrained:
        # a coordinate whose inertia is the constant zero may leave with a constraint; one that is rounding must not
        free = system.without_constraints
        try:
            graph = cg.simplify(_solved(free, bias_terms(free), "recursive", check=False))
        except SingularError:
            return chosen
    require_inertia(free, graph)
    return chosen


def _smallest(system: System, graphs: Sequence[Graph], worth: float) -> Graph:
    """Smallest of graphs, the safest first, whose roundings carry little further than those of the first.

    They are compared in motion and at rest: where masses differ by decades, speeds and torques can hide the digits that
    are lost of the accelerations by weight alone.
    worth: of the nodes of the one before, at most, for the last.
    """
    chosen, limits = graphs[0], None
    for graph in graphs[1:]:
        limit = worth if graph is graphs[-1] else 1.0
        if _cost(graph.nodes) >= limit * _cost(chosen.nodes):
            continue
        moving = _sizes(system, graphs[0])
        torques = {f"tau{i}": LITTLE * moving.get(f"tau{i}", 1.0) for i in range(system.n)}
        # in motion, and at rest with little torque, where weight counts if any
        regimes = moving, moving | {f"qd{i}": 0.0 for i in range(system.n)} | torques
        limits = limits or [GROWTH * rounding_spread(graphs[0], system.parameters, sizes) for sizes in regimes]
        pairs = zip(regimes, limits, strict=True)
        if all(rounding_spread(graph, system.parameters, sizes) <= most for sizes, most in pairs):
            chosen = graph
    return chosen


def _sizes(system: System, accelerations: Graph) -> dict[str, float]:
    """Sizes of states, torques and accelerations of bodies, which change with the units of mass, length and time.

    With A, the acceleration at rest, and the length L that an angle of 1 moves bodies by, speeds are sqrt(A L), and
    torques accelerate by A. Of a Lagrangian alone units are unknown: all is of size 1.
    """
    if system.body_terms is None:
        return {}
    ways = [length or 1.0 for length in system.lengths]  # m of a unit
    longest = next((length for length in ways if length != 1.0), 1.0)
    of_q, of_u = coordinate_sizes(system), np.array(ways[system.nq :])
    rng = np.random.default_rng(0)
    at: dict[str, Any] = dict.fromkeys(accelerations.input_names, 0.0) | dict(system.parameters)
    at |= {f"q{i}": size * rng.normal(size=DRAWN) for i, size in enumerate(of_q)}

    def largest(force: float) -> float:
        """Acceleration [m/s^2] by a force [N] along all velocities, the largest of them, in the median over states."""
        with np.errstate(all="ignore"):
            values = accelerations.evaluate(at | {f"tau{i}": force * way for i, way in enumerate(of_u)})
            rows = [np.broadcast_to(np.abs(values[f"qdd{i}"] * way), DRAWN) for i, way in enumerate(of_u)]
            return float(np.median(np.max(rows, axis=0)))

    falling, by_force = largest(0.0), largest(TORQUE) / TORQUE
    rate = falling if 0.0 < falling < np.inf else longest
    force = rate / by_force if 0.0 < by_force < np.inf else 1.0
    sizes: dict[str, float] = {f"q{i}": size for i, size in enumerate(of_q)}
    for i, way in enumerate(of_u):
        sizes |= {f"qd{i}": np.sqrt(rate * longest) / way, f"tau{i}": force * way, f"qdd{i}": rate / way}
    others = [name for name in accelerations.outputs if name not in sizes]
    return sizes | dict.fromkeys(others, np.inf)  # multipliers, which have units of rows: they are not compared


def _cost(nodes: Sequence[Node]) -> int:
    """Nodes, with sines and cosines for what they take."""
    return len(nodes) + TURN * sum([node.op.name in ("sin", "cos") for node in nodes])


def _solved(system: System, terms: BiasTerms, method: str, check: bool) -> Graph:
    """M qdd - J^T lambda = tau + forces - D qd - bias, J qdd = -(dJ/dt) qd, solved by one method; not simplified."""
    build = Builder()
    rows = constraint_rows(system, terms.rates)
    with building(build):
        # What stands at the coordinates already. Elimination takes the inertial terms where they are, at their
        # velocity nodes, and carries them to the coordinates on its way; a dense solve needs the whole bias here.
        at_rest = terms.gradient if not method.startswith("dense") else [-force for force in terms.bias(system, build)]
        braking = system.braking(build)
        rhs = [
            tau + force - brake + applied
            for tau, force, brake, applied in zip(system.tau, at_rest, braking, terms.forces, strict=True)
        ]
        inertial = {velocity: -force for velocity, force in terms.inertial.items()}
        rhs += [-change for change in system.constraints.rate_changes(rows.rates, build)]
    if not method.startswith("dense"):
        order: Order = "balanced" if method == "balanced" else "recursive"
        solved = rows.solve(system, terms.lagrangian, rhs, build, at=inertial, check=check, order=order)
    else:
        of_bodies = method == "dense"
        solved = rows.solve_densely(system, terms.lagrangian, rhs, build, composites=of_bodies, check=check)
    end = system.n + len(rows.kept)
    outputs = {f"qdd{i}": node for i, node in enumerate(solved[: system.n])}
    outputs |= multiplier_outputs(system, rows, solved[system.n : end], build)
    outputs |= dict(zip(("info",), solved[end:], strict=False))
    return system.graph(outputs, system.q, system.qd, system.tau)


DENSE_PATH = 12  # coordinates from the world to a tip; a dense factorization loses digits with about their fourth power
SOLVE_WORTH = 0.8  # of the nodes by elimination, at most, for the dense one: elimination keeps more digits

Rows = Sequence[Sequence[Node]]
Solution = TypeVar("Solution")


class MassSolve(NamedTuple):
    """x with M x = b, of variables b: nodes linear in them.

    column: the nodes that depend on b, arguments first, which every right-hand side takes once more.
    """

    b: list[Node]
    x: list[Node]
    column: list[Node]

    def solutions(self, sides: Rows, build: Builder) -> list[list[Node]]:
        """x of each of the right-hand sides."""
        result = []
        with building(build) as labelled:
            for side in sides:
                new = dict(zip(self.b, side, strict=True))
                for node in self.column:
                    labelled(node.label)
                    new[node] = build(node.op, tuple([new.get(arg, arg) for arg in node.args]), node.label, node.name)
                result.append([new.get(node, node) for node in self.x])
        return result

    def size(self, sides: int) -> int:
        """Number of nodes of the solutions of so many right-hand sides, about."""
        return len(topological(self.x)) + sides * len(self.column)


def mass_solve(system: System, build: Builder, method: str) -> MassSolve:
    """Solution by elimination on the graph of L, "recursive", or by LDL^T of the matrix, "dense".

    With constraints M x - J^T y = b, J x = b beyond n.  Raises SingularError for an M that is singular at every state.
    """
    lagrangian, *rates = folded([system.lagrangian, *system.constraints.rates], build)
    rows = constraint_rows(system, rates)
    b = cg.variables([f"b{i}#" for i in range(system.n + len(rows.kept))])
    solve = rows.solve_densely if method == "dense" else rows.solve
    return linear(b, solve(system, lagrangian, b, build)[: system.n])


def smaller_solution(system: System, make: Callable[[str], Solution], size: Callable[[Solution], int]) -> Solution:
    """Solution that `make` makes by elimination, or densely where paths are short and that saves nodes."""
    eliminated = make("recursive")
    if longest_path(system.lagrangian, system.qd) > DENSE_PATH:
        return eliminated
    with suppress(SingularError, SingularMassMatrixError):  # which needs rows exchanged
        if size(dense := make("dense")) < SOLVE_WORTH * size(eliminated):
            return dense
    return eliminated


def inverse(solve: MassSolve, build: Builder) -> list[list[Node]]:
    """Rows of M^-1: of the symmetric entries those with fewer operations, where the column is of a later coordinate."""
    return mirrored(solve.solutions(units(len(solve.x), len(solve.b)), build))


def units(count: int, length: int) -> list[list[Node]]:
    """The first unit vectors of this length."""
    return [[ONE if i == j else ZERO for i in range(length)] for j in range(count)]


def longest_path(lagrangian: Node, velocities: Sequence[Node]) -> int:
    """The most velocities that come before one and move with it, itself among them: entries in a lower row of M."""
    momenta = cotangents({lagrangian: ONE}, velocities)
    moving = [set(topological([p])) for p in momenta]
    return max([sum([u in moving[i] for u in velocities[: i + 1]]) for i in range(len(velocities))])


def linear(b: list[Node], x: list[Node]) -> MassSolve:
    """Solution of nodes x that are linear in b; a divisor of a column multiplies it, once inverted for all."""
    moving, column = set(b), []
    new: dict[Node, Node] = {}
    inverses: dict[Node, Node] = {}
    for node in topological(x):
        if not any([arg in moving for arg in node.args]):
            continue
        moving.add(node)
        args, op = tuple([new.get(arg, arg) for arg in node.args]), node.op
        if op is OPS["div"]:  # of numbers that are linear in b, by one that is not
            inverse = inverses.setdefault(args[1], Node(op, (ONE, args[1]), node.label))
            args, op = (args[0], inverse), OPS["mul"]
        new[node] = Node(op, args, node.label)
        column.append(new[node])
    return MassSolve(b, [new.get(node, node) for node in x], column)
