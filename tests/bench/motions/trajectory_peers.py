"""Solvers of other software: SciPy, MuJoCo's integrators, heyoka's Taylor series, CVODES through CasADi."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.work_precision.measurement import EQUAL, LONGEST_RUN, Outcome, Run, Solver
from dynamics.integrators import Problem
from dynamics.systems.arguments import TIME
from dynamics.verification.residual import UnavailableError
from tests.bench.peers import PeerModel
from tests.bench.peers.casadi import casadi, our_function
from tests.bench.peers.heyoka import heyoka
from tests.bench.peers.mujoco import MujocoPeer, rollout
from tests.bench.peers.translate import translated

if TYPE_CHECKING:
    from casadi import DM, SX, Function
    from heyoka import expression, taylor_adaptive

EPSILON = 2.0**-52
COMPACT = 300  # nodes of the rate; beyond, heyoka's code written out takes minutes to compile
MOST_STEPS = 100_000  # steps of heyoka and of CVODES
MUJOCO = {"Euler": 1, "RK4": 4, "implicit": 1, "implicitfast": 1}  # with the orders of their errors
QUIET: dict[str, Any] = {"show_eval_warnings": False}
ADAMS = QUIET | {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
CVODES = {"BDF": QUIET, "Adams": ADAMS}


# How the names of peers' solvers begin.
OURS, HEYOKA, SCIPY = "ours", "heyoka", "scipy:"
PEERS = {"MuJoCo": "MuJoCo", "SciPy": SCIPY, HEYOKA: HEYOKA, "CasADi": "CVODES"}
ORDERS = {"Radau": 5, "BDF": None, "LSODA": None, "DOP853": 8, "RK45": 5}  # of SciPy's solvers
IMPLICIT = ("Radau", "BDF", "LSODA")


def group(name: str) -> str:
    """The peer that a solver of this name belongs to; ours for none."""
    return next((peer for peer, begin in PEERS.items() if name.startswith(begin)), OURS)


class EndSolver(Solver):
    """A way to compute the end of a task, whatever its length."""

    ours = False

    def until(self, t_end: float) -> EndSolver:
        """Run to another end, with what is compiled already."""
        other = copy.copy(self)
        other.task = replace(self.task, t_end=t_end)
        return other


class Scipy(EndSolver):
    """One of SciPy's solvers, by `solve_ivp`, on our compiled rate and Jacobian.

    Raises ImportError without SciPy.
    """

    tolerances = tuple([10.0**-k for k in range(3, 14)])  # it takes none smaller than 2e-14

    def __init__(self, solver: str, task: AccuracyTask, smallest: float, problem: Problem) -> None:
        from scipy.integrate import solve_ivp

        super().__init__(SCIPY + solver, task, smallest)
        self.solve, self.order, compiled = solve_ivp, ORDERS[solver], cg.compile(problem.rate)
        self.rate = lambda t, x: compiled([*x, t])
        self.options: dict[str, Any] = {"method": solver}
        if solver in IMPLICIT:
            self.options["jac"] = lambda t, x: compiled.jacobian([*x, t])[:, : problem.size]

    def ready(self, knob: float) -> Run:
        options = self.options | {"rtol": knob, "atol": self.absolute(knob)}

        def run() -> Any:
            late = time.perf_counter() + LONGEST_RUN

            def rate(t: float, x: Array) -> object:
                if time.perf_counter() > late:
                    raise RuntimeError(f"took longer than {LONGEST_RUN:g} s")
                return self.rate(t, x)

            return self.solve(rate, (0.0, self.task.t_end), self.start, **options)

        def read(found: Any) -> Outcome:
            status = "" if found.success else found.message
            return Outcome(found.y[:, -1], len(found.t) - 1, None, found.nfev, status)

        return Run(run, read=read)


class Mujoco(EndSolver):
    """One of MuJoCo's integrators in its own native loop (`rollout`), on the model's MJCF, contacts off."""

    kind = EQUAL

    def __init__(self, integrator: str, task: AccuracyTask, smallest: float) -> None:
        super().__init__(f"MuJoCo {integrator}", task, smallest)
        self.order = MUJOCO[integrator]
        if not task.mechanical:
            raise UnavailableError("takes rigid bodies, not a system of first order")
        self.peer = MujocoPeer(PeerModel(task.name, task.model))
        self.model = self.peer.twin.model
        self.model.opt.integrator = getattr(self.peer.mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        self.begin = self.peer.starts(self.start[None])

    def ready(self, knob: float) -> Run:
        states, run = self._states(int(knob))
        return Run(run, read=lambda _: Outcome(states[0, -1, self.peer.taken], int(knob)))

    def _states(self, steps: int) -> tuple[Array, Callable[[], object]]:
        states = np.empty((1, steps, self.begin.shape[1]))
        native = rollout(self.model, self.begin, states)

        def run() -> None:
            self.model.opt.timestep = self.task.t_end / steps  # shared by the runs of all steps
            native()

        return states, run


class Heyoka(EndSolver):
    """heyoka's adaptive Taylor series on our equations, node for node."""

    tolerances = (1e-4, 1e-7, 1e-10, 1e-12, EPSILON)  # each is compiled anew; the last is its default

    def __init__(self, task: AccuracyTask, smallest: float, problem: Problem) -> None:
        self.compact = len(problem.rate.nodes) > COMPACT
        super().__init__("heyoka Taylor", task, smallest)
        self.heyoka = heyoka()
        self.system = heyoka_equations(self.heyoka, problem)
        self._made: dict[float, taylor_adaptive] = {}

    def integrator(self, knob: float) -> taylor_adaptive:
        """Compiled for a tolerance, at the start."""
        if knob not in self._made:
            options = {} if knob == EPSILON else {"tol": knob}
            self._made[knob] = self.heyoka.taylor_adaptive(
                self.system, self.start.tolist(), compact_mode=self.compact, **options
            )
        integrator = self._made[knob]
        self._rewind(integrator)
        return integrator

    def _rewind(self, integrator: taylor_adaptive) -> None:
        integrator.time = 0.0
        integrator.state[:] = self.start

    def ready(self, knob: float) -> Run:
        integrator = self.integrator(knob)
        propagate, limit = integrator.propagate_until, self.heyoka.taylor_outcome.time_limit

        def read(found: tuple[Any, ...]) -> Outcome:
            status = "" if found[0] == limit else f"stopped after {found[3]} steps"
            return Outcome(integrator.state.copy(), found[3], None, None, status)

        run = partial(propagate, self.task.t_end, max_steps=MOST_STEPS)
        return Run(run, partial(self._rewind, integrator), read=read)


