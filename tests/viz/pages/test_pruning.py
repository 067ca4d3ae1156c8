"""The page of what a scene does not need, and the command that writes it."""

import json
from pathlib import Path

import pytest

import dynamics as dyn
from viz.cli import main
from viz.commands.report import pruning_content
from viz.pages import pruning_page
from viz.pages.document import to_html


def test_the_page_has_every_row_of_the_account() -> None:
    content = pruning_content(dyn.scenes.load("triple_pendulum"), ["damping"])
    inverse, forward = content["graphs"]
    assert (inverse["full"]["nodes"], forward["full"]["nodes"]) == (97, 160)
    assert [each["what"] for each in inverse["left_out"]] == ["gravity"]
    assert [each["what"] for each in forward["left_out"]] == ["gravity"]
    assert [each["what"] for each in forward["remains"]] == ["unobservable inertial numbers"]
    for graph in content["graphs"]:
        assert sum(each["nodes"] for each in graph["left_out"]) == graph["full"]["nodes"] - graph["pruned"]["nodes"]
    page = to_html(pruning_page.document(content))
    for each in (row for graph in content["graphs"] for row in graph["left_out"]):
        assert f"<td>{each['what']}</td><td>{each['why']}</td><td>{each['nodes']}</td>" in page


def test_the_command_writes_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = tmp_path / "arm.xml"
    robot.write_text(dyn.to_mjcf(dyn.tree([-1, 0])), encoding="utf-8")
    command = ["report", str(robot), "--pruning", "--without", "gravity", "--lock", "link 2=0.3"]
    pytest.importorskip("mujoco")
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    assert "arm-pruning.html" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "arm-pruning.json").read_text(encoding="utf-8"))
    assert [each["what"] for each in content["graphs"][0]["left_out"]][:2] == ["gravity", "joint of link 2"]
    assert "joint of link 2" in (tmp_path / "out" / "arm-pruning.md").read_text(encoding="utf-8")
    assert main(["report", "chain", "--pruning", "--without", "wind", "--out", str(tmp_path)]) == 2
    assert "effects are gravity" in capsys.readouterr().err
