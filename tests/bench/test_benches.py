"""The benches: each runs at its smallest, writes the same as text and as JSON, and names a missing peer."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from dynamics.experiments.timing import machine
from tests.bench import __main__ as command
from tests.bench.benches import BENCHES, MOTIONS, SPEED, Bench
from tests.bench.hybrid import RIGHT, random_verdicts
from tests.bench.speed import stages
from tests.bench.timing import run_fresh
from tests.each_row import each_row
from tests.slow import slow

ROUNDING = 1e-11  # relative, of accelerations of seven bodies by another order of operations
HENON = {"scenes": ["Henon and Heiles"], "times": [0.01], "errors": [1e-6], "peers": ["heyoka"], "count": 1}
PLANAR = {"scenes": ["planar 3"], "tasks": ["forward"], "modes": ["call"], "peers": ["ours-numpy"]}
# The smallest run of each: arguments of its function, and packages of the peers that it tells when they are missing.
SMALLEST: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    SPEED: ({**PLANAR, "repeats": 1}, ()),
    MOTIONS: ({**HENON, "repeats": 1}, ("heyoka",)),
    "counts": ({"links": 3}, ()),
    "operations": ({"links": 3}, ()),
    "compile": ({"links": 2}, ()),
    "agreement": ({"links": 1, "count": 1}, ("mujoco", "pinocchio")),
    "ensembles": ({"count": 10, "repeats": 1}, ("mujoco", "jax")),
    "reconfiguration": ({"links": 4, "repeats": 1}, ("mujoco",)),
    "trust": ({"count": 2}, ()),
    "long-chains": ({"links": 3, "sizes": (("planar", 3),)}, ()),
}
SLOW = ("trust", "compile", "long-chains")  # by many methods, or in processes of their own


@pytest.mark.parametrize("name", [*[name for name in SMALLEST if name not in SLOW], *slow(*SLOW)])
def test_a_bench_says_what_it_has_as_text_and_as_json_and_what_it_has_not(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen, packages = SMALLEST[name]
    for package in packages:
        monkeypatch.setitem(sys.modules, package, None)
    parts = list(BENCHES[name].run(**chosen))
    assert parts
    monkeypatch.setattr(Bench, "run", lambda *_, **__: iter(parts))
    assert command.main([name]) == 0
    text = capsys.readouterr().out
    assert text.startswith(machine()[:30])
    assert [package for package in packages if f"{package} is not installed" not in text.lower()] == []
    assert command.main([name, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["complete"]
    words = [" ".join(line.split()) for line in text.splitlines()]
    for each in [each for each in content["rows"] if "header" in each]:
        assert all(" ".join(" ".join(row).split()) in words for row in [each["header"], *each["rows"]])


@pytest.mark.parametrize("name", BENCHES)
def test_a_bench_that_is_interrupted_prints_what_it_has(name: str, capsys: Any, monkeypatch: Any) -> None:
    def run(*_: Any, **__: Any) -> Iterator[Any]:
        yield BENCHES[name].module.Row("planar 3", 1.0, 1e-9) if name == MOTIONS else part
        raise KeyboardInterrupt

    part = speed_row() if name == SPEED else "a line"
    monkeypatch.setattr(Bench, "run", run)
    assert command.main([name]) == 130
    printed = capsys.readouterr()
    assert "planar 3" in printed.out or "a line" in printed.out
    assert "the bench did not come to its end" in printed.err


def speed_row() -> Any:
    module: Any = BENCHES[SPEED].module
    return module.Row("planar 3", "forward", "call", 3, {"ours": module.Cell(0.2, 0.1, 0.3, 0.25, 0.0, 230)})


@each_row(
    ("arguments", "said"),
    [
        (["counts", "planar 3"], "counts has models of its own and takes no scene, got 'planar 3'"),
        (["counts", "--tasks", "forward"], "--tasks does not go with counts, which takes --links"),
        (["speed", "--links", "3"], "--links does not go with speed"),
        (["compile", "--links", "0"], "--links must be at least 1, got 0"),
        (["counts", "--links", "1"], "the smallest model that is counted has 3 links, got links = 1"),
        (["planar 4"], "there is no scene 'planar 4'"),
    ],
)
def test_a_wrong_choice_gets_one_line(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(arguments) == 2
    assert said in capsys.readouterr().err


def test_random_systems_with_switching_surfaces_come_out_right() -> None:
    seeds = 0, 3, 8, 10, 13, 41  # a switch, a belt, spheres, a gate, a kink, and two joints at an instant
    found = [each for seed in seeds for each in random_verdicts(1, seed, ("dop853",))]
    assert [each for each in found if each.verdict != RIGHT] == []
    assert len(found) == len(seeds) + 2 * 3  # slopes of three of them, two ways


def test_elimination_is_accurate_on_long_chains_and_dense_solves_are_less_so() -> None:
    pytest.importorskip("flint")
    errors = stages.accuracy("planar", 15, 0.1)
    assert errors["elimination"] < 1e-13  # some roundings a link
    assert all(errors[name] > 10.0 * errors["elimination"] for name in errors if name != "elimination")


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
