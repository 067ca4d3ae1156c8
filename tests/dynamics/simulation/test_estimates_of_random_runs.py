"""The estimated error of random runs of equal steps beside the true one, by SciPy: kinks, few rows."""

import math
import warnings
from typing import Any

import numpy as np
from pytest import importorskip, mark

import cgraph as cg
import dynamics as dyn
from tests.dynamics.models import Array
from tests.dynamics.step_options import EQUAL
from tests.slow import slow

solve_ivp = importorskip("scipy.integrate").solve_ivp
KINDS = ["kink", "rows"]
UNDER, OVER = 10.0, 1e3  # by which an estimate may be too small unless it is said, and too large
RTOL, EXACT = 1e-13, 1e-12  # of the steps of SciPy, and of its motions; smaller errors are not compared


class RandomRun:
    """Masses on springs, with a spring that acts on one side of a plane besides.

    Lengths are in units of 1e-6 to 1e6 m, times of 1e-6 to 1e6 s; both are 1 for SciPy.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 77])
        self.kind, self.n = KINDS[seed % len(KINDS)], int(rng.integers(1, 4))
        n, square = self.n, rng.normal(size=(self.n, self.n))
        self.stiffness = square @ square.T + np.diag(rng.uniform(0.5, 2.0, n))
        self.damping = rng.choice([0.0, 0.1], n) * rng.uniform(0.0, 1.0, n)
        self.normal = rng.normal(size=n)
        self.normal /= np.linalg.norm(self.normal)
        self.length, self.time = 10.0 ** rng.uniform(-6.0, 6.0, 2)
        slowest, *_, fastest = np.sqrt(np.linalg.eigvalsh(self.stiffness)[[0, -1]])
        self.method = str(rng.choice(EQUAL))
        self.dt = 10.0 ** rng.uniform(-2.2, -0.3) / fastest
        self.t_end = min(rng.uniform(5.0, 30.0) / slowest, 4000.0 * self.dt)
        self.q, self.qd = rng.normal(size=(2, n))
        self.plane, self.extra = 0.3 * rng.normal(), rng.uniform(0.5, 8.0) * (self.kind == "kink")
        few = self.kind == "rows" or rng.random() < 0.5
        self.rows = np.sort(rng.uniform(0.1, 1.0, rng.integers(1, 4))) * self.t_end if few else None

    def simulated(self, rows: Array | None) -> dyn.Trajectory:
        """By equal steps, with rows at these times."""
        one, second, indices = self.length, self.time, range(self.n)

        def height(q: Any) -> Any:
            return sum(self.normal[i] * q[i] for i in indices) * (1.0 / one) - self.plane

        def lagrangian(q: Any, qd: Any, t: Any) -> Any:
            x, xd = [each * (1.0 / one) for each in q], [each * (second / one) for each in qd]
            total = sum(0.5 * v * v for v in xd)
            total = total - sum(0.5 * self.stiffness[i, j] * x[i] * x[j] for i in indices for j in indices)
            return total - 0.5 * self.extra * cg.maximum(height(q), 0.0) ** 2

        options: dict[str, Any] = {"dt": self.dt * second, "t_eval": None if rows is None else rows * second}
        names = [f"x{i}" for i in indices]
        system = dyn.System(lagrangian, names, damping=(self.damping * second / one**2).tolist())
        with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
            start = self.q * one, self.qd * one / second
            return dyn.simulate(system, *start, self.t_end * second, self.method, **options)

    def exact(self, times: Array) -> Array:
        """States (T, 2 n) at times (T,), by SciPy from one crossing of the plane to the next."""
        n, across, after = self.n, np.append(self.normal, np.zeros(self.n)), 0.0
        state, rows = np.append(self.q, self.qd), np.empty((len(times), 2 * self.n))
        above = across @ state > self.plane
        while True:
            pressed = self.extra * self.normal if above else 0.0 * self.normal
            matrix = self.stiffness + np.outer(pressed, self.normal)

            def rate(t: float, y: Array, matrix: Array = matrix, force: Array = self.plane * pressed) -> Array:
                return np.append(y[n:], force - matrix @ y[:n] - self.damping * y[n:])

            def leaves(t: float, y: Array, side: float = 1.0 if above else -1.0) -> float:
                return side * float(across @ y - self.plane)

            leaves.terminal, leaves.direction = True, -1  # type: ignore[attr-defined]
            run = solve_ivp(
                rate, (after, self.t_end), state, "DOP853", rtol=RTOL, atol=RTOL, events=leaves, dense_output=True
            )
            rows[times >= after] = run.sol(times[times >= after]).T
            if run.status != 1:
                return rows
            after, state, above = run.t[-1], run.y[:, -1], not above

    def error(self, run: dyn.Trajectory) -> float:
        """The largest of the rows, of each component in units of its largest value."""
        t, x = run.t / self.time, np.hstack([run.q / self.length, run.qd * self.time / self.length])
        times = np.union1d(t, np.linspace(0.0, self.t_end, 400))
        exact = self.exact(times)
        return float((np.abs(x - exact[np.searchsorted(times, t)]) / np.abs(exact).max(axis=0)).max())


@mark.parametrize("seed", [*range(8), *slow(*range(8, 320))])
def test_no_error_of_equal_steps_is_far_from_its_estimate(seed: int) -> None:
    """Where it is not said that it is unknown. That of few rows is that of all steps, which are its bound."""
    random = RandomRun(seed)
    run = random.simulated(random.rows)
    if not run.success:
        return
    said, true = run.stats.error, random.error(run)
    assert said is not None
    assert said >= true / UNDER - EXACT or run.stats.warnings
    if said > OVER * (true + EXACT) and math.isfinite(said):
        every = random.simulated(None)
        assert every.success
        assert said <= OVER * (random.error(every) + EXACT)
