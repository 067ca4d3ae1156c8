"""Random models and states for the tests of mechanics, arrays in and out of graphs by coordinate, and ensembles."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

import cgraph as cg
import dynamics as dyn
from dynamics import as_system
from dynamics.systems.model import Model, as_ode

Array = np.ndarray[Any, np.dtype[np.float64]]


def random_arm(n: int, seed: int = 0, model: str = "rod", damped: bool = True) -> dyn.Mechanism:
    """An arm of n unlike links."""
    rng = np.random.default_rng((n, seed))
    masses, lengths = rng.uniform(0.5, 1.5, n).tolist(), rng.uniform(0.5, 1.5, n).tolist()
    return dyn.planar_arm(masses, lengths, rng.uniform(0.1, 0.5, n).tolist() if damped else 0.0, model)


def states(model: Any, count: int, seed: int = 0) -> dict[str, Any]:
    """Random q, qd, qdd, tau, each (count, n), an instant t, and the model's parameters at random values."""
    system = as_system(model)
    rng = np.random.default_rng((system.n, seed))
    result: dict[str, Any] = {"q": rng.uniform(-3.0, 3.0, (count, system.n))}
    result |= {name: rng.uniform(-0.9, 0.9, (count, system.n)) for name in ("qd", "qdd", "tau")}
    return result | {"t": 0.7} | {name: rng.uniform(0.5, 1.5) for name in system.parameters}


def split_state(model: Model, x: Sequence[float]) -> tuple[Sequence[float], Sequence[float] | None]:
    """A state (m,) as the arguments q and qd; of an OdeSystem the state and None."""
    nq = len(model.coordinates)
    return (x, None) if as_ode(model) is not None else (x[:nq], x[nq:])


def arms(count: int, n: int = 2) -> tuple[dyn.Mechanism, Array, Array]:
    """An arm and starts of an ensemble."""
    rng = np.random.default_rng(count)
    return random_arm(n), rng.uniform(-2.0, 2.0, (count, n)), rng.normal(size=(count, n))


def same(a: dyn.Ensemble, b: dyn.Ensemble) -> bool:
    """To the last bit, NaN included."""
    arrays = [(x.t, x.q, x.qd, x.stats.steps, x.stats.nfev, x.stats.rejected, x.stats.dt) for x in (a, b)]
    equal = all(np.array_equal(x, y, equal_nan=True) for x, y in zip(*arrays, strict=True))
    return equal and a.stats.message == b.stats.message


def at(state: Mapping[str, Any], row: int) -> dict[str, Any]:
    """One of many states: rows of the arrays, and what all have in common."""
    return {name: value[row] if isinstance(value, np.ndarray) else value for name, value in state.items()}


def named(state: Mapping[str, Any]) -> dict[str, Any]:
    """A state by input name: q, (n,) or (count, n), gives q0, q1, ...; q_old gives q0_old, ...; numbers stay."""
    result: dict[str, Any] = {}
    for name, value in state.items():
        if isinstance(value, np.ndarray):
            stem, old = name.removesuffix("_old"), "_old" if name.endswith("_old") else ""
            columns = value.tolist() if value.ndim == 1 else value.T
            result |= {f"{stem}{i}{old}": column for i, column in enumerate(columns)}
        else:
            result[name] = value
    return result


def inputs(graph: cg.Graph, state: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a state that the graph has inputs for."""
    return {name: value for name, value in named(state).items() if name in graph.input_names}


def run(graph: cg.Graph, state: Mapping[str, Any]) -> Array:
    """The outputs of the graph at one state, (n_out,), or at many, (count, n_out)."""
    return np.stack(list(graph.evaluate(inputs(graph, state)).values()), axis=-1)


def before(state: Mapping[str, Any], dt: float) -> dict[str, Any]:
    """The state before the step of length dt that ends in `state`, as the embedded formulations take it."""
    q, qd, qdd = (state[name] for name in ("q", "qd", "qdd"))
    return {**state, "q_old": q - dt * qd, "qd_old": qd - dt * qdd, "dt": dt}


def error(value: Array, reference: Array) -> float:
    """The largest difference, relative to the largest entry of the reference at the same state; over all states."""
    difference = np.abs(value - reference).max(axis=-1)
    return float(np.max(difference / np.abs(reference).max(axis=-1)))


def oscillator(**options: Any) -> dyn.System:
    """A mass on a spring, parameters m and k."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * p["m"] * qd[0] ** 2 - 0.5 * p["k"] * q[0] ** 2,
        ["x"],
        {"m": 2.0, "k": 3.0} | options.pop("parameters", {}),
        **options,
    )


