"""The bench: every peer that is installed does every task it offers, and its figures are told as they are."""

from __future__ import annotations

import json
from copy import copy
from functools import cache, partial

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.linearization import linearize_many
from dynamics.experiments.timing import machine
from dynamics.io.mujoco_twin import MujocoTwin
from tests.bench.peers import PeerModel, UnavailableError, ours
from tests.bench.peers.ours import with_inertial_parameters
from tests.bench.peers.peer import BATCH, DERIVATIVES, DT, MOTIONS, NUDGE, PASSES
from tests.bench.peers.translate import translated
from tests.bench.speed import bench as module
from tests.bench.speed.bench import MODES, PEERS, TASKS, Cell, Row, WorkerPool, bench, tables
from tests.bench.speed.scenes import SCENES, free_tree, load
from tests.bench.speed.worker import Prepared, Refused, Worker
from tests.bench.tables import digits
from tests.each_row import each_row
from viz import cli

ROUNDING = 1e-10  # of a loop: the motion is that much larger than the last bit of the state it is taken from
DIFFERENCES = (
    1e-8  # of quotients of differences, with steps of 5e-4: their rounding is 1e-12, what they leave out 1e-10
)
SCALAR = 1e-12  # relative: one coordinate, a few operations
PATIENT = 1e3  # s: a budget that a loaded machine does not exceed; a test has a limit of its own


def tree() -> dyn.Mechanism:
    """A branched mechanism with springs, armature and a slide, in an order that MuJoCo does not keep."""
    parents = ("world", "a", "a", "b", "b")
    bodies = [
        dyn.Body(
            name,
            dyn.Joint(
                "prismatic" if name == "d" else "revolute",
                axis=(0.0, 1.0, 0.5),
                position=(0.1, 0.2, -0.3),
                damping=0.2,
                stiffness=1.5,
                spring_reference=0.3,
                armature=0.05,
            ),
            parent,
            mass=1.2,
            center=(0.05, 0.02, -0.1),
            inertia=(0.02, 0.03, 0.025),
        )
        for name, parent in zip("abcde", parents, strict=True)
    ]
    return dyn.Mechanism(bodies)


class Reference:
    """MuJoCo asked at single states, with steps and loops written out here."""

    def __init__(self, case: PeerModel) -> None:
        pytest.importorskip("mujoco")
        self.n, self.twin = case.n, MujocoTwin(case.model)
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


def values(graph):
    """A function of a vector of numbers, which may be complex."""

    def function(x):
        found = translated(graph.nodes, dict(zip(graph.inputs, x, strict=True)), np)
        return np.array([found[node] for node in graph.outputs.values()])

    return function


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
    if task == "inertial-gradient":
        assert len(found) == len(x) + 10 * case.n


def test_a_gradient_by_inertial_numbers_is_that_of_motions_with_other_numbers():
    case = planar()
    _, found = prepared("ours", case, "inertial-gradient", "call")
    model, numbers = with_inertial_parameters(case.model)
    q, qd, tau = np.split(case.point("gradient"), [3, 6])
    given = {"t_end": PASSES * DT, "tau": tau.reshape(PASSES, 3), "wrt": "q"}
    weights = np.random.default_rng(4).uniform(size=(3, 10))
    weights[:, 4:] = weights[:, 4:5]  # inertias as a whole, so that they stay those of bodies
    along = 0.3 * weights.ravel() * [*numbers.values()]

    def loss(scale):
        values = dict(zip(numbers, [*numbers.values()] + scale * along, strict=True))
        return dyn.gradient(
            model, lambda q, qd, t: q[0] ** 2 + q[1] ** 2 + q[2] ** 2, q, qd, parameters=values, **given
        ).value

    expected = slope(loss, 0.0, 1.0, h=1e-2)
    assert found[len(case.point("gradient")) :] @ along == pytest.approx(expected, rel=DIFFERENCES)


@cache
def branched():
    return PeerModel("tree", tree())


