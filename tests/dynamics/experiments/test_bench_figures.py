"""The figures of the bench beside speed: variants compute the same, peers agree, and commands say what they take."""

from __future__ import annotations

import shutil
import time
from functools import partial
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.experiments.clock import in_turns, spent
from dynamics.experiments.speed import closed_chains, ensembles, reconfiguration, stages
from dynamics.experiments.speed.agreement import QUANTITIES, differences, random_arm
from dynamics.experiments.speed.bench_figures import FIGURES
from dynamics.experiments.speed.bench_scenes import turned_arm
from dynamics.experiments.speed.node_counts import VARIANTS
from dynamics.experiments.text_table import WIDTH, csv_text, table
from dynamics.peers import PEERS, PeerModel
from tests.dynamics.figures import balanced_order, both_forms, parallel_c
from viz import cli

ROUNDING = 1e-11  # relative, of accelerations of seven bodies by another order of operations
POINTS = 1e-11  # of point masses, whose inertia MuJoCo's format does not take as exactly zero


def accelerations(graph: Any) -> Any:
    x = np.random.default_rng(3).normal(size=len(graph.inputs))
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, x.tolist(), strict=True))).values()))


@pytest.mark.parametrize("name", VARIANTS)
def test_a_variant_computes_the_same_with_other_nodes(name: str) -> None:
    variant = VARIANTS[name]
    model = _planar() if variant.planar else turned_arm(7)
    base, other = dyn.forward_dynamics(model, "recursive"), variant.graph(model)
    assert accelerations(other) == pytest.approx(accelerations(base), rel=ROUNDING)
    assert (len(other.nodes) > len(base.nodes)) is (name not in ("every idea", "dense"))  # dense is smaller at seven


@pytest.mark.parametrize("mass_model", ["rod", "point"])
@pytest.mark.parametrize("peer", ["mujoco", "pinocchio"])
def test_arms_agree_with_peers(peer: str, mass_model: str) -> None:
    pytest.importorskip(PEERS[peer].package)
    arm = random_arm(4, mass_model)
    made: Any = PEERS[peer].make(PeerModel(peer, arm))
    worst = differences(arm, made, 5)
    assert set(worst) == set(QUANTITIES)
    assert max(worst.values()) < POINTS


def test_pendulums_of_an_ensemble_end_where_those_of_mujoco_and_jax_do() -> None:
    q, qd = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3, 3))
    expected = ensembles.ours(q, qd)()
    for name in ("mujoco", "jax"):
        if PEERS[name].installed:
            assert getattr(ensembles, name)(q, qd)() == pytest.approx(expected, rel=1e-9, abs=1e-9)  # 1000 steps


def test_the_time_to_compile_is_told_by_stages_of_a_chain(capsys: pytest.CaptureFixture[str]) -> None:
    stages.compile_cost("planar", 2)
    nodes, *seconds = capsys.readouterr().out.split()
    assert int(nodes) == len(dyn.forward_dynamics(stages.MODELS["planar"](2)).nodes)
    assert len(seconds) == len(stages.COLUMNS) - 3
    assert all(float(value) > 0.0 for value in seconds)


def test_elimination_is_accurate_on_long_chains_and_dense_solves_are_less_so() -> None:
    pytest.importorskip("flint")
    errors = stages.accuracy("planar", 30, 0.1)
    assert errors["elimination"] < 1e-13  # some roundings a link
    assert all(errors[name] > 10.0 * errors["elimination"] for name in errors if name != "elimination")


def test_the_cost_of_a_chain_is_told_by_stage(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("resource")
    stages.cost("3D", 3)
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines[2:5]] == ["Lagrangian", "forward dynamics", "evaluate"]
    assert lines[-1].startswith(f"{len(dyn.forward_dynamics(turned_arm(3)).nodes)} nodes")


def test_runs_take_turns_on_both_clocks() -> None:
    order: list[str] = []
    taken = in_turns({name: partial(order.append, name) for name in "ab"}, 3)
    assert order == ["a", "b"] * 3
    assert all(each.seconds > 0.0 and each.processor >= 0.0 for each in [*taken["a"], *taken["b"]])
    assert spent(lambda: sum(range(10**6))).made == 499999500000
    assert spent(lambda: time.sleep(0.05)).seconds > 2.0 * spent(lambda: time.sleep(0.05)).processor


def test_closed_chains_are_timed_and_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_chains, "SIZES", (3,))
    (text,) = closed_chains.closed_chains(1)
    row = text.splitlines()[-1].split()
    assert row[:2] == ["3", "257"]
    assert float(row[2]) > 0.0


def test_every_change_of_structure_is_timed_and_its_torques_agree() -> None:
    lines = "\n".join(reconfiguration.reconfiguration(4, 1)).splitlines()
    assert [line.split()[0] for line in lines[2:]] == ["detach", "attach", "lock", "unlock"]
    with pytest.raises(ArithmeticError, match="lock: torques differ by"):
        reconfiguration.check("lock", np.array([1.0]), np.array([1.1]), 1e-10)