class Cvodes(EndSolver):
    """CVODES as CasADi calls it, on our equations, node for node, in CasADi's virtual machine."""

    tolerances = tuple([10.0**-k for k in range(3, 13)])

    def __init__(self, kind: str, task: AccuracyTask, smallest: float, problem: Problem) -> None:
        super().__init__(f"CVODES {kind}", task, smallest)
        self.casadi = casadi()
        self.options = CVODES[kind]
        self.equations = casadi_equations(self.casadi, problem)

    def _function(self, knob: float, times: Sequence[float]) -> Function:
        options = {"reltol": knob, "abstol": self.absolute(knob), "max_num_steps": MOST_STEPS} | self.options
        return self.casadi.integrator("run", "cvodes", self.equations, 0.0, list(times), options)

    def ready(self, knob: float) -> Run:
        function = self._function(knob, [self.task.t_end])

        def read(found: dict[str, DM]) -> Outcome:
            stats = function.stats()
            return Outcome(np.array(found["xf"]).ravel(), stats["nsteps"], stats["netfails"], stats["nfevals"])

        return Run(partial(function, x0=self.start.tolist()), read=read)


def heyoka_equations(
    hy: ModuleType, problem: Problem, kind: Callable[[float], Any] = float
) -> list[tuple[expression, expression]]:
    """Our rate as heyoka's pairs of variable and expression. Raises UnavailableError for an operation it has not.

    kind: of the constants, which heyoka multiplies with each other where it can.
    """
    graph = problem.rate

    def number(value: float) -> expression:
        return hy.expression(kind(value))

    env = {node: hy.time if node.name == TIME else hy.make_vars(f"x_{node.name}") for node in graph.inputs}
    functions = SimpleNamespace(**vars(hy), where=hy.select, hypot=lambda a, b: hy.sqrt(a * a + b * b))
    values = translated(graph.nodes, env, functions, number=number)
    states = [env[node] for node in graph.inputs[: problem.size]]
    return list(zip(states, [hy.expression(values[rate]) for rate in graph.outputs.values()], strict=True))


def casadi_equations(ca: ModuleType, problem: Problem) -> dict[str, SX]:
    """Our rate as CasADi's x, t and ode. Raises UnavailableError for an operation it has not."""
    x, t = ca.SX.sym("x", problem.size), ca.SX.sym("t")
    return {"x": x, "t": t, "ode": our_function(problem.rate, "rate")(ca.vertcat(x, t))}


def offers(task: AccuracyTask, smallest: float, problem: Problem) -> dict[str, Callable[[], EndSolver]]:
    """The peers that could be asked, by name; making one raises ImportError, UnavailableError or ValueError."""
    makers: dict[str, Callable[[], EndSolver]] = {}
    for solver in ORDERS:
        makers[f"{SCIPY}{solver}"] = partial(Scipy, solver, task, smallest, problem)
    for integrator in MUJOCO:
        makers[f"MuJoCo {integrator}"] = partial(Mujoco, integrator, task, smallest)
    makers["heyoka Taylor"] = partial(Heyoka, task, smallest, problem)
    for kind in CVODES:
        makers[f"CVODES {kind}"] = partial(Cvodes, kind, task, smallest, problem)
    return makers