@each_row(
    ("name", "task"),
    [
        (name, task)
        for name in ("ours", "casadi", "pinocchio", "mujoco")
        for task in TASKS
        if (task, "call") in PEERS[name].offers and task not in MOTIONS
    ],
    by="name",
)
def test_a_peer_knows_springs_armature_slides_and_the_order_of_joints(name, task):
    case = branched()
    _, found = prepared(name, case, task, "call")
    x = case.point(task)
    assert difference(found, Reference(case).value(task, x), x if task == "rk4" else 0.0) < rounding(task)


@pytest.mark.parametrize("task", DERIVATIVES)
@pytest.mark.parametrize("name", ["ours", "casadi", "pinocchio"])
def test_slopes_of_a_free_base_are_those_along_its_displacements(name, task):
    limb = dyn.Joint("revolute", axis=(0.0, 1.0, 0.5), damping=0.2, stiffness=1.5, spring_reference=0.3, armature=0.05)
    kwargs = {"center": (0.05, 0.02, -0.1), "inertia": (0.02, 0.03, 0.025)}
    base = dyn.Body("base", dyn.Joint("free", damping=0.3, armature=0.07), mass=1.2, **kwargs)
    case = PeerModel("free", dyn.Mechanism([base, dyn.Body("limb", limb, "base", mass=0.8, **kwargs)]))
    _, found = prepared(name, case, task, "call")
    make = {"inverse": dyn.inverse_dynamics, "forward": dyn.forward_dynamics}[DERIVATIVES[task]]
    function, rate = (values(case.bound(each(case.model))) for each in (make, dyn.state_equation))
    x, nq, n = case.point(task), case.nq, case.n
    along = np.zeros((3 * n, len(x)))  # unit displacements, then unit velocities and last arguments
    for j in range(n):
        along[j, :nq] = rate([*x[:nq], *np.eye(n)[j], *np.zeros(n)])[:nq]
    along[n:, nq:] = np.eye(2 * n)
    columns = [function(x + 1e-30j * each) for each in along]
    assert difference(found, 1e30 * np.imag(columns).T.ravel()) < SCALAR


@pytest.mark.parametrize(("model", "mode"), [(free_tree(7), "call"), (free_tree(7), "batch"), (tree(), "call")])
def test_derivatives_of_a_large_model_by_one_piece_of_code_for_all_columns(model, mode, monkeypatch):
    case = PeerModel("a model", model)
    expected = prepared("ours", case, "derivatives", mode)[1]
    for each in (ours, linearize_many):
        monkeypatch.setattr(each, "WRITTEN_OUT", 0)
    cg.clear_caches()
    peer.cache_clear()
    assert difference(prepared("ours", case, "derivatives", mode)[1], expected) < SCALAR


def test_a_model_with_quaternions_has_no_motions():
    with pytest.raises(ValueError, match=r"on free 35; .* not of models with quaternions"):
        list(bench(["free 35"], MOTIONS))


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
    if name in ("heyoka", "sympy", "torch") or (name, task) == ("pinocchio", "rk4"):
        with pytest.raises(UnavailableError, match="rates of"):
            prepared(name, case, task, mode)
        return
    x = case.points(task)
    if mode == "batch":
        found, expected = prepared(name, case, task, mode)[1], ours[task]
    else:
        found, expected, x = prepared(name, one, task, mode)[1], ours[task][:, 0], x[:, 0]
    assert difference(found, expected, x if task == "rk4" else 0.0) < ROUNDING


@pytest.mark.parametrize("name", [name for name in PEERS if name != "torch"])
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


def test_a_system_that_depends_on_time_is_refused():
    driven = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + t * q[0], coordinates=["x"])
    with pytest.raises(ValueError, match="depends on time"):
        PeerModel("driven", driven)


