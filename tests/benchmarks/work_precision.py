"""Error and run time beside other software: `python tests/benchmarks/work_precision.py [orders taylor stiff ..]`.

Ratios of the shortest of runs that take turns in one process, at equal error; cold starts in processes of their own.
Prints what is installed; asserts nothing. All of it takes some ten minutes.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import cgraph as cg
import dynamics as dyn
from dynamics.experiments.speed.bench_table import machine
from dynamics.experiments.work_precision.cold_start import cold_starts
from dynamics.experiments.work_precision.energy_drift import METHODS as SYMPLECTIC, drift
from dynamics.experiments.work_precision.trajectory_peers import EPSILON, Cvodes, Heyoka, heyoka_derivatives
from dynamics.experiments.work_precision.trajectory_runs import Contender, Ours, Outcome, Scipy, problem_of
from dynamics.experiments.work_precision.trajectory_scenes import load
from dynamics.experiments.work_precision.work_precision import Judge, work_precision
from dynamics.integrators import METHODS, Problem
from dynamics.multibody.planar_arm import planar_links

FIXED = tuple([name for name, method in METHODS.items() if not method.adaptive])
TURNS = 15
Array = np.ndarray[Any, np.dtype[np.float64]]


class Bench(NamedTuple):
    """A setting made ready: its equations, and what measures errors."""

    setting: Any
    problem: Problem
    judge: Judge
    smallest: float

    def ours(self, method: str) -> Ours:
        """One of our methods."""
        return Ours(method, self.setting, self.smallest, self.problem)


class Timed(NamedTuple):
    """A run at a knob that met an error."""

    name: str
    knob: float
    run: Callable[[], Outcome]
    outcome: Outcome
    error: float


def bench(name: str, folder: str, digits: int = 30, **options: Any) -> Bench:
    """The setting of that name."""
    setting = load(name, **options)
    exact = setting.exact(digits, folder)
    scales = setting.scales(exact)
    print(f"\n{setting.name}, to t = {setting.t_end:g} s. Exact motion: {exact.how}; its error {exact.error:.0e}")
    return Bench(setting, problem_of(setting), Judge(setting, exact, scales), float(scales.min()))


def met(contender: Contender, knobs: Iterable[float], judge: Judge, error: float, name: str = "") -> list[Timed]:
    """The runs of a contender that are at most so far off."""
    found = []
    for knob in knobs:
        try:
            run = contender.ready(knob)
            outcome = run()
        except Exception as problem:  # noqa: BLE001 (another's refusal is a line)
            print(f"   {contender.name} at {knob:.0e}: {' '.join(str(problem).split())[:100]}")
            continue
        off = judge.at_end(outcome.x)
        if not outcome.status and off <= error:
            found.append(Timed(name or contender.name, knob, run, outcome, off))
    return found


def tolerances(first: float, last: float, per_decade: int = 4) -> list[float]:
    """From loose to tight, powers of ten."""
    count = round(per_decade * np.log10(first / last))
    found: list[float] = np.geomspace(first, last, count + 1).tolist()
    return found


def shortest(runs: Sequence[Callable[[], Any]], turns: int = TURNS, least: float = 5e-3) -> list[float]:
    """Seconds of the shortest run of each; all take turns."""
    best = [float("inf")] * len(runs)
    for _ in range(turns):
        for k, run in enumerate(runs):
            left = least
            while left > 0.0:
                begin = time.perf_counter()
                run()
                spent = time.perf_counter() - begin
                best[k] = min(best[k], spent)
                left -= spent
    return best


def fastest(timed: Sequence[Timed]) -> list[tuple[Timed, float]]:
    """Of each name the fastest run, in the order of time."""
    seconds = shortest([each.run for each in timed])
    result: dict[str, tuple[Timed, float]] = {}
    for each, spent in sorted(zip(timed, seconds, strict=True), key=lambda pair: pair[1]):
        result.setdefault(each.name, (each, spent))
    return list(result.values())


def show(rows: Sequence[tuple[Timed, float]], unit: float) -> None:
    """A line for each: time, times the unit, error, and counts."""
    for each, spent in rows:
        o = each.outcome
        print(
            f"   {each.name:34} {spent * 1e3:9.3f} ms {spent / unit:8.2f}  error {each.error:.1e}  knob {each.knob:.1e}"
            f"  steps {o.steps}  evaluations {o.evaluations}"
        )


def orders(folder: str) -> None:
    """Fitted orders of the methods of equal steps."""
    for name in ("triple_pendulum", "spring pendulum, k = 100"):
        found = work_precision(name, methods=FIXED, peers=(), turns=1, limit=1.5, cold=(), folder=folder)
        print(f"\nfitted orders, {name}")
        for curve in found.curves:
            assert curve.order is not None
            told = "-" if curve.fitted is None else f"{curve.fitted:.4f} ({curve.fitted - curve.order:+.4f})"
            print(f"   {curve.name:18} declared {curve.order}  fitted {told}")


def taylor(folder: str) -> None:
    """The damped triple pendulum to 10 s, beside heyoka's Taylor integrator and CVODES, at 1e-12; and cold starts."""
    made = bench("triple_pendulum", folder, t_end=10.0)
    target = 1e-12
    timed: list[Timed] = []
    for method in ("dop853", "dopri5", "rodas", "radau"):
        timed += met(made.ours(method), tolerances(1e-10, 1e-14), made.judge, target)
    for method in ("rk4", "gauss4", "gauss6"):
        timed += met(made.ours(method), [64 * 2**k for k in range(3, 11)], made.judge, target)
    knobs = [1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14]
    default = []
    for name in ("heyoka, our equations", "heyoka, its own derivatives"):
        contender = Heyoka(made.setting, made.smallest, made.problem)
        if "own" in name:
            contender.system = heyoka_derivatives(contender.heyoka, made.setting)
        default += met(contender, [EPSILON], made.judge, target, f"{name}, default")
        timed += met(contender, knobs, made.judge, target, f"{name}, loosest")
    timed += met(
        Scipy("DOP853", made.setting, made.smallest, made.problem), tolerances(1e-10, 1e-13, 2), made.judge, target
    )
    for kind in ("BDF", "Adams"):
        timed += met(
            Cvodes(kind, made.setting, made.smallest, made.problem), tolerances(1e-11, 1e-15, 1), made.judge, target
        )
    rows = sorted(fastest([*timed, *default]), key=lambda pair: pair[1])
    ours = min([spent for each, spent in rows if each.name in METHODS], default=float("nan"))
    print(f"error at most {target:g} at t = {made.setting.t_end:g} s; in the second column, times the best of ours")
    show(rows, ours)
    print("cold start: model to end of first run, nothing compiled; heyoka at its default tolerance")
    found = cold_starts("triple_pendulum", {"t_end": 10.0}, turns=5, budget=120.0)
    mine = next(each.seconds for each in found if each.name == "ours")
    for each in found:
        times = f"{each.seconds:8.3f} s  median {each.median:8.3f} s  {each.seconds / mine:8.2f}"
        print(f"   {each.name:16} {times}  {each.status}")


