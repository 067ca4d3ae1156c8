"""The benches: each runs at its smallest, writes the same as text and as JSON, names a missing peer, and is right."""

from __future__ import annotations

import json
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.experiments.text_table import WIDTH, csv_text, table
from dynamics.experiments.timing import Timed, in_turns, machine, spent
from tests.bench.benches import BENCHES, MOTIONS, SPEED, Bench
from tests.bench.peers import PEERS, PeerModel
from tests.bench.speed import beside_peers, reconfiguration, stages
from tests.bench.speed.counts import VARIANTS
from tests.bench.timing import run_fresh
from tests.dynamics.figures import balanced_order, both_forms, parallel_c
from tests.each_row import each_row
from tests.slow import slow
from viz import cli
from viz.paper.mechanisms import turned_arm

ROUNDING = 1e-11  # relative, of accelerations of seven bodies by another order of operations
POINTS = 1e-11  # of point masses, whose inertia MuJoCo's format does not take as exactly zero

# The smallest run of each: arguments of its function; the first column of its last table; packages of the peers that
# it tells when they are missing.
SMALLEST: dict[str, tuple[dict[str, Any], list[str], tuple[str, ...]]] = {
    SPEED: (
        {"scenes": ["planar 3"], "tasks": ["forward"], "modes": ["call"], "peers": ["ours-numpy"], "repeats": 1},
        ["planar 3"],
        (),
    ),
    MOTIONS: (
        {
            "scenes": ["Henon and Heiles"],
            "times": [0.01],
            "errors": [1e-6],
            "peers": ["heyoka"],
            "repeats": 1,
            "count": 1,
        },
        ["Henon and Heiles"],
        ("heyoka",),
    ),
    "counts": ({"links": 3}, list(VARIANTS), ()),
    "operations": ({"links": 3}, ["planar 3"], ()),
    "build": ({"links": 3, "repeats": 1}, ["3"], ()),
    "compile": ({"links": 2}, ["planar", "3D"], ()),
    "agreement": ({"links": 1, "count": 1}, ["1"], ("mujoco", "pinocchio")),
    "ensembles": ({"count": 10, "repeats": 1}, ["simulate_many", "simulate_many, few"], ("mujoco", "jax")),
    "reconfiguration": ({"links": 4, "repeats": 1}, ["detach", "attach", "lock", "unlock"], ("mujoco",)),
    "trust": ({"count": 2}, ["default"], ()),
    "tightest": ({"count": 1}, ["potential", "all"], ("heyoka",)),
    "closed-chains": ({"repeats": 1, "sizes": (3,)}, ["3"], ("pinocchio", "mujoco")),
    "long-chains": ({"links": 3, "sizes": (("planar", 3),)}, [], ()),
}
SLOW = ("trust", "compile", "long-chains")  # by many methods, or in processes of their own


def test_every_bench_has_its_smallest_run() -> None:
    assert list(SMALLEST) == list(BENCHES)
    for name, (chosen, _, _) in SMALLEST.items():
        assert set(chosen) <= {"scenes", "sizes", *BENCHES[name].takes}