def test_a_worker_that_is_late_is_ended_and_not_asked_for_what_contains_the_same():
    late: dict[str, str] = {}
    pool, skipped = WorkerPool(partial(load, "planar 3"), ["ours"], 1e-3, late), {}
    assert pool.prepared("forward", "call", skipped) == {}
    assert skipped == late == {"ours": "not ready within 0.001 s"}
    assert not pool.workers["ours"].alive
    assert WorkerPool(partial(load, "planar 3"), ["ours"], 60.0, late).prepared("rk4", "call", again := {}) == {}
    assert again == skipped


def test_a_worker_answers_and_is_timed_and_if_it_dies_it_is_told():
    worker = Worker(partial(load, "planar 3"), "ours")
    answer = worker.prepare("forward", "call", budget=PATIENT)
    assert isinstance(answer, Prepared)
    assert answer.values.shape == (3,)
    assert worker.turn("forward", "call") > 0.0
    worker._process.kill()
    with pytest.raises(RuntimeError, match="its process ended with status -"):
        worker.turn("forward", "call")
    assert isinstance(worker.prepare("inverse", "call", budget=PATIENT), Refused)
    worker.end()


def test_what_a_peer_s_own_code_raises_is_a_reason():
    worker = Worker(partial(load, "spring_mass"), "mujoco")
    pytest.importorskip("mujoco")
    try:
        assert worker.prepare("forward", "call", 60.0) == Refused("takes rigid bodies, not a Lagrangian")
        assert worker.alive
    finally:
        worker.end()
    assert not worker.alive


@each_row(
    ("choice", "said"),
    [
        ({"scenes": ["planar 4"]}, "there is no scene 'planar 4'"),
        ({"scenes": ["missing.xml"]}, "missing.xml"),
        ({"tasks": ["statics"]}, "there is no task 'statics'"),
        ({"modes": ["gpu"]}, "there is no mode 'gpu'"),
        ({"peers": ["matlab"]}, "there is no peer 'matlab'"),
        ({"budget": 0.0}, "the budget must be positive, got 0.0 s"),
        ({"scenes": ["free 35"], "tasks": ["motion"]}, "nothing to measure of motion in the modes .* on free 35"),
        ({"scenes": ["planar 3"], "tasks": ["gradient"], "modes": ["batch"]}, "nothing to measure of gradient"),
        ({"scenes": ["spring_mass"], "tasks": ["inertial-gradient"]}, "nothing to measure of .* without bodies"),
    ],
)
def test_a_wrong_choice_is_told_before_anything_is_measured(choice, said):
    with pytest.raises(ValueError, match=said):
        bench(**choice)


def cell(micros, difference=1e-15):
    return Cell(micros, 0.9 * micros, 1.2 * micros, 0.25, difference, 230)


def row(scene, skipped=None, **cells):
    cells = {name.replace("_", "-"): each for name, each in cells.items()}
    return Row(scene, "forward", "call", 3, cells, skipped or {})


def test_the_fastest_is_marked_and_ratios_are_of_ours():
    lines = tables([row("planar 3", ours=cell(0.2, 0.0), casadi_gcc=cell(0.1), mujoco=cell(3.0))]).splitlines()
    (line,) = [line for line in lines if line.startswith("planar 3  0")][:1]
    assert line.split() == ["planar", "3", "0.200", "0.100", "[0.50]*", "3.00", "[15]"]


@pytest.mark.parametrize("bad", [1.1e-8, float("nan"), float("inf")])
def test_a_peer_that_disagrees_is_flagged_wherever_it_stands(bad):
    text = tables([row("planar 3", ours=cell(0.2, 0.0), casadi=cell(0.4, bad), mujoco=cell(3.0))])
    assert "0.400 [2.0]!" in text
    assert text.split("Largest difference")[1].count("!") == 1
    assert "!" not in tables([row("planar 3", ours=cell(0.2, 0.0), casadi=cell(0.4, 1e-9))]).split("\n\n", 2)[2]


