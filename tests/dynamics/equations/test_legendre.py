"""Velocities of momenta where L is not quadratic: those that the momenta are of, over all their sizes and units."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn

from ...slow import slow

SIZES = 10.0 ** np.linspace(-6.0, 6.0, 61)  # of momenta, beside those at which L is no longer quadratic

# Strictly convex terms of L, and velocities up to where their slopes are these sizes.
TERMS: dict[str, tuple[Callable[[Any], Any], Any]] = {
    "relativistic": (lambda v: -cg.sqrt(1.0 - v * v), SIZES / np.sqrt(1.0 + SIZES**2)),
    "cosh": (cg.cosh, np.arcsinh(SIZES)),
    "quartic": (lambda v: 0.5e-3 * v**2 + 0.25 * v**4, 10.0 ** np.linspace(-6.0, 1.5, 61)),
    "barrier": (lambda v: -cg.log1p(-v * v), SIZES / (1.0 + np.sqrt(1.0 + SIZES**2))),
    "one sided": (lambda v: cg.exp(v) + 0.05 * v**2, np.log1p(SIZES)),
    "soft": (lambda v: cg.sqrt(1.0 + v * v) + 1e-3 * v**2, SIZES[:46]),
}

QUICK = [["relativistic"], ["quartic"], ["quartic", "relativistic", "soft"]]


def mixed(names: list[str], seed: int, unit: float = 2.0, action: float = 4.0) -> tuple[dyn.System, np.ndarray]:
    """A sum of terms of mixed velocities, in these units; and velocities (n, T), whose terms are two decades apart."""
    rng, n = np.random.default_rng(seed), len(names)
    mix = np.eye(n) + 0.4 * rng.uniform(-1.0, 1.0, (n, n))

    def lagrangian(q: Any, qd: Any, t: Any) -> Any:
        forms = [sum(mix[i, k] * (qd[k] / unit) for k in range(n)) for i in range(n)]
        return action * sum(TERMS[name][0](form) for name, form in zip(names, forms, strict=True))

    rows = [
        TERMS[name][1][np.clip(np.arange(61) - 10 * k, 0, 45 if name == "soft" else 60)] for k, name in enumerate(names)
    ]
    system = dyn.System(lagrangian, [f"x{k}" for k in range(n)])
    return system, unit * np.linalg.solve(mix, rng.choice([-1.0, 1.0], (n, 61)) * np.array(rows))


def there_and_back(system: dyn.System, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The momenta (n, T) of velocities, the velocities of these, and what is said to be missing."""
    n, at = len(qd), {f"q{k}": np.array(0.3) for k in range(len(qd))}
    with np.errstate(all="ignore"):
        momentum = dyn.momentum(system)
        values = at | {f"qd{k}": row for k, row in enumerate(qd)}
        p = np.array([*momentum.evaluate({name: values[name] for name in momentum.input_names}).values()])
        graph = dyn.hamilton_equations(system, check=True)
        values = at | {f"p{k}": row for k, row in enumerate(p)} | {f"tau{k}": np.array(0.0) for k in range(n)}
        out = graph.evaluate({name: values[name] for name in graph.input_names})
    back, missing = (np.array([out[name.format(k)] for k in range(n)]) for name in ("q{}_dot", "missing{}"))
    return p, back, missing


@pytest.mark.parametrize(
    "names", [*QUICK, *slow(*[[name] for name in TERMS if [name] not in QUICK], ["relativistic", "cosh"])], ids="+".join
)
def test_the_velocities_of_momenta_are_those_that_they_are_of(names: list[str]) -> None:
    system, qd = mixed(names, len(names))
    p, back, missing = there_and_back(system, qd)
    assert np.isfinite([*p, *back, *missing]).all()
    rounding = 1e-15  # of dL/dqd at rest, where it is small because terms cancel, and L is like its square
    assert (np.abs(back - qd) <= 10.0 ** (len(qd) - 13) * np.abs(qd).max(axis=0) + rounding).all()
    slow = np.abs(p).max(axis=0) < 1e3  # where rounding of the velocities is none that momenta show
    assert (np.abs(missing) <= 1e-9 * np.abs(p).max(axis=0))[:, slow].all()


def test_they_are_the_same_to_the_last_bit_in_other_units() -> None:
    names, unit, action = ["relativistic"], 2.0**-40, 2.0**31
    plain, scaled = (there_and_back(*mixed(names, 3, *units)) for units in ((2.0, 4.0), (2.0 * unit, 4.0 * action)))
    assert (scaled[1] == unit * plain[1]).all()
    assert (scaled[2] == action / unit * plain[2]).all()


def test_the_energy_of_a_fast_particle_is_that_of_its_momentum() -> None:
    """H = sqrt(1 + (p - A)^2), of momenta of any size; and it says what is missing."""
    particle = dyn.System(lambda q, qd, t: -cg.sqrt((1.0 - qd[0]) * (1.0 + qd[0])) + 0.5 * qd[0], "x")
    graph, p = dyn.hamiltonian(particle, check=True), np.concatenate([-SIZES, SIZES])
    out = graph.evaluate({name: {"q0": np.array(0.0), "p0": p + 0.5}[name] for name in graph.input_names})
    assert out["H"] == pytest.approx(np.sqrt(1.0 + p**2), rel=1e-9)
    assert np.abs(out["missing0"][np.abs(p) < 1e3]).max() < 1e-7
    few = dyn.hamiltonian(particle, iterations=3, check=True)
    left = few.evaluate({name: {"q0": 0.0, "p0": 1e3}[name] for name in few.input_names})["missing0"]
    assert left > 1.0


def test_two_charged_particles_at_almost_the_speed_of_light_move_the_same_in_both_forms() -> None:
    """On springs, and coupled: v goes to 0.999, which momenta do not come to in Newton's steps from rest."""
    pair = dyn.System(
        lambda q, qd, t: (
            -cg.sqrt(1.0 - qd[0] ** 2) - 3.0 * cg.sqrt(1.0 - qd[1] ** 2) + 0.2 * q[0] * qd[1]
            - 0.5 * q[0] ** 2 - 0.5 * (q[1] - q[0]) ** 2
        ),
        "x y",
    )  # fmt: skip
    how = {"t_end": 1.0, "method": "dop853", "rtol": 1e-12, "t_eval": [0.5, 1.0]}
    plain, canonical = (
        dyn.simulate(pair, [0.0, 0.0], [0.999, -0.5], form=form, **how) for form in ("velocity", "momentum")
    )
    assert canonical.stats.success
    assert not canonical.stats.warnings
    assert canonical.q == pytest.approx(plain.q, abs=1e-9)
    assert canonical.qd == pytest.approx(plain.qd, abs=1e-9)
    assert canonical.energy == pytest.approx(plain.energy, rel=1e-9)