def stiff(folder: str) -> None:
    """Steps of stiff methods against RK4 on a stiff spring; Robertson and Van der Pol against SciPy's solvers."""
    made = bench("spring pendulum 1e8", folder)
    target = 1e-6
    rk4 = made.ours("rk4")
    few, many = 2**14, 2**21  # too few leave the numbers
    while many - few > few // 64:
        middle = (few + many) // 2
        if met(rk4, [middle], made.judge, target):
            many = middle
        else:
            few = middle
    print(f"rk4 needs {many} steps for an error of {target:g}")
    timed = []
    for method in ("rodas", "radau"):
        timed += met(made.ours(method), tolerances(1e-3, 1e-9), made.judge, target)
        if few_steps := [each.outcome.steps for each in timed if each.name == method and each.outcome.steps]:
            print(f"   {method} needs {min(few_steps)}: 1/{many / min(few_steps):.0f} of the steps")
    timed += met(rk4, [many], made.judge, target)
    timed += met(
        Scipy("Radau", made.setting, made.smallest, made.problem), tolerances(1e-3, 1e-9, 2), made.judge, target
    )
    rows = fastest(timed)
    show(rows, rows[0][1])
    for name in ("van der pol 1e6", "robertson"):
        made = bench(name, folder)
        for target in (1e-4, 1e-6, 1e-8):
            timed = []
            for method in ("rodas", "radau"):
                timed += met(made.ours(method), tolerances(1e-3, 1e-12, 2), made.judge, target)[:4]
            for solver in ("Radau", "LSODA", "BDF"):
                contender = Scipy(solver, made.setting, made.smallest, made.problem)
                timed += met(contender, tolerances(1e-3, 1e-13, 2), made.judge, target)[:4]
            rows = sorted(fastest(timed), key=lambda pair: pair[1])
            ours = min([spent for each, spent in rows if each.name in METHODS], default=float("nan"))
            print(f"error at most {target:g}")
            show(rows, ours)


