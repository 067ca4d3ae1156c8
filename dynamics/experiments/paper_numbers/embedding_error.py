"""Embedding error: that of the by-definition and kinetic-only torques against dt, and its limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import cgraph as cg
from cgraph.extend import Array

from ...equations.formulations.formulations import inverse_dynamics
from ...multibody.builders.planar_arm import planar_arm
from ...systems.model import Model, as_system
from .fit import exponent

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
