"""The numbers of Kusaka and Tanaka (2025), measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import cgraph as cg
from cgraph import Counts, Graph
from cgraph.extend import Array, Polynomial, expand, format_polynomial

from ..equations.formulations.formulations import inverse_dynamics, momentum_rate
from ..io.mujoco_twin import MujocoTwin
from ..multibody.builders.planar_arm import planar_arm
from ..multibody.trees.mechanism import require_mechanism
from ..peers.torch import eager_evaluations
from ..scenes.scenes import Scene, spring_mass, triple_pendulum
from ..simulation.simulate import simulate
from ..simulation.trajectory import Trajectory
from ..systems.model import Model, as_system
from .clock import in_turns, spent

STEPS = tuple(10.0 ** (-k / 2) for k in range(4, 13))  # s, 1e-2 to 1e-6


@dataclass(frozen=True)
class EmbeddingError:
    """At one state of a model: how far a formulation's torque is from the true one, and from its limit.

    error, distance: (len(dt),) largest entries [N m].  limit: (n,), the part of tau + limit that stays as dt -> 0.
    slope: fitted power of dt in `distance`.
    """

    formulation: str
    n: int
    dt: Array
    error: Array  # |tau_formulation - tau|
    distance: Array  # |tau_formulation - (tau + limit)|
    limit: Array  # dL/dq by definition, dK/dq for kinetic only
    slope: float


def embedding_error(
    model: Model, q: Array, qd: Array, qdd: Array, formulation: str, steps: Sequence[float] = STEPS
) -> EmbeddingError:
    """The error at the state (q, qd, qdd), each (n,), for "euler_embedded" or "kinetic_only"."""
    system = as_system(model)
    energy = {"euler_embedded": system.lagrangian, "kinetic_only": system.kinetic}[formulation]
    parameters = list(system.parameters.values())
    true = cg.compile(inverse_dynamics(system, "chain_rule"))(np.concatenate([q, qd, qdd, parameters]))
    slopes = cg.jacobian(system.graph({"E": energy}, system.q, system.qd), wrt=system.q)
    limit = cg.compile(slopes)(np.concatenate([q, qd, parameters]))
    flawed = cg.compile(inverse_dynamics(system, formulation))
    error, distance = [], []
    for dt in steps:
        tau = flawed(np.concatenate([q - qd * dt, qd - qdd * dt, qdd, [dt], parameters]))
        error.append(np.abs(tau - true).max())
        distance.append(np.abs(tau - true - limit).max())
    fitted = exponent(steps, distance) if min(distance) > 0 else float("nan")
    return EmbeddingError(formulation, system.n, np.array(steps), np.array(error), np.array(distance), limit, fitted)


def embedding_errors(counts: Sequence[int] = (1, 2, 3, 6), seed: int = 0) -> list[EmbeddingError]:
    """The errors of both flawed formulations at a random state of arms of 1, 2, 3 and 6 links."""
    rng = np.random.default_rng(seed)
    errors = []
    for n in counts:
        arm = planar_arm(rng.uniform(0.5, 1.5, n).tolist(), rng.uniform(0.5, 1.5, n).tolist())
        q, qd, qdd = rng.uniform(-1.0, 1.0, (3, n))
        errors += [embedding_error(arm, q, qd, qdd, formulation) for formulation in ("euler_embedded", "kinetic_only")]
    return errors


# The paper's right-hand side, I qdd - k (qdd dt^2 + 2 qd dt + q_old), as coefficients.
PAPER: Polynomial = {
    (("I", 1), ("qdd0", 1)): 1.0,
    (("dt", 2), ("k", 1), ("qdd0", 1)): -1.0,
    (("dt", 1), ("k", 1), ("qd0", 1)): -2.0,
    (("k", 1), ("q0_old", 1)): -1.0,
}


@dataclass(frozen=True)
class Equation:
    """One formulation's d/dt dL/dqd for L = I qd^2/2 - k q^2/2, term by term."""

    formulation: str
    terms: Polynomial

    def __str__(self) -> str:
        return format_polynomial(self.terms)


def equation3(formulation: str) -> Equation:
    """The terms of the graph of that formulation; qd0 stands for the embedded velocity qdd0 dt + qd0_old."""
    return Equation(formulation, _terms(momentum_rate(spring_mass(), formulation)))


def torque_terms(formulation: str) -> Polynomial:
    """The terms of the whole torque, d/dt dL/dqd - dL/dq, of that formulation."""
    return _terms(inverse_dynamics(spring_mass(), formulation))


def _terms(graph: Graph) -> Polynomial:
    velocity = {node: "qd0" for node in graph.nodes if node.args and node.name == "qd0"}
    return expand(graph.only_output(), velocity)


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """The p of the least-squares fit y = c x^p on logarithms; x and y positive."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


@dataclass(frozen=True)
class FreeFall:
    """One run. positions: (T, n + 1, 2) [m], base, joints and tip."""

    scene: Scene
    trajectory: Trajectory
    positions: Array


@dataclass(frozen=True)
class MujocoFreeFall:
    """MuJoCo's run at the same steps. q: (T, n) [rad].  positions: (T, n + 1, 2) [m], by its own kinematics."""

    q: Array
    positions: Array
    version: str


def free_fall(scene: Scene, dt: float = 1e-3) -> FreeFall:
    """The scene's motion by RK4 on the graph's forward dynamics."""
    trajectory = simulate(scene, scene.q, scene.qd, scene.t_end, "rk4", dt=dt)
    if not trajectory.stats.success:
        raise RuntimeError(f"the fall of {scene.name} is not whole: it {trajectory.stats.message}")
    return FreeFall(scene, trajectory, require_mechanism(scene, "a fall").joint_positions(trajectory.q))


