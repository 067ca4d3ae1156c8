"""Linearization at many states, in machine code: written out, or with one piece of code for all columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first, require_choice, share, thread_count
from cgraph.extend import Call, Map, Program, Statement, runner

from ...systems.kinematics import ONE, ZERO
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented
from ..equations_of_motion import forward_dynamics
from ..state_equation import FORMS
from ..states.evaluate import input_rows
from .linearization_parts import ColumnGraphs, LinearizationParts, linearization_parts
from .momentum_parts import momentum_parts

# Nodes; beyond, the columns share one piece of code: of 18 000 nodes, machine code is made in half the time and takes a
# third longer, of 200 000 in a fifth of the time, and takes no longer.
WRITTEN_OUT = 20_000
# Times as many, where else products of matrices would be left to NumPy: 83 000 nodes are made in 11 s, not 8, and take
# 19 us a state, not 91.
LONGER_TIMES = 5
FORWARD_SHARE = 3  # of the nodes of all entries, at most one in so many is forward dynamics
MATRICES = 1024  # states whose parts are in memory at a time, before they are matrices
BLOCK = 64  # states that are run between looks at the keyboard, and that a thread takes at a time


@documented
def linearize_many(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    form: str = "velocity",
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
    threads: int | None = 1,
) -> tuple[Array, Array]:
    """`linearize` at N states, such as those of a horizon: machine code, made at the first call and kept.

    Of small systems all entries are written out, and states lie side by side in vectors. Of larger ones, state after
    state, it is the Jacobian of the compiled `forward_dynamics`, whose columns run side by side through one piece of
    code; it keeps the digits of long chains, too, whatever the condition of M. With quasi-velocities or constraints,
    what the state alone decides, the slopes of `inverse_dynamics_derivatives` and the factorization of M, is one such
    piece, and a column of A and B another. The matrices of a state whose mass matrix is singular, or with a quaternion
    of length 0, have entries that are infinite or NaN.

    Of the momentum form, whose states are q and qd, too, all entries are written out, or of very large systems the
    products of M^-1 dp/dq are left to NumPy.

    Parameters
    ----------
    q, qd, tau : array_like, (N, nq) and (N, n)
        Coordinates [rad or m], their velocities, and applied forces [N m or N]; one row is the same for all.
    threads : int, optional
        How many share the states; None: one for each core.

    Returns
    -------
    A : ndarray, (N, 2n, 2n)
    B : ndarray, (N, 2n, n)

    Raises
    ------
    ValueError, SingularMassMatrixError
        As for `linearize`; for arrays that are all of one state; for a number of threads below 1.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0], gravity=10.0)
    >>> A, B = dyn.linearize_many(arm, [[0.0], [3.141592653589793]], [[0.0], [0.0]])
    >>> A[:, 1, 0].round(12).tolist(), B.shape
    ([-15.0, 15.0], (2, 2, 1))
    """
    system = as_system(model)
    inputs, write = _writer(system, require_choice("form", form, FORMS))
    count = thread_count(threads)
    values = input_rows(system, inputs, {"q": q, "qd": qd, "tau": tau}, t, parameters)
    if values.ndim != 2:
        raise ValueError("linearize_many takes rows of states, got one state; see linearize")
    n = system.n
    matrices = np.empty((len(values), 2 * n, 3 * n))
    write(values, matrices, count)
    return matrices[:, :, : 2 * n], matrices[:, :, 2 * n :]


Write = Callable[[Array, Array, int], None]  # rows (N, n_in) and a number of threads to (A B), (N, 2n, 3n)


@kept_by_first
def _writer(system: System, form: str) -> tuple[list[str], Write]:
    """The inputs, and machine code that writes A and B of many states."""
    inputs, write = _way(system) if form == "velocity" else _momentum_way(system)
    return [str(each.name) for each in inputs], write


def _way(system: System) -> tuple[Sequence[Node], Write]:
    """The inputs, and what writes: by entries where they are few, else by columns."""
    rates = system.kinematics.quasi is None and not len(system.constraints)
    if rates and len(forward_dynamics(system).nodes) >= WRITTEN_OUT // FORWARD_SHARE:
        return _by_jacobian(system)
    parts = linearization_parts(system)
    if parts.size < WRITTEN_OUT:
        return parts.inputs, _written_out(parts)
    return _by_jacobian(system) if rates else (parts.inputs, _in_columns(parts))


def _momentum_way(system: System) -> tuple[Sequence[Node], Write]:
    parts = momentum_parts(system)
    return parts.inputs, _written_out(parts) if parts.size < LONGER_TIMES * WRITTEN_OUT else _assembled(parts)


def _assembled(parts: LinearizationParts) -> Write:
    """X, M^-1 and the rest in machine code, and their products by NumPy."""
    graphs, n = parts.in_columns(), parts.n
    outputs = len(graphs.shared.outputs)
    registers = {"state": len(graphs.shared.inputs), "factors": graphs.factors}
    registers |= {f"{name}{i}": graphs.columns for name in ("b", "x") for i in range(n)}
    registers["rest"] = outputs - graphs.factors - graphs.sides
    sides, solutions = ([f"{name}{i}" for i in range(n)] for name in ("b", "x"))
    body: list[Statement] = [
        Call(graphs.shared, ("state",), ("factors", *sides, "rest")),
        Map(graphs.column, tuple(sides), tuple(solutions), shared=("factors",)),
    ]
    run = runner(Program(registers, body, record=[*sides, "rest", *solutions]))
    splits = [graphs.sides, outputs - graphs.factors]

    def write(values: Array, matrices: Array, threads: int) -> None:
        for k in range(0, len(values), MATRICES):
            rows = run.batch("state", values[k : k + MATRICES], threads)
            a, b = parts.assembled(*np.split(rows, splits, axis=-1))
            matrices[k : k + MATRICES, :, : 2 * n], matrices[k : k + MATRICES, :, 2 * n :] = a, b

    return write


def _written_out(parts: LinearizationParts) -> Write:
    """Rows that are the same at every state are no business of the machine code's."""
    graph, n = parts.written_out(), parts.n
    rows = [
        [graph.outputs[f"A_{i}_{j}" if j < 2 * n else f"B_{i}_{j - 2 * n}"] for j in range(3 * n)] for i in range(2 * n)
    ]
    first = next((i for i in range(n) if any([entry.value is None for entry in rows[i]])), n)
    same = np.array([[entry.value for entry in row] for row in rows[:first]]).reshape(first, 3 * n)
    outputs = {str(k): entry for k, entry in enumerate([entry for row in rows[first:] for entry in row])}
    compiled = cg.compile(Graph(graph.inputs, outputs))

    def write(values: Array, matrices: Array, threads: int) -> None:
        compiled.batch(values.T, threads, out=matrices.reshape(-1, 6 * n * n)[:, first * 3 * n :].T)
        matrices[:, :first] = same

    return write


