"""Comparisons of integrators at equal error: orders, energy, Taylor series, stiff systems, and native loops.

Times are the shortest of runs that take turns in one process; cold starts run in processes of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics.equations.energies import energy as energy_graph
from dynamics.experiments.stability.energy_drift import SYMPLECTIC, drift
from dynamics.experiments.text_table import table
from dynamics.experiments.work_precision.measurement import Tried, attempt, time_in_turns
from dynamics.experiments.work_precision.named_tasks import load
from dynamics.experiments.work_precision.trajectory_runs import Ours, Solver
from dynamics.experiments.work_precision.work_precision import Subject, subject, work_precision
from dynamics.integrators import METHODS
from dynamics.multibody.builders.planar_arm import planar_arm
from dynamics.simulation.simulate import simulate
from tests.bench.motions.cold_start import cold_starts
from tests.bench.motions.trajectory_peers import EPSILON, Cvodes, Heyoka, Scipy
from tests.bench.peers.peer import made
from tests.bench.tables import Table

FIXED = tuple([name for name, method in METHODS.items() if not method.adaptive])
MASSES = LENGTHS = np.array([1.0, 0.8, 0.7])  # kg, m: the rods of the scene triple_pendulum
DAMPING, GRAVITY = 0.1, 9.81  # N m s, m/s^2: of the same
TURNS = 15
FOLDER = Path("build/exact")  # where exact motions are kept
STEPS, STEP, STARTS = 10**6, 0.01, 12  # of `energy`: steps, their length [s], and starts


@dataclass
class Comparison:
    """Solvers of one subject that meet an error.  tried: runs by name.  refused: why knobs gave no run."""

    subject: Subject
    error: float
    tried: dict[str, list[Tried]] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)

    def ours(self, methods: Iterable[str], knobs: Iterable[float]) -> None:
        """Some of our methods, at knobs from coarse to fine."""
        for method in methods:
            self.add(method, partial(Ours, method), knobs)

    def add(self, name: str, make: Callable[..., Solver], knobs: Iterable[float], most: int | None = None) -> None:
        """A solver made of (task, smallest, problem), at knobs from coarse to fine, until `most` are good."""
        runs = self.tried[name] = []
        absent: dict[str, str] = {}
        for solver in made({name: lambda: make(*self.subject[:3])}, absent).values():
            for knob in knobs:
                found = attempt(solver, self.subject.metrics, knob)
                if found.raised:
                    self.refused.append(f"{name} at {knob:.0e}: {found.why[:100]}")
                elif found.tried is not None and found.tried.error <= self.error:
                    runs.append(found.tried)
                if len(runs) == most:
                    break
        self.refused += [f"{name}: {missing}" for missing in absent.values()]

    def text(self) -> str:
        """The fastest run of every solver, by time; times are also relative to the fastest of ours."""
        time_in_turns([each for runs in self.tried.values() for each in runs], TURNS)
        best = {name: min(runs, key=lambda each: each.seconds) for name, runs in self.tried.items() if runs}
        ours = min([each.seconds for name, each in best.items() if name in METHODS], default=math.nan)
        header = ["", "ms", "times ours", "error", "knob", "steps", "evaluations"]
        rows = []
        for name, each in sorted(best.items(), key=lambda item: item[1].seconds):
            seconds, out = each.seconds, each.outcome
            times = [f"{1e3 * seconds:.3f}", f"{seconds / ours:.2f}", f"{each.error:.1e}", f"{each.knob:.1e}"]
            counts = ["-" if count is None else str(count) for count in (out.steps, out.evaluations)]
            rows.append([name, *times, *counts])
        title = f"error at most {self.error:g} at t = {self.subject.task.t_end:g} s"
        return "\n".join([str(Table(title, header, rows)), *self.refused])


def tolerances(first: float, last: float, per_decade: int = 4) -> list[float]:
    """Tolerances from loose to tight, powers of ten."""
    count = round(per_decade * np.log10(first / last))
    powers: list[float] = np.geomspace(first, last, count + 1).tolist()
    return powers


def orders() -> Iterator[str]:
    """Fitted orders of the methods of equal steps."""
    for name in ("triple_pendulum", "spring pendulum, k = 100"):
        report = work_precision(name, methods=FIXED, turns=1, limit=1.5, folder=FOLDER)
        rows = []
        for curve in report.curves:
            fitted, apart = "-", "-"
            if curve.fitted is not None and curve.order is not None:
                fitted, apart = f"{curve.fitted:.4f}", f"{curve.fitted - curve.order:+.4f}"
            rows.append([curve.name, str(curve.order), fitted, apart])
        yield str(Table(f"fitted orders, {name}", ["", "declared", "fitted", "difference"], rows))


def taylor() -> Iterator[str]:
    """The damped triple pendulum to 10 s, beside heyoka's Taylor integrator and CVODES, at 1e-12; and cold starts."""
    at = subject(load("triple_pendulum", t_end=10.0), FOLDER)
    yield at.title
    race = Comparison(at, 1e-12)
    race.ours(("dop853", "dopri5", "rodas", "radau"), tolerances(1e-10, 1e-14))
    race.ours(("rk4", "gauss4", "gauss6"), [64 * 2**k for k in range(3, 11)])
    for derivatives, whose in ((False, "our equations"), (True, "its own derivatives")):
        for which, knobs in (("default", [EPSILON]), ("loosest", [10.0**-k for k in range(9, 15)])):
            race.add(f"heyoka, {whose}, {which}", partial(Heyoka, derivatives=derivatives), knobs)
    race.add("scipy:DOP853", partial(Scipy, "DOP853"), tolerances(1e-10, 1e-13, 2))
    for kind in ("BDF", "Adams"):
        race.add(f"CVODES {kind}", partial(Cvodes, kind), tolerances(1e-11, 1e-15, 1))
    yield race.text()
    yield str(cold_starts("triple_pendulum", 10.0))


