"""The same bits: a motion computed in every way that there is here."""

import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.scenes import of_model
from dynamics.scenes.start import moving_start
from tests.bits import COMPILER, Motion
from tests.slow import slow
from viz.models.live_motion import adjustable


def pushed():
    """Equations of first order with time and functions."""
    return dyn.OdeSystem(lambda x, t: [x[1], -cg.sin(x[0]) + 0.1 * cg.cos(t) * x[0] ** 2], ["x", "v"])


def oscillator():
    """A motion without a function of the C library."""
    return dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2 - 0.1 * q[0] ** 4 * t, ["x"])


MODELS = {
    "oscillator": oscillator,
    "open masses": lambda: adjustable(dyn.scenes.load("triple_pendulum")).model,  # which a run may not build in
    "triple_pendulum": lambda: dyn.scenes.load("triple_pendulum"),
    "pushed": pushed,
    "free": lambda: dyn.Mechanism([dyn.Body("base", dyn.Joint("free"), mass=2.0, center=[0.1, 0.0, 0.2],
                                            inertia=[[1, 0, 0], [0, 1.5, 0], [0, 0, 2]])]),
}  # fmt: skip


@pytest.mark.parametrize("name", ["pushed", "oscillator", *slow("triple_pendulum", "free", "open masses")])
def test_every_way_has_the_same_bits(name):
    motion = Motion(moving_start(of_model(MODELS[name]())))
    found = motion.digests()
    assert len(set(found.values())) == 1, found
    assert ("simulate by auto" in found) == (name != "free")
    if not motion.calls_library:  # sines of JavaScript are its own
        assert motion.in_javascript() in found.values()


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_another_order_of_sums_is_seen():
    # Of -ffast-math what changes sums: the whole, when linked, has the process drop subnormal numbers from then on.
    loose = ("-O3", "-fassociative-math", "-freciprocal-math", "-fno-signed-zeros", "-fno-trapping-math")
    motion = Motion(dyn.scenes.load("triple_pendulum"))
    assert motion.in_c(("-std=c99", *loose, "-shared", "-fPIC")) != motion.simulated("python")