@pytest.mark.parametrize("name", [*[name for name in SMALLEST if name not in SLOW], *slow(*SLOW)])
def test_a_bench_says_what_it_has_as_text_and_as_json_and_what_it_has_not(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, (chosen, first_column, packages) = BENCHES[name], SMALLEST[name]
    for package in packages:
        monkeypatch.setitem(sys.modules, package, None)
    if name == "tightest":  # it is about the peer
        with pytest.raises(ImportError, match="heyoka is not installed"):
            list(bench.run(**chosen))
        return
    parts = list(bench.run(**chosen))
    assert parts
    written = {}
    for arguments in ([], ["--json"]):
        monkeypatch.setattr(Bench, "run", lambda *_, **__: iter(parts))
        assert cli.main(["bench", name, *arguments]) == 0
        written[bool(arguments)] = capsys.readouterr().out
    text, content = written[False], json.loads(written[True])
    assert text.startswith(machine()[:30])
    assert (content["machine"], content["complete"]) == (machine(), True)
    if bench.rows:
        assert content["rows"] == json.loads(json.dumps([asdict(part) for part in parts]))
    else:
        tables = [each for each in content["rows"] if isinstance(each, dict)]
        words = [" ".join(line.split()) for line in text.splitlines()]
        for each in tables:
            assert " ".join(" ".join(each["header"]).split()) in words
            assert all(" ".join(" ".join(row).split()) in words for row in each["rows"])
        assert all(each in text for each in content["rows"] if isinstance(each, str))
        if packages != ("mujoco", "pinocchio") and first_column:
            assert [row[0] for row in tables[-1]["rows"]][: len(first_column)] == first_column
    assert [package for package in packages if f"{package} is not installed" not in text.lower()] == []


@each_row("name", BENCHES)
def test_a_bench_that_is_interrupted_prints_what_it_has(name: str, capsys: Any, monkeypatch: Any) -> None:
    from tests.dynamics.experiments.test_bench import cell, row
    from tests.dynamics.experiments.test_motions import lost

    part = {SPEED: row("planar 3", ours=cell(0.2, 0.0)), MOTIONS: lost()}.get(name, "a line")

    def run(*_: Any, **__: Any) -> Iterator[Any]:
        yield part
        raise KeyboardInterrupt

    monkeypatch.setattr(Bench, "run", run)
    assert cli.main(["bench", name]) == 130
    printed = capsys.readouterr()
    assert {SPEED: "planar 3  0.200", MOTIONS: "(3e-08)"}.get(name, "a line") in printed.out
    assert "the bench did not come to its end" in printed.err


@each_row(
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
def test_a_wrong_choice_gets_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["bench", *arguments]) == 2
    assert said in capsys.readouterr().err


def test_help_names_every_figure(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["bench", "--help"])
    text = capsys.readouterr().out
    assert all(f"  {name} " in text for name in BENCHES)


# What is told, by other means


def accelerations(graph: Any) -> Any:
    x = np.random.default_rng(3).normal(size=len(graph.inputs))
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, x.tolist(), strict=True))).values()))


def _planar() -> dyn.Mechanism:
    return dyn.planar_arm([0.9] * 3, [0.7] * 3, damping=0.1)


@each_row("name", VARIANTS)
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
    arm = beside_peers.random_arm(4, mass_model)
    made: Any = PEERS[peer].make(PeerModel(peer, arm))
    worst = beside_peers.differences(arm, made, 5)
    assert set(worst) == set(beside_peers.QUANTITIES)
    assert max(worst.values()) < POINTS


def test_pendulums_of_an_ensemble_end_where_those_of_mujoco_and_jax_do() -> None:
    q, qd = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3, 3))
    first, *_ = beside_peers.SIDE_BY_SIDE.values()
    expected = first(q, qd)()
    for name in ("MuJoCo", "JAX"):
        if PEERS[name.lower()].installed:
            found = beside_peers.SIDE_BY_SIDE[name](q, qd)()
            assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)  # 1000 steps


def test_elimination_is_accurate_on_long_chains_and_dense_solves_are_less_so() -> None:
    pytest.importorskip("flint")
    errors = stages.accuracy("planar", 30, 0.1)
    assert errors["elimination"] < 1e-13  # some roundings a link
    assert all(errors[name] > 10.0 * errors["elimination"] for name in errors if name != "elimination")


def test_the_stages_of_a_chain_are_told() -> None:
    pytest.importorskip("resource")
    nodes, *seconds = stages.compile_cost("planar", 2)
    assert int(nodes) == len(dyn.forward_dynamics(stages.MODELS["planar"](2)).nodes)
    assert len(seconds) == len(stages.COLUMNS) - 3
    assert all(float(value) > 0.0 for value in seconds)
    *rows, size = stages.cost("3D", 3)
    assert [row[0] for row in rows[1:4]] == ["Lagrangian", "forward dynamics", "evaluate"]
    assert str(size).startswith(f"{len(dyn.forward_dynamics(turned_arm(3)).nodes)} nodes")