def stiff() -> Iterator[str]:
    """Steps of stiff methods against RK4 on a stiff spring; Robertson and Van der Pol against SciPy's solvers."""
    at, methods = subject(load("spring pendulum 1e8"), FOLDER), ("rodas", "radau")
    race = Comparison(at, 1e-6)
    yield at.title
    few, many = 2**14, 2**21  # too few, and enough
    while many - few > few // 64:
        middle = (few + many) // 2
        race.ours(["rk4"], [middle])
        few, many = (few, middle) if race.tried["rk4"] else (middle, many)
    yield f"rk4 needs {many} steps for an error of {race.error:g}"
    race.ours(methods, tolerances(1e-3, 1e-9))
    for method in methods:
        if steps := [each.outcome.steps for each in race.tried[method] if each.outcome.steps]:
            yield f"   {method} needs {min(steps)}: 1/{many / min(steps):.0f} of the steps"
    race.refused.clear()
    race.ours(["rk4"], [many])
    race.add("scipy:Radau", partial(Scipy, "Radau"), tolerances(1e-3, 1e-9, 2))
    yield race.text()
    for name in ("van der pol 1e6", "robertson"):
        at = subject(load(name), FOLDER)
        yield at.title
        for error in (1e-4, 1e-6, 1e-8):
            race = Comparison(at, error)
            for method in methods:
                race.add(method, partial(Ours, method), tolerances(1e-3, 1e-12, 2), 4)
            for solver in ("Radau", "LSODA", "BDF"):
                race.add(f"scipy:{solver}", partial(Scipy, solver), tolerances(1e-3, 1e-13, 2), 4)
            yield race.text()


