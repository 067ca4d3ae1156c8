"""Other software on our models: every peer finds what MuJoCo finds, and moves a free base as we do."""

from copy import copy
from functools import cache

import numpy as np
import pytest

import dynamics as dyn
from dynamics.verification.residual import UnavailableError
from tests.agreement.agreement import QUANTITIES, differences, random_arm
from tests.bench.peers import PEERS, PeerModel
from tests.bench.peers.peer import BATCH, DERIVATIVES, DT, MODES, MOTIONS, NUDGE, PASSES, TASKS
from tests.bench.speed.scenes import free_tree, load
from tests.each_row import each_row
from tests.mujoco_twin import AskedTwin

ROUNDING = 1e-10  # of a loop: the motion is that much larger than the last bit of the state it is taken from
# Of quotients of differences, with steps of 5e-4: their rounding is 1e-12, what they leave out 1e-10.
DIFFERENCES = 1e-8
SCALAR = 1e-12  # relative: one coordinate, a few operations
POINTS = 1e-11  # of point masses, whose inertia MuJoCo's format does not take as exactly zero


class Reference:
    """MuJoCo asked at single states, with steps and loops written out here."""

    def __init__(self, case: PeerModel) -> None:
        pytest.importorskip("mujoco")
        self.n, self.twin = case.n, AskedTwin(case.model)
        names = case.model.coordinates
        self.order = np.array([self.twin.model.joint(name).id for name in names])

    def value(self, task, x):
        if task in DERIVATIVES:
            columns = [slope(lambda x: self.value(DERIVATIVES[task], x), x, unit) for unit in np.eye(len(x))]
            return np.array(columns).T.ravel()
        at = np.argsort(self.order)
        if task == "motion":
            state = x[: 2 * self.n]
            for tau in x[2 * self.n :].reshape(PASSES, self.n):
                state = self.step(state, tau)
            return state
        if task != "rk4":
            blocks = [block[at] for block in np.split(x, 3)]
            return (self.twin.inverse if task == "inverse" else self.twin.accelerations)(*blocks)[self.order]
        return self.step(x, np.zeros(self.n))

    def step(self, x, tau):
        def rate(x):
            return np.concatenate([x[self.n :], self.value("forward", np.concatenate([x, tau]))])

        a = rate(x)
        b = rate(x + DT / 2 * a)
        c = rate(x + DT / 2 * b)
        d = rate(x + DT * c)
        return x + DT / 6 * (a + 2 * b + 2 * c + d)

    def after_loop(self, task, x):
        for _ in range(PASSES):
            x = self.value(task, x) if task == "rk4" else x + NUDGE * np.tile(self.value(task, x), 3)
        return x


def slope(function, x, direction, h=5e-4):
    """By differences of the fourth order."""
    near, far = (function(x + k * h * direction) - function(x - k * h * direction) for k in (1, 2))
    return (8.0 * near - far) / (12.0 * h)


def rounding(task):
    return DIFFERENCES if task in DERIVATIVES else ROUNDING


def difference(found, expected, start=0.0):
    return np.abs(found - expected).max() / np.abs(expected - start).max()


@cache
def planar():
    """Three links, which keep what peers derive of them."""
    return PeerModel("planar 3", load("planar 3").model)


@cache
def peer(name, case):
    return PEERS[name].make(case)


def prepared(name, case, task, mode):
    pytest.importorskip(PEERS[name].package)
    contender = peer(name, case).prepare(task, mode)
    return contender, contender.result(contender.run())


CALLED = ("inverse", "forward")
OFFERED = [
    pytest.param(name, task, mode, marks=[pytest.mark.slow] if name == "jax" and task not in CALLED else [])
    for name, kind in PEERS.items()
    for task in TASKS
    for mode in MODES
    if (task, mode) in kind.offers
]


@each_row(("name", "task", "mode"), [each for each in OFFERED if "gradient" not in each.values[1]], by="name")
def test_a_peer_finds_what_mujoco_finds(name, task, mode):
    case = planar()
    reference, x = Reference(case), case.point(task)
    _, found = prepared(name, case, task, mode)
    if mode == "batch":
        points = case.points(task)
        rows = 2 * case.n if task == "rk4" else case.n
        assert found.shape == (rows * 3 * case.n if task in DERIVATIVES else rows, BATCH)
        for column in (0, 1, BATCH - 1):
            start = points[:, column] if task == "rk4" else 0.0
            assert difference(found[:, column], reference.value(task, points[:, column]), start) < rounding(task)
    elif mode == "loop":
        assert difference(found, reference.after_loop(task, x), x) < ROUNDING
    else:
        start = x[: len(found)] if task in ("rk4", "motion") else 0.0
        assert difference(found, reference.value(task, x), start) < rounding(task)


