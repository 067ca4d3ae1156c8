"""The bench of tasks: what is late is ended, what disagrees is flagged, and its figures are told as they are."""

import json
from functools import partial

import pytest

import dynamics as dyn
from tests.bench import __main__ as command
from tests.bench.speed import bench as module
from tests.bench.speed.bench import Cell, Row, WorkerPool, bench, tables
from tests.bench.speed.scenes import SCENES, load
from tests.bench.speed.worker import Prepared, Refused, Worker
from tests.each_row import each_row

PATIENT = 1e3  # s: a budget that a loaded machine does not exceed; a test has a limit of its own


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


@each_row(
    ("choice", "said"),
    [
        ({"scenes": ["planar 4"]}, "there is no scene 'planar 4'"),
        ({"tasks": ["statics"]}, "there is no task 'statics'"),
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


@pytest.mark.parametrize("bad", [1.1e-8, float("nan"), float("inf")])
def test_a_peer_that_disagrees_is_flagged_wherever_it_stands(bad):
    text = tables([row("planar 3", ours=cell(0.2, 0.0), casadi=cell(0.4, bad), mujoco=cell(3.0))])
    assert "0.400 [2.0]!" in text
    assert text.split("Largest difference")[1].count("!") == 1
    assert "!" not in tables([row("planar 3", ours=cell(0.2, 0.0), casadi=cell(0.4, 1e-9))]).split("\n\n", 2)[2]


def test_the_bench_sets_ours_beside_its_peers(capsys):
    pytest.importorskip("mujoco")
    arguments = ["planar 3", "--tasks", "forward", "--modes", "call,batch", "--peers", "mujoco,ours-numpy"]
    assert command.main([*arguments, "--quick", "--budget", str(PATIENT), "--json"]) == 0
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
