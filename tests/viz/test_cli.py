"""The command line: what it prints, and one line for a user's mistake."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from dynamics import scenes
from viz import cli
from viz.commands.parser import COMMANDS


def run(*arguments: str, cwd=None) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, as a person starts it."""
    command = [sys.executable, "-m", "viz", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def test_scenes_are_listed_with_the_sizes_of_their_graphs(capsys):
    assert cli.main(["scenes", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert list(rows) == scenes.names()
    assert rows["triple_pendulum"]["coordinates"] == 3
    assert rows["triple_pendulum"]["inverse_nodes"] == 171
    assert cli.main(["scenes"]) == 0
    assert "triple_pendulum" in capsys.readouterr().out


@pytest.mark.parametrize("suffix", [".dot", ".txt", ".svg", ".png"])
def test_a_scene_is_drawn_or_listed(tmp_path, capsys, suffix):
    target = tmp_path / f"graph{suffix}"
    assert cli.main(["draw", "spring_mass", "--formulation", "euler_embedded", "--out", str(target)]) == 0
    assert "nodes" in capsys.readouterr().out
    start = {".dot": b"digraph", ".txt": b"inputs q0_old", ".svg": b"<svg", ".png": b"\x89PNG"}[suffix]
    assert target.read_bytes().lstrip(b"/ \n").startswith(start) or start in target.read_bytes()[:400]


MODEL = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0" range="-30 30" frictionloss="0.1"/>
<geom size="0.1" pos="0.2 0 0" contype="0"/></body></worldbody></mujoco>"""
URDF = """<robot name="arm"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint></robot>"""


def test_a_model_file_stands_where_a_scene_s_name_does(tmp_path, capsys):
    pytest.importorskip("mujoco")
    model, arm, target = tmp_path / "model.xml", tmp_path / "arm.urdf", tmp_path / "graph.dot"
    arm.write_text(URDF)
    assert cli.main(["draw", str(arm), "--out", str(target)]) == 0
    assert "arm: inverse dynamics, chain rule" in target.read_text()
    assert capsys.readouterr().err == ""
    model.write_text(MODEL)
    assert cli.main(["draw", str(model), "--out", str(target)]) == 2
    said = "cgraph: error: a mechanism cannot have friction loss (the option ignore leaves this out)\n"
    assert capsys.readouterr().err == said
    assert cli.main(["draw", str(model), "--ignore", "--out", str(target)]) == 0
    said = ["cgraph: model: left out friction loss", "cgraph: model: left out joint limits (j)"]
    assert capsys.readouterr().err.splitlines() == said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["draw", "quadruple_pendulum", "--out", "x.dot"], "there is no scene 'quadruple_pendulum'"),
        (["draw", "nowhere.xml", "--out", "x.dot"], "there is no file 'nowhere.xml'"),
        (["draw", "nowhere.urdf", "--out", "x.dot"], "there is no file 'nowhere.urdf'"),
        (["draw", "a_file", "--out", "x.dot"], "MuJoCo cannot read 'a_file'"),
        (["draw", "chain", "--ignore", "--out", "x.dot"], "scene 'chain' has no option 'ignore'"),
        (["draw", "spring_mass", "--out", "x.jpg"], "must end in .svg, .png, .dot or .txt"),
        (["draw", "spring_mass", "--out", "missing/x.dot"], "does not exist"),
        (["draw", "spring_mass", "--out", "x.dot", "--collapse", "link 9"], "link 9"),
        (["paper", "--out", "a_file"], "cannot write into the folder a_file: a_file is a file"),
        (["certify", "nowhere.xml"], "there is no file 'nowhere.xml'"),
    ],
)
def test_a_mistake_gets_one_line_and_exit_status_2(tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a_file").write_text("in the way")
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("cgraph: error: ")
    assert "Errno" not in error
    assert said in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a_file"]


def test_the_exit_status_of_a_process_is_the_command_s():
    done = run("draw", "nowhere.xml", "--out", "x.dot")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "cgraph: error: there is no file 'nowhere.xml'\n"


def test_what_the_system_says_has_no_number(monkeypatch, capsys):
    def fail(_):
        open("/nowhere/at/all")  # noqa: PTH123, SIM115 - what raises is Python itself

    monkeypatch.setattr("viz.commands.scenes.run", fail)
    assert cli.main(["scenes"]) == 2
    assert capsys.readouterr().err == "cgraph: error: /nowhere/at/all: No such file or directory\n"


WRONG = ([], ["paint"], ["draw"], ["draw", "chain", "--out", "x.dot", "--formulation", "f"])


@pytest.mark.parametrize("arguments", WRONG)
def test_wrong_usage_gets_the_usage_and_exit_status_2(capsys, arguments):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2
    assert "usage: cgraph" in capsys.readouterr().err


NAMES = [command.__name__.rpartition(".")[2] for command in COMMANDS]


def test_every_command_is_in_the_help_and_has_help(capsys):
    shown = {}
    for arguments in ([], *([name] for name in NAMES)):
        with pytest.raises(SystemExit) as stop:
            cli.main([*arguments, "--help"])
        assert stop.value.code == 0
        shown[" ".join(arguments)] = capsys.readouterr().out
    for name in NAMES:
        assert re.search(rf"^    {name}\s", shown[""], re.MULTILINE), name
        assert shown[name].startswith(f"usage: cgraph {name} ")


def test_every_file_of_commands_is_listed_or_helps_one_that_is():
    files = {path.stem for path in Path(cli.__file__).parent.joinpath("commands").glob("*.py")}
    runs = {name for name in files - {"__init__"} if hasattr(import_module(f"viz.commands.{name}"), "add")}
    assert runs == set(NAMES)


def test_ctrl_c_gives_one_line_and_exit_status_230(monkeypatch, capsys):
    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("viz.commands.scenes.run", interrupt)
    assert cli.main(["scenes"]) == 130
    assert capsys.readouterr().err == "cgraph: interrupted\n"
