"""Torque tables, by link and by joint motion: graphs, numbers at a state, and both as text, Markdown and LaTeX."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, html_table, require_whole
from cgraph.extend import Builder, Names, building, folded, topological

from ...systems.model import Model, as_system, display_names
from ...systems.system import System
from ..equation import documented, mirrored
from ..equations_of_motion import bias, coriolis_matrix, gravity_force, require_quadratic
from ..formulations.lagrange_terms import lagrange_sweeps
from ..states.evaluate import evaluate

STRUCTURAL_ZERO = "·"  # a cell that is zero by structure, at every state
_ENERGIES = {"kinetic", "potential"}  # tags that name no body
LONGEST_EXPRESSION = 40  # characters of a cell that is written out, with q0 for the coordinate's name


@dataclass(frozen=True, eq=False)
class TorqueTable:
    """Torques [N m or N] in named rows and columns, which add up to tau.

    Attributes
    ----------
    title : str
    rows, columns : tuple of str
        Their names: links or coordinates, and damping, applied forces, gravity.
    system : System
        The one it was made from.
    graph : Graph
        One output for each cell, row by row, to be drawn, compiled or differentiated.
    sum_axis : int
        0 where columns add up to tau, 1 where rows do.
    values : ndarray, (rows, columns), or None
        Numbers at a state, where `at` has put them.

    Examples
    --------
    >>> import dynamics as dyn
    >>> table = dyn.torque_by_link(dyn.planar_arm(masses=[3.0], lengths=[2.0], gravity=10.0))
    >>> print(table)
                                             joint 1
    link 1  4 * qdd.joint 1 - (-30 * sin(q.joint 1))
    >>> table.at([0.0], qdd=[2.0]).total
    array([8.])
    """

    title: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    system: System
    graph: Graph
    sum_axis: int
    values: Array | None = None

    @property
    def zeros(self) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
        """(rows, columns), True where a cell is zero by structure, at every state."""
        flat = [node.value == 0.0 for node in self.graph.outputs.values()]
        return np.array(flat).reshape(len(self.rows), len(self.columns))

    @property
    def total(self) -> Array:
        """tau, the sum of the cells.

        Returns
        -------
        ndarray, (n,)

        Raises
        ------
        ValueError
            For a table without a state.
        """
        if self.values is None:
            raise ValueError("the table has no state, and so no numbers; give it one by at(q, qd, qdd)")
        total: Array = self.values.sum(axis=self.sum_axis)
        return total

    def at(
        self,
        q: ArrayLike,
        qd: ArrayLike | None = None,
        qdd: ArrayLike | None = None,
        *,
        t: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> TorqueTable:
        """The table with its numbers at a state.

        Parameters
        ----------
        q, qd, qdd : array_like, (n,)
            Coordinates [rad or m], velocities and accelerations; None is zero.
        t : float
            Time [s], for a model that depends on it.
        parameters : mapping of str to float
            Values in place of the model's.

        Returns
        -------
        TorqueTable

        Raises
        ------
        ValueError
            For another shape, a number that is not finite, an unknown parameter, or a formulation with the Euler
            relation, whose inputs are the state before the step: such a table has `graph`.
        """
        own = {*self.system.q, *self.system.qd, *self.system.qdd, *self.system.extra_inputs}
        if other := [node.name for node in self.graph.inputs if node not in own]:
            raise ValueError(
                f"the table's inputs are the state before the step, such as {other[0]}, not q, qd and qdd: evaluate "
                "its graph"
            )
        flat = evaluate(self.system, self.graph, {"q": q, "qd": qd, "qdd": qdd}, t, parameters)
        if flat.ndim != 1:
            raise ValueError(f"a table has one state, q, qd and qdd of the shape ({self.system.n},)")
        return replace(self, values=flat.reshape(len(self.rows), len(self.columns)))

    def to_text(self, digits: int = 4) -> str:
        """The table in columns of text, with the sum tau; without a state, expressions or their sizes."""
        rows = self._cells(digits)
        first, *widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [[head.ljust(first), *map(str.rjust, cells, widths)] for head, *cells in rows]
        return "".join([f"{'  '.join(line).rstrip()}\n" for line in lines])

    def __str__(self) -> str:
        return self.to_text().rstrip("\n")

    def _repr_html_(self) -> str:
        head, *rows = self._cells(4)
        return html_table(head, rows, title=self.title)

    def to_markdown(self, digits: int = 4) -> str:
        """Markdown of the table."""
        head, *body = [[cell.replace("|", "\\|") for cell in row] for row in self._cells(digits)]
        ruled = [head, ["---", *["---:"] * (len(head) - 1)], *body]
        return "".join(f"| {' | '.join(row)} |\n" for row in ruled)

    def to_latex(self, digits: int = 4) -> str:
        """LaTeX of the table, a `tabular` that needs no package."""
        head, *body = [" & ".join(map(_latex, row)) + r" \\" for row in self._cells(digits)]
        columns = "l" + "r" * len(self._cells(digits)[0][1:])
        lines = [rf"\begin{{tabular}}{{{columns}}}", r"\hline", head, r"\hline", *body, r"\hline", r"\end{tabular}"]
        return "\n".join(lines) + "\n"

    def _cells(self, digits: int) -> list[list[str]]:
        require_whole("digits", digits, 1)
        head, width = ["", *self.columns], len(self.columns)
        if self.values is None:
            names, called = Names(self.graph), display_names(self.system)
            cells = [self._expression(names, called, node) for node in self.graph.outputs.values()]
        else:
            pairs = zip(self.zeros.flat, self.values.flat, strict=True)
            cells = [STRUCTURAL_ZERO if zero else f"{value:.{digits}g}" for zero, value in pairs]
        rows = [[name, *cells[i * width : (i + 1) * width]] for i, name in enumerate(self.rows)]
        if self.values is not None:
            sums = [f"{torque:.{digits}g}" for torque in self.total]
            if self.sum_axis == 0:
                rows.append(["tau", *sums])
            else:
                head.append("tau")
                rows = [[*row, total] for row, total in zip(rows, sums, strict=True)]
        return [head, *rows]

    def _expression(self, names: Names, called: Mapping[str, str], node: Node) -> str:
        """A cell written out, coordinates by name, or the number of its operations where that would be too long."""
        if node.value == 0.0:
            return STRUCTURAL_ZERO
        text = names.text(node, LONGEST_EXPRESSION)
        if "%" in text:  # it refers to a line of the listing
            return f"{len([part for part in topological([node]) if part.args])} operations"
        return re.sub(r"\b(q|qd|qdd)\d+\b", lambda match: called[match[0]], text)


def _latex(cell: str) -> str:
    if number := re.fullmatch(r"(-?[\d.]+)(?:e([+-]\d+))?", cell):
        power = rf" \cdot 10^{{{int(number[2])}}}" if number[2] else ""
        return f"${number[1]}{power}$"
    if cell in (STRUCTURAL_ZERO, "tau"):
        return {STRUCTURAL_ZERO: r"$\cdot$", "tau": r"$\tau$"}[cell]
    return re.sub(r"([&%$#_{}])", r"\\\1", cell.replace("\\", r"\textbackslash ").replace("^", r"\^{}"))


@documented
def torque_by_link(model: Model) -> TorqueTable:
    """Row k, column i: what the partial Lagrangian L_k has of tau_i, d/dt dL_k/dqd_i - dL_k/dq_i.

    The paper's Section 4.3 (Kusaka and Tanaka): since L = sum of L_k, the rows add up to tau. Rows of damping and of
    applied forces follow, where the model has them. A link that a joint does not carry has no share of its torque,
    whatever the state: such cells are zero by structure. Of a mechanism written with base parameters
    (`base_parameters`) a row is not what its body alone takes.

    Returns
    -------
    TorqueTable
        (links and what follows, n) torques [N m or N]; columns add up to tau.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0], gravity=10.0)
    >>> print(dyn.torque_by_link(arm).at([1.5707963267948966, 0.0]))  # held straight out
            joint 1  joint 2
    link 1        5        ·
    link 2       15        5
    tau          20        5
    """
    system = as_system(model)
    build = Builder()
    rows = []
    for partial in folded(system.partial_lagrangians, Builder()):
        _, rate, gradient = lagrange_sweeps(system, partial, build, system.qdd)  # Lagrange's equation by the chain rule
        with building(build):
            rows.append([p_dot - slope for p_dot, slope in zip(rate, gradient, strict=True)])
    names = names_of_partials(system)
    outside = _damping_and_forces(system, build)
    rows += outside.values()
    outputs = {f"tau{i}_{k}": entry for k, row in enumerate(rows) for i, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))
    return TorqueTable("torque by link", (*names, *outside), system.velocities, system, graph, sum_axis=0)


@documented
def torque_by_joint_motion(model: Model) -> TorqueTable:
    """Row i, column j: the torque at joint i for the motion of joint j, M_ij qdd_j + C_ij qd_j.

    C is that of Christoffel's symbols (`coriolis`): of a Coriolis force, which two velocities make together, each has
    half. Columns of gravity (all that is there at rest), damping and applied forces follow, where the model has them.

    Returns
    -------
    TorqueTable
        (n, n and what follows) torques [N m or N]; rows add up to tau.

    Raises
    ------
    ValueError
        For an L that is not quadratic in the velocities.

    Examples
    --------
    >>> import dynamics as dyn
    >>> slider = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2), ["r", "theta"])
    >>> print(dyn.torque_by_joint_motion(slider).at([2.0, 0.0], [3.0, 5.0], [1.0, 1.0]))
            r  theta  tau
    r       1    -50  -49
    theta  30     34   64
    """
    system = as_system(model)
    require_quadratic(system)
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], Builder())
    mass = system.mass_matrix(lagrangian, build)  # its lower triangle
    forces = folded(bias(system).outputs.values(), build)
    coriolis = coriolis_matrix(system, forces, build, mass)
    n = system.n
    with building(build):
        pairs = zip(mirrored(mass), coriolis, strict=True)
        rows = [[m[j] * system.qdd[j] + c[j] * system.qd[j] for j in range(n)] for m, c in pairs]
    outside = {"gravity": folded(gravity_force(system).outputs.values(), build)} | _damping_and_forces(system, build)
    columns = {name: column for name, column in outside.items() if any(entry.value != 0.0 for entry in column)}
    for column in columns.values():
        rows = [[*row, entry] for row, entry in zip(rows, column, strict=True)]
    names = [*system.velocities, *columns]
    outputs = {f"tau{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))
    return TorqueTable("torque by joint motion", system.velocities, tuple(names), system, graph, sum_axis=1)


def _damping_and_forces(system: System, build: Builder) -> dict[str, list[Node]]:
    """Torques against damping and against applied forces, each where there is any."""
    damping = system.braking(build)
    with building(build):
        applied = [-force for force in folded(system.forces, build)]
    rows = {"damping": damping, "applied": applied}
    return {name: row for name, row in rows.items() if any(entry.value != 0.0 for entry in row)}


def names_of_partials(system: System) -> list[str]:
    """Names of the partial Lagrangians: their one tag, as a link's or a body's; else L1, L2, ..."""
    tags = [partial.tags - _ENERGIES for partial in system.partial_lagrangians]
    names = [next(iter(each)) if len(each) == 1 else "" for each in tags]
    unique = all(names) and len(set(names)) == len(names)
    return names if unique else [f"L{k + 1}" for k in range(len(names))]