def test_what_was_not_measured_has_its_reason_below():
    late = {"jax": "not ready within 60 s", "sympy": "not ready within 60 s", "heyoka": "broken"}
    text = tables([row("arm 7", late, ours=cell(0.4, 0.0)), row("planar 3", ours=cell(0.2, 0.0), jax=cell(5.0))])
    (line,) = [line for line in text.splitlines() if line.startswith("arm 7     0.400")]
    assert line.split() == ["arm", "7", "0.400", "*", "-", "a"]
    assert "a: not ready within 60 s" in text
    assert "without sympy: not ready within 60 s" in text
    assert "without heyoka: broken" in text


def test_a_row_without_ours_says_so_and_has_no_ratios():
    late = {"ours": "not ready within 1 s"}
    text = tables([row("arm 7", late, mujoco=cell(3.0, None)), row("planar 3", ours=cell(0.2, 0.0), mujoco=cell(3.0))])
    (line,) = [line for line in text.splitlines() if line.startswith("arm 7") and "3.00" in line][:1]
    assert line.split() == ["arm", "7", "-", "a", "3.00", "*"]
    assert "a: not ready within 1 s" in text
    assert "without ours: not ready within 1 s" in tables([row("arm 7", late)])


def test_the_bench_goes_on_without_ours(monkeypatch):
    rows = [Prepared(0.1, np.ones(2), 3), Refused("not ready within 1 s")]
    pool = WorkerPool(None, ["mujoco", "ours"], 1.0, {})
    answers = dict(zip(pool.peers, rows, strict=True))

    class Answering:
        alive = False

        def __init__(self, _, peer):
            self.prepare = lambda *_: answers[peer]
            self.turn = lambda *_: 1e-6

    monkeypatch.setattr(module, "Worker", Answering)
    found = module._row(PeerModel("planar 3", SCENES["planar 3"]()), "forward", "call", pool, 3)
    assert found.skipped == {"ours": "not ready within 1 s"}
    assert found.cells["mujoco"].difference is None


def test_tables_fit_a_terminal_of_120_columns():
    cells = {name.replace("-", "_"): cell(12345.678) for name in PEERS}
    text = tables([row(scene, **cells) for scene in SCENES], machine())
    assert max(map(len, text.splitlines())) <= 120
    assert all(name in text for name in PEERS)
    assert text.startswith(machine()[:30])


@pytest.mark.parametrize(
    ("value", "count", "said"),
    [(0.006244, 3, "0.00624"), (1343.9, 3, "1344"), (2.46, 2, "2.5"), (0.999, 2, "1.00"), (0.0, 2, "0.0")],
)
def test_numbers_have_their_digits_and_no_exponent(value, count, said):
    assert digits(value, count) == said


def test_the_bench_sets_ours_beside_its_peers(capsys):
    pytest.importorskip("mujoco")
    command = ["bench", "planar 3", "--tasks", "forward", "--modes", "call,batch", "--peers", "mujoco,ours-numpy"]
    assert cli.main([*command, "--quick", "--budget", str(PATIENT), "--json"]) == 0
    call, batch = json.loads(capsys.readouterr().out)["rows"]
    assert (call["scene"], call["task"], call["mode"], call["coordinates"]) == ("planar 3", "forward", "call", 3)
    assert set(call["cells"]) == {"ours", "mujoco"}
    assert set(batch["cells"]) == {"ours", "ours-numpy"}
    for one in (*call["cells"].values(), *batch["cells"].values()):
        assert one["low"] <= one["micros"] <= one["high"]
        assert one["made"] > 0.0
        assert one["difference"] <= module.AGREES
    nodes = len(dyn.forward_dynamics(SCENES["planar 3"]()).nodes)
    assert call["cells"]["ours"]["size"] == nodes


def test_without_llvmlite_our_graph_is_called_python_and_the_extra_is_named(without) -> None:
    row = Row("planar 3", "forward", "call", 3, {"ours": Cell(1.0, 1.0, 1.0, 0.1, 0.0, 90)})
    assert "our graph as machine code" in tables([row])
    without("llvmlite")
    text = " ".join(tables([row]).split())
    assert "our graph as generated Python; machine code needs llvmlite: in a checkout of cgraph, pip" in text
    assert "as machine code" not in text
