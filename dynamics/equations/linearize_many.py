"""Linearization at many states, in machine code: written out, or with one piece of code for all columns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph.extend import Call, Map, Program, runner, share, thread_count

from ..systems.model import Model, as_system
from ..systems.system import System
from .evaluate_at import Array, input_values
from .linearization_parts import ColumnGraphs, LinearizationParts, assembled, linearization_parts

# Nodes; beyond, the columns share one piece of code, which LLVM is done with in a tenth of the time.
WRITTEN_OUT = 20_000
BLOCK = 64  # states that are run between looks at the keyboard, and that a thread takes at a time
_functions: WeakKeyDictionary[System, _Function] = WeakKeyDictionary()


def linearize_many(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
    threads: int | None = 1,
) -> tuple[Array, Array]:
    """`linearize` at N states, such as those of a horizon: machine code, made at the first call and kept.

    Of small systems all entries are written out, and states lie side by side in vectors. Of others, what the state
    alone decides, the slopes of `inverse_dynamics_derivatives` and the factorization of M, is one piece of code and a
    column of A and B another, through which all columns of a state run side by side. The matrices of a state whose mass
    matrix is singular, or with a quaternion of length 0, have entries that are infinite or NaN.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n velocities.
    q, qd, tau : array_like, (N, nq) and (N, n)
        Coordinates [rad or m], their velocities, and applied forces [N m or N]; one row is the same for all.
    t : float
        Time [s], for a model that depends on it.
    parameters : mapping of str to float
        Values in place of the model's.
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
    function = _function(system)
    values, shape = input_values(system, function.names, {"q": q, "qd": qd, "tau": tau}, t, parameters)
    if len(shape) != 1:
        raise ValueError("linearize_many takes rows of states, got one state; see linearize")
    given = [np.broadcast_to(np.asarray(values[name], dtype=np.float64), shape) for name in function.names]
    return function(np.array(given).reshape(len(given), *shape), thread_count(threads))


class _Function(ABC):
    """A, (N, 2n, 2n), and B, (N, 2n, n), of values, (n_in, N), of the inputs of those names."""

    names: Sequence[str]

    @abstractmethod
    def __call__(self, values: Array, threads: int) -> tuple[Array, Array]: ...


class _WrittenOut(_Function):
    """All entries in one graph, N states side by side in vectors."""

    def __init__(self, parts: LinearizationParts) -> None:
        graph, self.n = parts.written_out(), len(parts.brackets)
        self.names, self.compiled = graph.input_names, cg.compile(graph)

    def __call__(self, values: Array, threads: int) -> tuple[Array, Array]:
        rows, n = self.compiled.batch(values, threads).T, self.n
        count, split = len(rows), 4 * n * n
        return rows[:, :split].reshape(count, 2 * n, 2 * n), rows[:, split:].reshape(count, 2 * n, n)


class _InColumns(_Function):
    """One state after another, its columns side by side in vectors."""

    def __init__(self, parts: LinearizationParts) -> None:
        graphs, self.n = parts.in_columns(), len(parts.brackets)
        self.names, self.run = graphs.shared.input_names, runner(linearization_program(graphs, self.n))

    def __call__(self, values: Array, threads: int) -> tuple[Array, Array]:
        rows = np.empty((values.shape[1], self.run.program.width))

        def block(start: int) -> None:
            memory = self.run.memory({})
            for k in range(start, min(start + BLOCK, len(rows))):
                self.run.write(memory, "state", values[:, k])
                rows[k] = self.run.run(memory, 1).rows[0]

        share(block, range(0, len(rows), BLOCK), threads)
        brackets, solutions = np.split(rows, [self.n**2], axis=-1)
        return assembled(brackets, solutions, self.n)


def _function(system: System) -> _Function:
    if system not in _functions:
        parts = linearization_parts(system)
        _functions[system] = (_WrittenOut if parts.size < WRITTEN_OUT else _InColumns)(parts)
    return _functions[system]


def linearization_program(graphs: ColumnGraphs, n: int) -> Program:
    """One pass linearizes at the register "state", and records C(qd), then row by row the n solutions of 3n columns."""
    b, x = graphs.column.input_names[graphs.factors :], [f"x{i}" for i in range(n)]
    registers = {"state": len(graphs.shared.inputs), "factors": graphs.factors, **dict.fromkeys([*b, *x], 3 * n)}
    first = Call(graphs.shared, ("state",), ("factors", *b, "brackets"))
    columns = Map(graphs.column, tuple(b), tuple(x), shared=("factors",))
    return Program(registers | {"brackets": n * n}, [first, columns], record=["brackets", *x])
