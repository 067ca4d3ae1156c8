"""The folder of reference solutions: what was computed is read again, and what is damaged is not."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from pytest import raises

import cgraph as cg
import dynamics as dyn
from dynamics.multiprecision import Reference, ReferenceFailedError, reference
from dynamics.systems.ode_system import OdeSystem

PENDULUM = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + 9.81 * cg.cos(q[0]), ["angle"])


def solve(folder: Path, start: float = 1.0, **options: Any) -> Reference:
    return reference(PENDULUM, [start], [0.0], [0.5, 1.0], digits=12, folder=folder, **options)


def test_a_kept_solution_is_found_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = solve(tmp_path / "made")
    monkeypatch.setattr("dynamics.multiprecision.taylor_integrator.Series", None)  # nothing may be computed now
    assert solve(tmp_path / "made") == first
    assert [path.suffix for path in (tmp_path / "made").iterdir()] == [".json"]


def test_what_the_solution_depends_on_has_its_own_entry(tmp_path: Path) -> None:
    heavy = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + math.nextafter(9.81, 10.0) * cg.cos(q[0]), ["angle"])
    for k, entry in enumerate(
        [
            lambda: solve(tmp_path),
            lambda: solve(tmp_path, start=math.nextafter(1.0, 2.0)),
            lambda: solve(tmp_path, tau=0.1),
            lambda: reference(PENDULUM, [1.0], [0.0], [0.5, 1.0], digits=13, folder=tmp_path),
            lambda: reference(PENDULUM, [1.0], [0.0], [0.5], digits=12, folder=tmp_path),
            lambda: reference(heavy, [1.0], [0.0], [0.5, 1.0], digits=12, folder=tmp_path),
        ]
    ):
        entry()
        assert len(list(tmp_path.iterdir())) == k + 1


def damaged(text: str) -> list[str]:
    content = json.loads(text)
    other = {**content, "x": [[each.replace("1", "2") for each in row] for row in content["x"]]}
    return ["", text[:-20], "[]", "{}", json.dumps(other), json.dumps({**content, "sum": 0}), "\x00" + text]


def test_a_damaged_entry_is_computed_anew(tmp_path: Path) -> None:
    first = solve(tmp_path)
    (path,) = tmp_path.iterdir()
    text = path.read_text(encoding="utf-8")
    for broken in damaged(text):
        path.write_text(broken, encoding="utf-8")
        assert solve(tmp_path) == first
        assert path.read_text(encoding="utf-8") == text


def test_a_run_that_fails_leaves_nothing_in_the_folder(tmp_path: Path) -> None:
    with raises(ReferenceFailedError):
        reference(OdeSystem(lambda x, t: [cg.log(x[0])], "x"), [-1.0], None, [2.0], digits=10, folder=tmp_path)
    assert list(tmp_path.iterdir()) == []
