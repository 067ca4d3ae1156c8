"""A landing in generated C: clean under strict warnings, sanitizers and valgrind, to the last bit of evaluation."""

import shutil

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.integrators import TABLEAUS
from tests.cgraph.codegen.test_c import CC, STRICT, needs_cc, run
from tests.cgraph.codegen.test_c_small import SANITIZED, SINGLE
from tests.cgraph.engines import evaluated
from tests.ulps import same

H, STEPS, EVERY = 2.0**-13, 4000, 20  # s, and steps; a float has h to the bit

MAIN = """
#include "landing.h"
#include <stdio.h>

int main(void)
{
    %(type)s x[LANDING_N_IN] = {%(start)s}, y[LANDING_N_OUT];
    int row, i;
    for (row = 0; row < %(rows)d; row++) {
        landing(x, y);
        for (i = 0; i < LANDING_N_IN; i++) printf("%%a ", (double)x[i]);
        for (i = 0; i < LANDING_N_OUT; i++) printf("%%a ", (double)y[i]);
        printf("\\n");
        landing_rk4(x, %(h)s, %(every)d);
    }
    return 0;
}
"""


def two_balls() -> tuple[dyn.Mechanism, list[float], list[float]]:
    """A ball that spins falls on the ground, and another on it."""
    moment = 0.4 * 0.1**2
    balls = [dyn.Body(name, dyn.Joint("free"), mass=1.0, inertia=(moment,) * 3) for name in ("low", "high")]
    law = {"radius": 0.1, "stiffness": 1e4, "dissipation": 0.3, "friction": 0.4, "velocity": 0.1}
    contacts = [dyn.Contact("low", **law), dyn.Contact("high", "low", to_radius=0.1, **law)]
    q = [0.0, 0.0, 0.15, 1.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.375, 1.0, 0.0, 0.0, 0.0]
    return dyn.Mechanism(balls, forces=contacts), q, [0.5, 0.0, 0.0, 0.0, 3.0, 0.0] + [0.0] * 6


@needs_cc
@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_landing_in_c_is_that_of_python(dtype, tmp_path):
    model, q, qd = two_balls()
    rate = dyn.state_equation(model)
    single = dtype == "float32"
    start = [*q, *qd] + [0.0] * (len(rate.inputs) - 26)
    texts = [f"{value!r}f" if single else repr(value) for value in start]
    source, _ = cg.to_c(rate, "landing", {"rk4": TABLEAUS["rk4"]}, dtype=dtype).write(tmp_path)
    filled = {"type": "float" if single else "double", "start": ", ".join(texts), "h": f"{H!r}{'f' * single}"}
    (tmp_path / "main.c").write_text(MAIN % (filled | {"rows": STEPS // EVERY, "every": EVERY}))
    printed = []
    for flags in (SANITIZED, ["-O1", "-g"]):
        out = str(tmp_path / f"main{len(printed)}")
        run([CC, *STRICT, *flags, *(SINGLE if single else []), str(source), str(tmp_path / "main.c"), "-o", out, "-lm"])
        printed.append(run([out]))
    if shutil.which("valgrind"):
        printed.append(run(["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", out]))
    assert len(set(printed)) == 1
    table = np.array([[float.fromhex(each) for each in line.split()] for line in printed[0].splitlines()])
    states, rates = np.split(table, [len(rate.inputs)], axis=1)
    expected = evaluated(rate, states)
    depths = 0.1 - states[:, 2], 0.2 - np.linalg.norm(states[:, 7:10] - states[:, :3], axis=1)
    assert all(sum(depth > 0.0) > 3 and sum(depth < 0.0) > 3 for depth in depths)  # both touch, and come apart
    if not single:
        assert same(rates, expected)
        times = EVERY * H * np.arange(len(states))
        motion = dyn.simulate(model, q, qd, float(times[-1]), "rk4", dt=H, t_eval=times)
        assert np.abs(np.hstack([motion.q, motion.qd]) - states[:, :26]).max() < 1e-9
    else:
        assert np.abs(rates - expected).max() < 1e-4 * np.abs(expected).max()
