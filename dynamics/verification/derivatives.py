"""Derivatives of the equations, closed forms and linearizations, beside forward mode along a line."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array, tangents

from ..equations.equations_of_motion import forward_dynamics
from ..equations.linearization.inverse_dynamics_derivatives import inverse_dynamics_derivatives
from ..equations.linearization.linearization import state_space
from ..systems.kinematics import ZERO
from ..systems.system import System
from .residual import ROUNDING, Residual, worst


def derivative_residuals(
    system: System, value: Callable[[Graph], Array], inverse: Graph, inertia: Array, rng: np.random.Generator
) -> Iterator[Residual]:
    """Of the torques, and of the accelerations, times M, which is how far their equation is from holding.

    value: numbers of a graph at the states, (N, n_out).  inverse: of inverse dynamics.  inertia: M, (N, n, n).
    """
    n = system.n
    line = rng.normal(size=4 * n)  # dxi, dqd, dqdd and dtau
    xi, v, a, f = ([cg.constant(float(x)) for x in part] for part in np.split(line, 4))
    seeds = dict(zip([*system.q, *system.qd], [*system.kinematics.rate(xi), *v], strict=True))

    def along(graph: Graph, more: dict[cg.Node, cg.Node]) -> Array:
        """The first n outputs' slopes."""
        outputs = list(graph.outputs.values())[:n]
        dots = tangents(seeds | more, outputs)
        slopes = {f"{i}": dots.get(node, ZERO) for i, node in enumerate(outputs)}
        return value(system.graph(slopes, system.q, system.qd, list(more)))

    pushed = along(inverse, dict(zip(system.qdd, a, strict=True)))
    entries = value(inverse_dynamics_derivatives(system))[:, n:].reshape(-1, 3, n, n)
    terms = np.swapaxes(entries, 1, 2).reshape(-1, n, 3 * n) * line[: 3 * n]
    equation = "derivatives: dtau/dq, dtau/dqd and M along a line = AD of inverse dynamics"
    yield Residual(equation, worst(terms.sum(axis=-1) - pushed, np.abs(terms).sum(axis=-1)), ROUNDING)
    pushed = along(forward_dynamics(system), dict(zip(system.tau, f, strict=True)))
    matrices = value(state_space(system))
    a_rows, b_rows = matrices[:, : 4 * n * n].reshape(-1, 2 * n, 2 * n), matrices[:, 4 * n * n :].reshape(-1, 2 * n, n)
    terms = np.concatenate([a_rows, b_rows], axis=-1)[:, n:] * np.delete(line, np.s_[2 * n : 3 * n])
    missed = inertia @ (terms.sum(axis=-1) - pushed)[..., None]
    sizes = np.abs(inertia) @ np.abs(terms).sum(axis=-1)[..., None]
    equation = "derivatives: A and B of the linearization along a line = AD of forward dynamics"
    yield Residual(equation, worst(missed[..., 0], sizes[..., 0]), ROUNDING)