def test_runs_take_turns_on_both_clocks() -> None:
    order: list[str] = []
    runs = [Timed(partial(order.append, name), partial(order.append, "rewound")) for name in "ab"]
    in_turns(runs, 3)
    assert order == ["rewound", "a", "rewound", "b"] * 3
    assert all(len(each.seconds) == len(each.processor) == 3 and min(each.seconds) > 0.0 for each in runs)
    in_turns([short := Timed(lambda: None), long := Timed(partial(time.sleep, 0.01))], 5, chunk=1e-3, enough=0.02)
    assert len(short.seconds) > 50
    assert len(long.seconds) == 3
    assert spent(lambda: sum(range(10**6))).made == 499999500000
    assert spent(lambda: time.sleep(0.05)).seconds > 2.0 * spent(lambda: time.sleep(0.05)).processor


@each_row(
    ("module", "function", "arguments", "timeout", "said"),
    [
        ("math", "sqrt", [-1.0], None, "ValueError: .*"),
        ("os", "abort", [], None, "its process ended with status -6"),
        ("time", "sleep", [60.0], 0.1, "not ready within 0.1 s"),
    ],
)
def test_a_process_of_its_own_answers_or_says_why_not(
    module: str, function: str, arguments: list[float], timeout: float | None, said: str
) -> None:
    assert run_fresh("math", "sqrt", 4.0) == 2.0
    with pytest.raises(RuntimeError, match=said):
        run_fresh(module, function, *arguments, timeout=timeout)


def test_a_process_of_its_own_imports_what_this_one_does_in_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cgraph.py").write_text("raise ImportError('another one')")
    monkeypatch.chdir(tmp_path)
    assert run_fresh("dynamics.experiments.timing", "machine") == machine()


def test_torques_after_a_change_of_structure_have_to_agree() -> None:
    with pytest.raises(ArithmeticError, match="lock: torques differ by"):
        reconfiguration.check("lock", np.array([1.0]), np.array([1.1]), 1e-10)


def test_the_build_is_of_the_graph_and_counts_are_of_it() -> None:
    (built,) = stages.build_time(3, 1)
    graph = dyn.forward_dynamics(dyn.planar_arm([1.0, 0.9, 0.8], [1.1, 1.1 - 0.4 / 3, 1.1 - 0.8 / 3], damping=0.1))
    assert built.rows[0][-2:] == [str(len(graph.nodes)), str(len(graph.edges))]
    (counted,), (closed, *_) = BENCHES["counts"].run(links=3), BENCHES["closed-chains"].run(repeats=1, sizes=(3,))
    assert counted.rows[0][1] == str(len(dyn.forward_dynamics(_planar(), "recursive").nodes))
    assert closed.rows[0][:2] == ["3", "257"]


# Tables


def test_columns_that_do_not_fit_go_below_under_the_first_one_again() -> None:
    header = ["name", *[f"{'column':>30}{k}" for k in range(5)]]
    lines = table(header, [["a", *"12345"], ["b", *[("67", "!")] * 5]])
    assert max(map(len, lines)) <= WIDTH
    assert [line.split()[0] for line in lines] == ["name", "a", "b"] * 2
    assert [line.split()[1:] for line in lines if line.startswith("b")] == [["67", "!"] * 3, ["67", "!"] * 2]
    assert table(["n", "x"], []) == ["n  x"]


def test_csv_has_empty_cells_for_what_is_not_known() -> None:
    assert csv_text(["a", "b"], [[1, None], ["x,y", 0.1]]) == 'a,b\n1,\n"x,y",0.1\n'


# Figures of pages that no command prints


@each_row("name", both_forms.FIGURES)
def test_both_forms_and_their_linearizations_are_counted_and_timed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
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
