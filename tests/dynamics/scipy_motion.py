"""Motions by SciPy's `solve_ivp` on the compiled state equation: a reference that shares no integrator with ours."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

import cgraph as cg
import dynamics as dyn
from cgraph._shared import Array
from dynamics.equations.state_equation import state_inputs


def scipy_states(model: dyn.Mechanism | dyn.System, start: ArrayLike, times: ArrayLike, rtol: float) -> Array:
    """The states (T, m) at times (T,) of the motion from a state (m,) at the first of them, without applied forces."""
    solve_ivp = pytest.importorskip("scipy.integrate").solve_ivp
    inputs, times = state_inputs(model), np.asarray(times)
    numbers = dict(inputs.parameters) | dict.fromkeys(inputs.applied, 0.0)
    graph = cg.specialize(dyn.state_equation(model), numbers)
    rate = cg.compile(graph)
    timed = "t" in graph.input_names

    def f(t: float, x: Array) -> Array:
        return rate([*x, t] if timed else x)

    span = times[0], times[-1]
    run = solve_ivp(f, span, start, "DOP853", times, rtol=rtol, atol=0.1 * rtol)
    return np.asarray(run.y.T)