def numpy_rate(arm: dyn.Mechanism) -> Callable[[float, Array], Array]:
    """The rates of a planar arm as one writes them in NumPy: angles from the vertical, M and a linear solve."""
    n = len(arm.moving)
    share = np.array(
        [[k.length if j < i else k.center * (j == i) for j, k in enumerate(planar_links(arm))] for i in range(n)]
    )
    mass = np.array([link.mass for link in planar_links(arm)])
    pairs = share.T @ (mass[:, None] * share) + np.diag([link.inertia for link in planar_links(arm)])
    weight, damping = -np.asarray(arm.gravity)[2] * mass @ share, np.array(arm.system.damping)

    def rate(t: float, x: Array) -> Array:
        q, qd = x[:n], x[n:]
        theta, omega = np.cumsum(q), np.cumsum(qd)
        apart = theta[:, None] - theta
        torque = -damping * qd
        torque[:-1] -= torque[1:].copy()
        force = torque - (pairs * np.sin(apart)) @ omega**2 - weight * np.sin(theta)
        alpha = np.linalg.solve(pairs * np.cos(apart), force)
        return np.concatenate([qd, np.diff(alpha, prepend=0.0)])

    return rate


def loops(folder: str) -> None:
    """Our dop853 in its native loop against SciPy's solve_ivp with DOP853, at equal error."""
    from scipy.integrate import solve_ivp

    made = bench("triple_pendulum", folder, t_end=10.0)
    compiled = cg.compile(made.problem.rate)
    python = cg.compile(made.problem.rate, "python")
    plain = numpy_rate(made.setting.model)
    x = np.array([0.3, -0.5, 0.7, 1.0, -2.0, 0.5])
    print(
        f"rates in NumPy against the graph: largest difference {np.abs(plain(0.0, x) - compiled([*x, 0.0])).max():.1e}"
    )
    rates: dict[str, Callable[[float, Array], Any]] = {
        "solve_ivp, rate in NumPy": plain,
        "solve_ivp, our generated Python": lambda t, x: python.values([*x.tolist(), t]),
        "solve_ivp, our compiled rate": lambda t, x: compiled([*x, t]),
    }
    for target in (1e-6, 1e-9, 1e-12):
        timed = met(made.ours("dop853"), tolerances(1e-4, 1e-14), made.judge, target)[:6]
        for name, rate in rates.items():
            for knob in tolerances(1e-4, 1e-13, 2):

                def run(rate: Callable[[float, Array], Any] = rate, knob: float = knob) -> Outcome:
                    options = {"method": "DOP853", "rtol": knob, "atol": knob * made.smallest}
                    done = solve_ivp(rate, (0.0, made.setting.t_end), made.setting.start, **options)
                    return Outcome(done.y[:, -1], len(done.t) - 1, None, done.nfev)

                outcome = run()
                if (off := made.judge.at_end(outcome.x)) <= target:
                    timed.append(Timed(name, knob, run, outcome, off))
                    break
        rows = sorted(fastest(timed), key=lambda pair: pair[1])
        print(f"error at most {target:g}")
        show(rows, rows[0][1])


def energy(folder: str, steps: int = 10**6, starts: int = 12) -> None:
    """Drift of the energy of the three-link arm without damping over a million steps, from a dozen starts.

    The drift of one run is that of its roundings too, whose random walk looks like a line; it has another sign from
    another start, and what a method adds has not. So the mean over starts is compared with its standard error.
    """
    arm = dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7])
    q = np.array([0.4, 0.2, 0.1]) * np.random.default_rng(1).uniform(0.5, 1.5, (starts, 3))
    print(f"\nthree-link arm without damping from rest, {steps} steps of 0.01 s from each of {starts} starts")
    print(
        "   of the kinetic energy: widest band; mean over the starts of the drift by least squares, its standard error"
    )
    print(f"   (the random walk of one rounding a step ends near {2.0**-53 * steps**0.5:.1e})")
    for method in (*SYMPLECTIC, "rk4"):
        runs = [dyn.simulate(arm, start, [0.0] * 3, 0.01 * steps, method, dt=0.01, progress=False) for start in q]
        found = [drift(run.energy, float(run.energy[0] - rest_energy(arm))) for run in runs]
        slopes = np.array([each.drift for each in found])
        mean, error = slopes.mean(), slopes.std(ddof=1) / np.sqrt(starts)
        seconds = min(run.stats.seconds for run in runs)
        stopped = " ".join({run.stats.message for run in runs if not run.stats.success})
        print(
            f"   {method:18} band {max(each.band for each in found):.2e}  drift {mean:+.2e} +- {error:.1e} "
            f"({abs(mean) / error:.1f} standard errors)  {seconds:.1f} s a run  {stopped}",
            flush=True,
        )


def rest_energy(arm: dyn.Mechanism) -> float:
    """The energy hanging still [J]."""
    return float(dyn.energy(arm).evaluate({f"{a}{i}": 0.0 for a in ("q", "qd") for i in range(3)})["E"])


PARTS = {"orders": orders, "taylor": taylor, "stiff": stiff, "loops": loops, "energy": energy}


def main() -> None:
    """Print the parts asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--exact", default="build/exact", help="where exact motions are kept (default: build/exact)")
    options = parser.parse_args()
    print(machine())
    for part in options.parts or PARTS:
        PARTS[part](options.exact)
        print(f"load of the machine: {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