def mujoco_free_fall(run: FreeFall) -> MujocoFreeFall:
    """MuJoCo's RK4 on its twin of the arm, from the same start with the same step. Raises ImportError without it."""
    steps = len(run.trajectory.t) - 1
    twin = MujocoTwin(run.scene.model, run.scene.t_end / steps)
    q, _ = twin.trajectory(np.array(run.scene.q), np.array(run.scene.qd), steps)
    return MujocoFreeFall(q, twin.arm_positions(q), str(twin.mujoco.__version__))


def largest_differences(run: FreeFall, other: MujocoFreeFall, windows: int = 6) -> list[tuple[float, float]]:
    """(t, largest |difference in q| up to t [rad]) at the ends of equal stretches of time."""
    difference = np.abs(run.trajectory.q - other.q).max(axis=1)
    ends = np.linspace(0, len(difference) - 1, windows + 1).astype(int)[1:]
    return [(float(run.trajectory.t[k]), float(difference[: k + 1].max())) for k in ends]


COUNTS = (1, 2, 3, 4, 6, 8, 10, 14, 20, 28, 40)
FITTED_FROM = 6  # links; below, the fixed part of the graph bends the curve
SCALED = ("euler_embedded", "kinetic_only", "chain_rule", "chain_rule_literal")


@dataclass(frozen=True)
class NodeScaling:
    """One formulation over chains of n equal rods; exponents are fitted over n >= 6."""

    formulation: str
    n: tuple[int, ...]
    nodes: tuple[int, ...]
    edges: tuple[int, ...]
    microseconds: tuple[float, ...]  # one compiled evaluation, best of several

    def fitted(self, values: Sequence[float]) -> float:
        """The exponent of `values`, one of this row's columns, over n >= 6."""
        kept = [(n, value) for n, value in zip(self.n, values, strict=True) if n >= FITTED_FROM]
        return exponent(*zip(*kept, strict=True))


def node_scaling(
    counts: Sequence[int] = COUNTS, report: Callable[[float], None] = lambda done: None
) -> list[NodeScaling]:
    """Sizes of each formulation of `SCALED` over arms of `counts` links. report: called with the share done."""
    rows = []
    total = len(SCALED) * sum(n * n for n in counts)
    done = 0
    for formulation in SCALED:
        nodes, edges, micros = [], [], []
        for n in counts:
            graph = inverse_dynamics(planar_arm([1.0] * n, [1.0] * n), formulation)
            nodes.append(len(graph.nodes))
            edges.append(len(graph.edges))
            micros.append(_microseconds(graph))
            done += n * n
            report(done / total)
        rows.append(NodeScaling(formulation, tuple(counts), tuple(nodes), tuple(edges), tuple(micros)))
    return rows


def _microseconds(graph: cg.Graph, repeats: int = 7) -> float:
    function = cg.compile(graph, "python").values
    x = np.random.default_rng(0).normal(size=len(graph.inputs)).tolist()
    tens = [spent(lambda: [function(x) for _ in range(10)]) for _ in range(repeats)]
    return min(each.seconds for each in tens) / 10.0 * 1e6


# The paper's Table 1: mean and standard deviation over 1000 evaluations, in ms.
PAPER_MS = {"euler_embedded": (51.7, 9.62), "kinetic_only": (43.8, 8.03), "chain_rule": (6.29, 1.15)}


@dataclass(frozen=True)
class Timing:
    """Median and quartiles of one evaluation, in microseconds: one interruption does not move them."""

    median: float
    lower: float  # a quarter of the evaluations take less
    upper: float  # a quarter take more


@dataclass(frozen=True)
class Row:
    """One formulation: its graph's size and its cost by each way of evaluating it."""

    formulation: str
    counts: Counts
    timings: dict[str, Timing]  # {"interpreted" | "compiled" | "PyTorch eager": ...}


def table_1(evaluations: int = 1000, seed: int = 0) -> list[Row]:
    """The three formulations, each evaluated at random states; formulations take turns, so that drift is shared.

    PyTorch eager, which builds its graph anew at every evaluation, is measured beside ours where torch is installed.
    """
    scene = triple_pendulum()
    graphs = {name: inverse_dynamics(scene, name) for name in PAPER_MS}
    runs: dict[str, Mapping[str, Callable[[np.ndarray], object]]] = {
        "interpreted": {name: _interpreted(graph) for name, graph in graphs.items()},
        "compiled": {name: cg.compile(graph, "python") for name, graph in graphs.items()},
    }
    if eager := eager_evaluations(scene.system, PAPER_MS):
        runs["PyTorch eager"] = eager
    rng = np.random.default_rng(seed)
    states = {
        name: np.where([x == "dt" for x in graph.input_names], 1e-3, rng.normal(size=(evaluations, len(graph.inputs))))
        for name, graph in graphs.items()
    }
    timings: dict[str, dict[str, Timing]] = {name: {} for name in graphs}
    for way, functions in runs.items():
        for name, function in functions.items():
            function(states[name][0])  # warm
        each_state = {name: partial(next, map(function, states[name])) for name, function in functions.items()}
        for name, taken in in_turns(each_state, evaluations).items():
            timings[name][way] = timing(np.array([each.seconds for each in taken]))
    return [Row(name, graph.counts(), timings[name]) for name, graph in graphs.items()]


def timing(seconds: np.ndarray) -> Timing:
    """The median and quartiles of times [s]."""
    return Timing(*[float(share) * 1e6 for share in np.quantile(seconds, (0.5, 0.25, 0.75))])


def _interpreted(graph: cg.Graph) -> Callable[[np.ndarray], object]:
    names = graph.input_names
    return lambda x: graph.evaluate(dict(zip(names, x.tolist(), strict=True)))
