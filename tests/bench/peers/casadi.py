"""CasADi: its own derivatives of the same Lagrangian, or our finished graph; in its virtual machine or through gcc."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from cgraph import Graph, GraphError, to_casadi
from cgraph._shared import Array, kept_by_first
from dynamics.verification.residual import UnavailableError

from .peer import BATCH, DERIVATIVES, MOTIONS, NUDGE, PASSES, Peer, PeerModel, TimedTask, required, rk4_step
from .task_graphs import rate_graph, task_graph
from .translate import lagrangian, quasi_velocities

if TYPE_CHECKING:
    from casadi import Function

FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")
# Of our operations, where CasADi has another name.
NAMES = {"abs": "fabs", "minimum": "fmin", "maximum": "fmax", "where": "if_else"}


class CasadiPeer(Peer):
    """CasADi.  native: C code of it, compiled; else its virtual machine.  own_graph: its derivatives; else our graph.

    Its forward dynamics is an LDL^T of the mass matrix followed by its `cse`: fewer instructions than `casadi.solve`.
    """

    def __init__(self, case: PeerModel, native: bool = False, own_graph: bool = True) -> None:
        super().__init__(case)
        self.casadi, self.native = casadi(), native
        self.compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
        self._own_graph = own_graph

    @kept_by_first
    def function(self, task: str) -> Function:
        """The task, x -> y."""
        return self._lagrange(task) if self._own_graph else self._ours(task)

    def _lagrange(self, task: str) -> Function:
        ca, n = self.casadi, self.case.n
        if task == "rk4":
            return self._step(self.function("rate"))
        if task in DERIVATIVES:
            return self._slopes(task)
        if task in MOTIONS:
            return self._motion(task)
        q, qd, last = ca.SX.sym("q", self.case.nq), ca.SX.sym("qd", n), ca.SX.sym("last", n)
        energy, forces = lagrangian(self.case, ca.vertsplit(q), ca.vertsplit(qd), ca, NAMES, ca.SX)
        p, slope = ca.gradient(energy, qd), ca.gradient(energy, q)
        q_dot, taken = quasi_velocities(self.case, ca.vertsplit(q), ca.vertsplit(qd), ca.vertsplit(p), ca, NAMES, ca.SX)
        q_dot, slope = ca.vertcat(*q_dot), ca.jtimes(ca.vertcat(*q_dot), qd, slope, True)
        known = ca.vertcat(*forces) - ca.DM(list(self.case.system.damping)) * qd + slope - ca.vertcat(*taken)
        if task == "inverse":
            rate = ca.jtimes(p, ca.vertcat(q, qd), ca.vertcat(q_dot, last))
            y = rate - known
        else:
            diagonal, factor, order = ca.ldl(ca.jacobian(p, qd), False)
            y = ca.ldl_solve(last + known - ca.jtimes(p, q, q_dot), diagonal, factor, order)
        if task == "rate":
            x, y = ca.vertcat(q, qd), ca.vertcat(q_dot, ca.substitute(y, last, ca.SX.zeros(n)))
            return ca.Function(task, [x], [ca.cse(y)])
        return ca.Function(task, [ca.vertcat(q, qd, last)], [ca.cse(y)])

    def _slopes(self, task: str) -> Function:
        """The derivatives of a task, by CasADi's Jacobian; those by q along the velocities."""
        ca, nq, n = self.casadi, self.case.nq, self.case.n
        function = self.function(DERIVATIVES[task])
        x = ca.SX.sym("x", self.case.width(task))
        q, qd = ca.vertsplit(x[:nq]), ca.SX.sym("u", n)
        rates = quasi_velocities(self.case, q, ca.vertsplit(qd), q[:n], ca, NAMES, ca.SX)[0]
        along = ca.jacobian(ca.vertcat(*rates), qd)
        rows = ca.jacobian(function(x), x)
        rows = ca.horzcat(ca.mtimes(rows[:, :nq], along), rows[:, nq:])
        return ca.Function("slopes", [x], [ca.cse(ca.densify(ca.vec(rows.T)))])

    def _ours(self, task: str) -> Function:
        if task == "rk4":
            return self._step(self.function("rate"))
        graph = rate_graph(self.case) if task == "rate" else task_graph(self.case, task)
        return our_function(graph, task.replace("-", "_"))

    def _step(self, rate: Function) -> Function:
        ca = self.casadi
        state = ca.MX.sym("x", self.case.width("rk4"))
        after = rk4_step(rate, state)
        step = ca.Function("rk4", [state], [after])
        return step if self.native else step.expand()  # the virtual machine is faster on scalars; gcc inlines by itself

    def _motion(self, task: str) -> Function:
        """Steps of RK4 by `mapaccum`, a row of torques a step; or the gradient of |q|^2 after them, by its adjoint."""
        ca, n, width = self.casadi, self.case.n, self.case.width("rk4")
        y, state, force = ca.SX.sym("y", width + n), ca.MX.sym("state", width), ca.MX.sym("force", n)
        rate = ca.Function("rate", [y], [ca.vertcat(y[n:width], self.function("forward")(y))])
        after = rk4_step(lambda at: rate(ca.vertcat(at, force)), state)
        step = ca.Function("step", [state, force], [after])
        x = ca.MX.sym("x", self.case.width(task))
        steps = (step if self.native else step.expand()).mapaccum("steps", PASSES)
        end = steps(x[:width], ca.reshape(x[width:], n, PASSES))[:, -1]
        return ca.Function(task, [x], [end if task == "motion" else ca.gradient(ca.sumsqr(end[:n]), x)])

    def _pass(self, task: str) -> Function:
        function = self.function(task)
        if task == "rk4":
            return function
        x = self.casadi.MX.sym("x", self.case.width(task))
        moved = x + NUDGE * function(x)[self.case.nudges(task).tolist()]
        return self.casadi.Function("moved", [x], [moved])

    def prepare(self, task: str, mode: str) -> TimedTask:
        if self.native and self.compiler is None:
            raise UnavailableError("there is no C compiler")
        function, x = self.function(task), self.case.inputs(task, mode)
        size = function.n_instructions() if function.is_a("SXFunction") else None
        if mode == "loop":
            function = self._pass(task).fold(PASSES)
        elif mode == "batch":
            function, x = function.map(BATCH, "serial"), np.ascontiguousarray(x.T)
        if self.native:
            function = self._through_c(function)
        buffer, evaluate = function.buffer()  # calls on fixed memory
        y = np.empty(function.numel_out(0))
        buffer.set_arg(0, x.data)
        buffer.set_res(0, y.data)

        def result(_: object) -> Array:
            return y.reshape(-1, function.size1_out(0)).T.copy() if mode == "batch" else y.copy()

        held = (x, buffer)  # the buffer holds bare pointers

        def run() -> None:
            evaluate()
            _ = held

        return TimedTask(run, result, size)

    def _through_c(self, function: Function) -> Function:
        """The function compiled by the C compiler and loaded again. Raises UnavailableError when that fails."""
        assert self.compiler is not None
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # Windows keeps what is loaded
            code, library = Path(folder) / "code.c", Path(folder) / "code.so"
            generator = self.casadi.CodeGenerator(code.name)
            generator.add(function)
            generator.generate(f"{folder}{os.sep}")
            command = [self.compiler, *FLAGS, "-o", str(library), str(code), "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise UnavailableError(f"the C compiler failed: {done.stderr.strip()[-200:]}")
            return self.casadi.external(function.name(), str(library))


def our_function(graph: Graph, name: str) -> Function:
    """Our graph, node for node. Raises UnavailableError for an operation that CasADi does not have."""
    try:
        return to_casadi(graph, name)
    except GraphError as error:
        raise UnavailableError(str(error)) from None


def casadi() -> ModuleType:
    """The module. Raises ImportError naming the extra when it is not installed."""
    return required("casadi", "CasADi")
