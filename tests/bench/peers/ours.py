"""Ours: the graph as machine code, and as generated NumPy over arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

import cgraph as cg
from cgraph import Compiled, Graph, Node
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Call, Program, runner
from dynamics.equations.linearization.linearization import LinearRows, linear_rows, linearize_many
from dynamics.equations.state_equation import state_equation
from dynamics.multibody.bodies.body import Body
from dynamics.multibody.trees.mechanism import Mechanism, as_mechanism
from dynamics.simulation.gradients.gradient import gradient
from dynamics.systems.model import Model
from tests.bench.peers.peer import DT, MOTIONS, PASSES, Peer, TimedTask, UnavailableError
from tests.bench.peers.task_graphs import carried, step_graph, task_graph


class Ours(Peer):
    """Our graph, compiled by LLVM: the calls `bind`, `run` and `batch`."""

    @kept_by_first
    def graph(self, task: str) -> Graph:
        """The graph of a task."""
        return task_graph(self.case, task)

    @cached_property
    def rows(self) -> LinearRows:
        """Derivatives of forward dynamics."""
        return linear_rows(self.case.system, "velocity")

    @kept_by_first
    def function(self, task: str) -> Compiled:
        """The graph of a task, compiled."""
        return cg.compile(self.graph(task))

    def prepare(self, task: str, mode: str) -> TimedTask:
        if task in MOTIONS:
            return self._motion() if task == "motion" else self._gradient(task)
        if task == "derivatives" and mode == "batch":
            return self._many()
        if task == "derivatives" and self.rows.wrt:
            return self._jacobian()
        graph, points = self.graph(task), self.case.points(task)
        size = len(graph.nodes)
        if mode == "loop":
            step = Call(carried(self.case, task, graph), ("x",), ("x",))
            ready, x = runner(Program({"x": len(graph.inputs)}, [step], ["x"])), self.case.point(task)
            memory = ready.memory({"x": x})
            return TimedTask(lambda: ready.run(memory.copy(), PASSES, PASSES).rows, lambda rows: rows[-1], size)
        function = self.function(task)
        if mode == "batch":
            return TimedTask(lambda: function.batch(points), np.asarray, size)
        y = np.empty(function.n_out)
        return TimedTask(function.bind(self.case.point(task), y), lambda _: y.copy(), size)

    def _jacobian(self) -> TimedTask:
        """Derivatives of a large model by `bind_jacobian`, of sums of rows or of forward dynamics by displacements."""
        function, wrt, n = cg.compile(self.case.bound(self.rows.graph)), self.rows.wrt, self.case.n
        point = self.case.point("derivatives")
        x, found = np.zeros(function.n_in), np.empty((function.n_out, len(wrt)))
        x[: len(point)] = point
        run, rows = function.bind_jacobian(x, found, wrt=wrt), found.T if self.rows.turned else found
        return TimedTask(run, lambda _: rows[-n:].ravel(), len(function.graph.nodes))

    def _many(self) -> TimedTask:
        """Derivatives at the states of a batch, rows of it, as anybody calls them."""
        case = self.case
        x = np.ascontiguousarray(case.points("derivatives").T)
        states = np.split(x, [case.nq, case.nq + case.n], axis=1)
        size = len(self.rows.graph.nodes)
        return TimedTask(lambda: linearize_many(case.model, *states), lambda found: _slopes(*found), size)

    def _motion(self) -> TimedTask:
        """The steps as one program, which is fed a row of torques a step."""
        step = step_graph(self.case.bound(state_equation(self.case.model)))
        x, n = self.case.point("motion"), self.case.n
        registers = {"x": 2 * n, "tau": n}
        run = runner(Program(registers, [Call(step, ("x", "tau"), ("x",))], record=["x"], feed=["tau"]))
        start, rows = x[: 2 * n], x[2 * n :].reshape(PASSES, n)
        return TimedTask(
            lambda: run.run(run.memory({"x": start}), PASSES, PASSES, rows), lambda y: y.rows[0], len(step.nodes)
        )

    def _gradient(self, task: str) -> TimedTask:
        case, n = self.case, self.case.n
        model: Model = case.model
        numbers: dict[str, float] = {}
        if task == "inertial-gradient":
            if (mechanism := as_mechanism(model)) is None:
                raise UnavailableError("the model has no bodies")
            model, numbers = with_inertial_parameters(mechanism)
        q, qd, tau = np.split(case.point(task), [n, 2 * n])
        rows, end, wrt = tau.reshape(PASSES, n), PASSES * DT, ["q", "qd", "tau", *numbers]
        return TimedTask(
            lambda: gradient(model, _square, q, qd, end, "rk4", tau=rows, wrt=wrt, estimate_error=False),
            lambda found: np.concatenate([np.ravel(found[name]) for name in wrt]),
        )


def _square(q: Sequence[Node], qd: Sequence[Node], t: Node) -> Node:
    return sum([x * x for x in q], start=cg.constant(0.0))


def _slopes(a: Array, b: Array) -> Array:
    n = b.shape[2]
    return np.concatenate([a, b], axis=2)[:, n:].reshape(len(a), -1).T


class OurNumpy(Peer):
    """Our graph as generated NumPy over arrays: what there is without llvmlite. For batches."""

    def prepare(self, task: str, mode: str) -> TimedTask:
        function, points = cg.compile(task_graph(self.case, task), backend="numpy"), self.case.points(task)
        return TimedTask(lambda: function.batch(points), np.asarray, len(function.graph.nodes))


def with_inertial_parameters(mechanism: Mechanism) -> tuple[Mechanism, dict[str, float]]:
    """The mechanism with ten parameters for each body with mass, and {name: value} of them; it has none yet."""
    bodies: list[Body] = []
    numbers: dict[str, float] = {}
    for k, body in enumerate(mechanism.bodies):
        inertia = np.asarray(body.inertia, dtype=np.float64)
        matrix = np.diag(inertia) if inertia.ndim == 1 else inertia
        if not body.mass and not matrix.any():  # a frame
            bodies.append(body)
            continue
        center = {f"center{k}_{i}": float(value) for i, value in enumerate(np.asarray(body.center, dtype=np.float64))}
        entries = {f"inertia{k}_{i}{j}": float(matrix[i, j]) for i in range(3) for j in range(i, 3)}
        rows = [[f"inertia{k}_{min(i, j)}{max(i, j)}" for j in range(3)] for i in range(3)]
        numbers |= {f"mass{k}": float(np.asarray(body.mass)), **center, **entries}
        bodies.append(replace(body, mass=f"mass{k}", center=tuple(center), inertia=rows))
    return replace(mechanism, bodies=bodies, parameters=numbers), numbers