def _by_jacobian(system: System) -> tuple[Sequence[Node], Write]:
    """States one after another, by the Jacobian of forward dynamics: of systems whose velocities are rates."""
    graph, n = forward_dynamics(system), system.n
    compiled, wrt = cg.compile(graph), [*system.q, *system.qd, *system.tau]
    entries = np.arange(3 * n * n).reshape(n, 3 * n)
    inverse = entries[:, 2 * n :]  # B is M^-1: of its entries the upper triangle counts
    entries[:, 2 * n :] = np.where(np.tri(n, dtype=bool), inverse.T, inverse)

    def write(values: Array, matrices: Array, threads: int) -> None:
        def block(start: int) -> None:
            x, slopes = np.empty(values.shape[1]), np.empty((n, 3 * n))
            run = compiled.bind_jacobian(x, slopes, wrt=wrt)
            for k in range(start, min(start + BLOCK, len(values))):
                x[:] = values[k]
                run()
                np.take(slopes, entries, out=matrices[k, n:], mode="clip")  # "raise" would copy first

        share(block, range(0, len(values), BLOCK), threads)
        matrices[:, :n] = np.eye(n, 3 * n, n)

    return graph.inputs, write


def _in_columns(parts: LinearizationParts) -> Write:
    n = parts.n
    program = linearization_program(parts.in_columns(), n)
    run, same = runner(program), 6 * n * n - program.width

    def write(values: Array, matrices: Array, threads: int) -> None:
        run.batch("state", values, threads, out=matrices.reshape(-1, 6 * n * n)[:, same:])
        if same:
            matrices[:, :n] = np.eye(n, 3 * n, n)

    return write


def linearization_program(graphs: ColumnGraphs, n: int) -> Program:
    """Program of which a pass linearizes at the register "state", and records (A B), (2n, 3n), row by row.

    Without the upper half, (0 1 0), where velocities are rates of coordinates. Columns by tau are for themselves: of
    their solutions the upper triangle counts, so that they are symmetric to the last bit.
    """
    outputs, factors = list(graphs.shared.outputs.values()), graphs.factors
    k, brackets = len(graphs.column.inputs) - factors, outputs[len(outputs) - n * n :]
    by_state, by_tau = ([f"{name}{i}" for i in range(k)] for name in ("b", "e"))
    slopes, inverse, symmetric = ([f"{name}{i}" for i in range(n)] for name in ("A", "x", "B"))
    registers = {"state": len(graphs.shared.inputs), "factors": factors, "brackets": n * n}
    registers |= dict.fromkeys([*by_state, *slopes], 2 * n) | dict.fromkeys([*by_tau, *inverse, *symmetric], n)
    sides = [each for pair in zip(by_state, by_tau, strict=True) for each in pair]
    body: list[Statement] = [
        Call(graphs.shared, ("state",), ("factors", *sides, "brackets")),
        Map(graphs.column, tuple(by_state), tuple(slopes), shared=("factors",)),
        Map(graphs.column, tuple(by_tau), tuple(inverse), shared=("factors",)),
        Call(_symmetric(n), tuple(inverse), tuple(symmetric)),
    ]
    record = [each for pair in zip(slopes, symmetric, strict=True) for each in pair]
    if any([entry.value != 0.0 for entry in brackets]):
        body.append(Call(_upper(n), ("brackets",), ("upper",)))
        registers["upper"] = 3 * n * n
        record = ["upper", *record]
    return Program(registers, body, record=record)


def _symmetric(n: int) -> Graph:
    """The matrix, (n, n), whose upper triangle is that of another."""
    x = cg.variables([f"x_{i}_{j}" for i in range(n) for j in range(n)])
    return Graph(x, {f"B_{i}_{j}": x[min(i, j) * n + max(i, j)] for i in range(n) for j in range(n)})


def _upper(n: int) -> Graph:
    """The upper half of (A B), (C(qd) 1 0)."""
    c = cg.variables([f"C_{i}_{j}" for i in range(n) for j in range(n)])
    rows = [[*c[i * n : i * n + n], *[ONE if i == j else ZERO for j in range(n)], *[ZERO] * n] for i in range(n)]
    return Graph(c, {str(k): entry for k, entry in enumerate([entry for row in rows for entry in row])})