def numpy_rate() -> Callable[[float, Array], Array]:
    """The rates of the triple pendulum as one writes them in NumPy: angles from the vertical, M and a linear solve."""
    n = len(MASSES)
    lever = np.tril(np.tile(LENGTHS, (n, 1)), -1) + np.diag(LENGTHS / 2)  # of link j in the place of center i
    pairs = lever.T @ (MASSES[:, None] * lever) + np.diag(MASSES * LENGTHS**2 / 12)
    weight = GRAVITY * MASSES @ lever

    def rate(t: float, x: Array) -> Array:
        q, qd = x[:n], x[n:]
        theta, omega = np.cumsum(q), np.cumsum(qd)
        apart = theta[:, None] - theta
        torque = -DAMPING * qd
        torque[:-1] -= torque[1:].copy()
        force = torque - (pairs * np.sin(apart)) @ omega**2 - weight * np.sin(theta)
        alpha = np.linalg.solve(pairs * np.cos(apart), force)
        return np.concatenate([qd, np.diff(alpha, prepend=0.0)])

    return rate


def loops() -> Iterator[str]:
    """Our dop853 in its native loop against SciPy's solve_ivp with DOP853, at equal error."""
    at = subject(load("triple_pendulum", t_end=10.0), FOLDER)
    yield at.title
    compiled, python, plain = cg.compile(at.problem.rate), cg.compile(at.problem.rate, "python"), numpy_rate()
    x = np.array([0.3, -0.5, 0.7, 1.0, -2.0, 0.5])
    apart = np.abs(plain(0.0, x) - compiled([*x, 0.0])).max()
    yield f"rates in NumPy against the graph: largest difference {apart:.1e}"
    rates: dict[str, Callable[[float, Array], object]] = {
        "solve_ivp, rate in NumPy": plain,
        "solve_ivp, our generated Python": lambda t, x: python.values([*x.tolist(), t]),
        "solve_ivp, our compiled rate": lambda t, x: compiled([*x, t]),
    }
    for error in (1e-6, 1e-9, 1e-12):
        race = Comparison(at, error)
        race.add("dop853", partial(Ours, "dop853"), tolerances(1e-4, 1e-14), 6)
        for name, rate in rates.items():
            race.add(name, partial(Scipy, "DOP853", rate=rate), tolerances(1e-4, 1e-13, 2), 1)
        yield race.text()


def energy(steps: int = STEPS, starts: int = STARTS) -> Iterator[str]:
    """Drift of the energy of the three-link arm without damping over a million steps, from a dozen starts.

    The drift of one run is that of its roundings too, whose random walk looks like a line; it has another sign from
    another start, and what a method adds has not. So the mean over starts is compared with its standard error.
    """
    arm = planar_arm(MASSES.tolist(), LENGTHS.tolist())
    at_rest = dict.fromkeys([f"{letter}{i}" for letter in ("q", "qd") for i in range(len(MASSES))], 0.0)
    hanging = float(energy_graph(arm).evaluate(at_rest)["E"])
    q = np.array([0.4, 0.2, 0.1]) * np.random.default_rng(1).uniform(0.5, 1.5, (starts, 3))
    rows = []
    for method in (*SYMPLECTIC, "rk4"):
        equal = partial(simulate, arm, method=method, dt=STEP, estimate_error=False, progress=False)
        runs = [equal(q=start, qd=[0.0] * 3, t_end=STEP * steps) for start in q]
        drifts = [drift(run.energy, float(run.energy[0] - hanging)) for run in runs]
        slopes = np.array([each.drift for each in drifts])
        mean, deviation = slopes.mean(), slopes.std(ddof=1) / np.sqrt(starts)
        stopped = " ".join({run.stats.message for run in runs if not run.stats.success})
        cells = [f"{max(each.band for each in drifts):.2e}", f"{mean:+.2e}", f"{deviation:.1e}"]
        seconds = min(run.stats.seconds for run in runs)
        rows.append([method, *cells, f"{abs(mean) / deviation:.1f}", f"{seconds:.1f}", stopped])
    header = ["", "band", "drift", "standard error", "their ratio", "s a run", ""]
    yield "\n".join(
        [
            f"three-link arm without damping from rest, {steps} steps of {STEP:g} s from each of {starts} starts",
            "Of the kinetic energy: widest band; mean drift over the starts, by least squares, and its standard error",
            f"(the random walk of one rounding a step ends near {2.0**-53 * steps**0.5:.1e})",
            *table(header, rows, left=(0, 6)),
        ]
    )