def test_the_build_is_of_the_graph() -> None:
    (text,) = stages.build_time(3, 1)
    arm = dyn.planar_arm([1.0, 0.9, 0.8], [1.1, 1.1 - 0.4 / 3, 1.1 - 0.8 / 3], damping=0.1)
    assert text.splitlines()[-1].split()[-2:] == [str(len(each)) for each in _size(dyn.forward_dynamics(arm))]


def _size(graph: Any) -> tuple[Any, Any]:
    return graph.nodes, graph.edges


def test_the_command_prints_a_figure(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", "counts", "--links", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].split() == ["every", "idea", str(len(dyn.forward_dynamics(_planar(), "recursive").nodes))]
    assert [line.split("  ")[0] for line in lines[2:]] == list(VARIANTS)


def _planar() -> dyn.Mechanism:
    return dyn.planar_arm([0.9] * 3, [0.7] * 3, damping=0.1)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["counts", "planar 3"], "counts has models of its own and takes no scene, got 'planar 3'"),
        (["counts", "--tasks", "forward"], "--tasks does not go with counts, which takes --links"),
        (["long-chains", "--repeats", "3"], "--repeats does not go with long-chains, which takes --links"),
        (["speed", "--links", "3"], "--links does not go with speed"),
        (["build", "--links", "0"], "--links must be at least 1, got 0"),
        (["planar 4"], "there is no scene 'planar 4'"),
    ],
)
def test_a_wrong_choice_gets_one_line(capsys: pytest.CaptureFixture[str], arguments: list[str], said: str) -> None:
    assert cli.main(["bench", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_help_names_every_figure(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["bench", "--help"])
    text = capsys.readouterr().out
    assert all(f"  {name} " in text for name in ("speed", *FIGURES))


def test_columns_that_do_not_fit_go_below_under_the_first_one_again() -> None:
    header = ["name", *[f"{'column':>30}{k}" for k in range(5)]]
    lines = table(header, [["a", *"12345"], ["b", *[("67", "!")] * 5]])
    assert max(map(len, lines)) <= WIDTH
    assert [line.split()[0] for line in lines] == ["name", "a", "b"] * 2
    assert [line.split()[1:] for line in lines if line.startswith("b")] == [["67", "!"] * 3, ["67", "!"] * 2]
    assert table(["n", "x"], []) == ["n  x"]


def test_csv_has_empty_cells_for_what_is_not_known() -> None:
    assert csv_text(["a", "b"], [[1, None], ["x,y", 0.1]]) == 'a,b\n1,\n"x,y",0.1\n'


@pytest.mark.parametrize("name", both_forms.FIGURES)
def test_both_forms_and_their_linearizations_are_counted_and_timed(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(both_forms, "SECONDS", 1e-4)
    this = both_forms.FIGURES[name]
    first, *others, one_ratio, other_ratio = both_forms.rows(this, "planar 3", 1)
    for row, derive in zip((first, *others), this.forms.values(), strict=True):
        counts = derive(both_forms.MODELS["planar 3"]()).counts()
        assert list(row[1 : 1 + len(this.sizes)]) == [str(getattr(counts, size)) for size in this.sizes]
    for ratios, row in zip((one_ratio, other_ratio), others, strict=True):
        assert float(ratios[1]) == pytest.approx(int(row[1]) / int(first[1]), abs=1e-3)
        assert all(float(each) > 0.0 for each in ratios[1:])
    *_, ratio = both_forms.rows(this._replace(compiled=1), "planar 3", 1)  # too large to be timed
    assert list(ratio[1 + len(this.sizes) :]) == ["-"] * len(this.ways)


def test_a_schedule_is_bounded_by_work_and_by_depth() -> None:
    x = cg.variables([f"x{i}" for i in range(8)])
    total = x[0] + x[1]
    for node in x[2:]:
        total = total * node
    chain = cg.Graph(x, {"y": total})
    assert [balanced_order.schedule(chain, units) for units in (1, 4)] == [7, 7]
    pairs = [x[2 * i] * x[2 * i + 1] for i in range(4)]
    tree = cg.Graph(x, {"y": (pairs[0] + pairs[1]) * (pairs[2] + pairs[3])})
    assert [balanced_order.schedule(tree, units) for units in (1, 2, 4, 8)] == [7, 4, 3, 3]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_lanes_and_threads_give_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel_c, "ROUNDS", 1)
    graph = balanced_order.trigonometry_given(balanced_order.solved(_planar(), "balanced"))
    found = parallel_c.times(graph, graph.inputs[:3], ["x0"])
    sums = [total for _, total in found.values()]
    x = [0.2 + 0.8 * ((i * 7919) % 1000) / 1000.0 for i in range(len(graph.inputs))]
    exact = sum(graph.evaluate(dict(zip(graph.input_names, x, strict=True))).values())
    assert sums == pytest.approx([exact] * 5, rel=1e-12)
    with pytest.raises(ValueError, match="the graph has sin, where sums, products and quotients were needed"):
        parallel_c.times(cg.Graph(graph.inputs, {"y": cg.sin(graph.inputs[0])}), [], [])