@pytest.fixture(scope="module")
def pushed():
    """Directions of the start and of the torques, and how far |q|^2 of MuJoCo's motion goes along them."""
    case = planar()
    reference, x, n = Reference(case), case.point("gradient"), case.n
    start, torques = np.zeros((2, len(x)))
    start[: 2 * n], torques[2 * n :] = [0.3, -0.5, 0.2, 1.0, 0.4, -0.7], np.resize([1.0, -1.5, 0.5], PASSES * n)

    def loss(x):
        return (reference.value("motion", x)[:n] ** 2).sum()

    return case, [(start, slope(loss, x, start)), (torques, slope(loss, x, torques, h=0.5))]


@pytest.mark.parametrize(("name", "task", "mode"), [each for each in OFFERED if "gradient" in each.values[1]])
def test_a_gradient_is_the_slope_of_mujoco_s_motion(name, task, mode, pushed):
    case, slopes = pushed
    _, found = prepared(name, case, task, mode)
    x = case.point(task)
    for direction, expected in slopes:
        assert found[: len(x)] @ direction == pytest.approx(expected, rel=DIFFERENCES)


@pytest.fixture(scope="module")
def floating():
    """A free base with a link, the same at the first state of a batch, and results of our code without LLVM at all."""
    case = PeerModel("free", free_tree(7))
    one = copy(case)
    one.point = lambda task: case.points(task)[:, 0].copy()
    return case, one, {task: prepared("ours-numpy", case, task, "batch")[1] for task in TASKS if task not in MOTIONS}


@each_row(
    ("name", "task", "mode"),
    [
        pytest.param(
            *each.values,
            marks=[pytest.mark.slow] if each.values[0] == "casadi-gcc" and each.values[1] in DERIVATIVES else [],
        )
        for each in OFFERED
        if not {"loop", "jax", *MOTIONS} & set(each.values)
    ]
    + [pytest.param("jax", task, "batch", marks=pytest.mark.slow) for task in CALLED],
    by="name",
)
def test_a_peer_moves_a_free_base_as_we_do(name, task, mode, floating):
    case, one, ours = floating
    if name == "heyoka" or (name, task) == ("pinocchio", "rk4"):
        with pytest.raises(UnavailableError, match="rates of"):
            prepared(name, case, task, mode)
        return
    x = case.points(task)
    if mode == "batch":
        found, expected = prepared(name, case, task, mode)[1], ours[task]
    else:
        found, expected, x = prepared(name, one, task, mode)[1], ours[task][:, 0], x[:, 0]
    assert difference(found, expected, x if task == "rk4" else 0.0) < ROUNDING


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_takes_parameters_and_applied_forces(name):
    system = dyn.System(
        lambda q, qd, t, p: 0.5 * p["I"] * qd[0] ** 2 - 0.5 * p["k"] * q[0] ** 2,
        coordinates=["theta"],
        parameters={"I": 2.0, "k": 3.0},
        forces=lambda q, qd, t, p: [p["k"] * qd[0] ** 2],
        damping=0.5,
    )
    case = PeerModel("rotor", system)
    mode = "batch" if name == "ours-numpy" else "call"
    if name in ("pinocchio", "mujoco"):
        with pytest.raises(UnavailableError, match="rigid bodies"):
            prepared(name, case, "forward", mode)
        return
    _, found = prepared(name, case, "forward", mode)
    q, qd, tau = case.points("forward") if mode == "batch" else case.point("forward")
    assert np.ravel(found) == pytest.approx(np.ravel((tau + 3.0 * qd**2 - 0.5 * qd - 3.0 * q) / 2.0), rel=SCALAR)


@pytest.mark.parametrize("mass_model", ["rod", "point"])
@pytest.mark.parametrize("peer", ["mujoco", "pinocchio"])
def test_arms_agree_with_peers(peer, mass_model):
    pytest.importorskip(PEERS[peer].package)
    arm = random_arm(4, mass_model)
    worst = differences(arm, PEERS[peer].make(PeerModel(peer, arm)), 5)
    assert set(worst) == set(QUANTITIES)
    assert max(worst.values()) < POINTS