def coupled_springs() -> dyn.System:
    """Two masses, m and 1 kg, between three springs, with damping, and a force that depends on everything."""
    return dyn.System(
        lambda q, qd, t, p: (
            0.5 * p["m"] * qd[0] ** 2 + 0.5 * qd[1] ** 2 - 0.5 * p["k"] * (q[0] ** 2 + (q[1] - q[0]) ** 2 + q[1] ** 2)
        ),
        ["left", "right"],
        {"m": 1.3, "k": 2.0},
        forces=lambda q, qd, t, p: [p["k"] * cg.sin(t) * q[1], 0.1 * qd[0] * qd[1]],
        damping=[0.2, 0.3],
    )


def cart_pendulum() -> dyn.System:
    """A pendulum hung from a cart on a spring: a slide and a hinge."""

    def lagrangian(q: Any, qd: Any, t: Any) -> list[cg.Node]:
        x, y = qd[0] + 0.8 * qd[1] * cg.cos(q[1]), 0.8 * qd[1] * cg.sin(q[1])
        return [0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, 0.35 * (x * x + y * y) + 0.7 * 9.81 * 0.8 * cg.cos(q[1])]

    return dyn.System(lagrangian, ["cart", "pendulum"])


def driven_pendulum() -> dyn.System:
    """A pendulum whose pivot shakes sideways: a Lagrangian with explicit time, a sin(w t) being the pivot's place."""

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> cg.Node:
        pivot = p["a"] * p["w"] * cg.cos(p["w"] * t)
        return 0.5 * (qd[0] ** 2 + 2.0 * qd[0] * pivot * cg.cos(q[0]) + pivot**2) + 9.81 * cg.cos(q[0])

    return dyn.System(lagrangian, ["angle"], {"a": 0.2, "w": 3.0}, damping=0.1)


def magnetic() -> dyn.System:
    """A charged particle in a magnetic field B along z, unit charge: terms linear in velocity."""
    return dyn.System(
        lambda q, qd, t, p: (
            0.5 * p["m"] * (qd[0] ** 2 + qd[1] ** 2) + 0.5 * p["B"] * (q[0] * qd[1] - q[1] * qd[0]) - 0.1 * q[0] ** 4
        ),
        ["x", "y"],
        {"m": 1.0, "B": 2.0},
    )


def relativistic() -> dyn.System:
    """A relativistic particle under a constant force, c = 1.7: a kinetic energy that is not quadratic."""
    return dyn.System(
        lambda q, qd, t, p: (
            -p["m"] * 1.7**2 * cg.sqrt(1.0 - (qd[0] ** 2 + qd[1] ** 2) / 1.7**2) + p["F"] * q[0] - 0.3 * q[1] ** 2
        ),
        ["x", "y"],
        {"m": 1.0, "F": 0.5},
    )


MODELS: dict[str, Callable[[], Any]] = {
    "arm of 1": lambda: random_arm(1),
    "arm of 2": lambda: random_arm(2),
    "arm of 3": lambda: random_arm(3),
    "arm of 3 points": lambda: random_arm(3, model="point"),
    "arm of 6": lambda: random_arm(6, damped=False),
    "coupled springs": coupled_springs,
    "cart pendulum": cart_pendulum,
    "driven pendulum": driven_pendulum,
    "magnetic": magnetic,
    "relativistic": relativistic,
}
MODELS = {name: cache(make) for name, make in MODELS.items()}  # one model, which keeps what is derived of it
