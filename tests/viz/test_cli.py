"""The command line: what it prints, and one line for a user's mistake."""

import errno
import json
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from dynamics import scenes
from dynamics.equations.formulations import lagrange_terms
from tests.each_row import each_row
from tests.slow import slow
from viz import cli
from viz.commands.arguments import FORMER_NAMES, FORMULATIONS, IN_PYTHON
from viz.commands.command import COMMANDS, complete, parse


def run(*arguments: str, cwd=None) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, as a person starts it."""
    command = [sys.executable, "-m", "viz", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def test_scenes_are_listed_with_the_sizes_of_their_graphs(capsys):
    assert cli.main(["scenes", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert list(rows) == scenes.names()
    assert rows["triple_pendulum"]["coordinates"] == 3
    assert rows["triple_pendulum"]["inverse_nodes"] == 97
    assert cli.main(["scenes"]) == 0
    assert "triple_pendulum" in capsys.readouterr().out


@each_row("suffix", [".dot", ".txt", ".svg", ".png"])
def test_a_scene_is_drawn_or_listed(tmp_path, capsys, suffix):
    target = tmp_path / f"graph{suffix}"
    assert cli.main(["draw", "spring_mass", "--formulation", "by_definition", "--out", str(target)]) == 0
    assert "nodes" in capsys.readouterr().out
    start = {".dot": b"digraph", ".txt": b"inputs q0_old", ".svg": b"<svg", ".png": b"\x89PNG"}[suffix]
    assert target.read_bytes().lstrip(b"/ \n").startswith(start) or start in target.read_bytes()[:400]


MODEL = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0" range="-30 30" frictionloss="0.1"/>
<geom size="0.1" pos="0.2 0 0" contype="0"/></body></worldbody></mujoco>"""
TAKEN = ["--contacts", "compliant"]
URDF = """<robot name="arm"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint></robot>"""


@pytest.mark.filterwarnings("always::dynamics.MechanismWarning")
def test_a_model_file_stands_where_a_scene_s_name_does(tmp_path, capsys):
    pytest.importorskip("mujoco")
    model, arm, target = tmp_path / "model.xml", tmp_path / "arm.urdf", tmp_path / "graph.dot"
    arm.write_text(URDF)
    assert cli.main(["draw", str(arm), "--out", str(target)]) == 0
    assert "arm: inverse dynamics, chain rule" in target.read_text()
    assert capsys.readouterr().err == ""
    inertial = URDF[URDF.index("<inertial>") : URDF.index("</inertial>")] + "</inertial>"
    arm.write_text(URDF.replace('<link name="base"/>', f'<link name="base">{inertial}</link>'))
    assert cli.main(["draw", str(arm), "--floating", "--out", str(target)]) == 0
    assert "qd5" in target.read_text()
    assert cli.main(["certify", str(arm), "--floating", "--states", "1"]) == 0
    assert "MuJoCo's" in capsys.readouterr().out
    model.write_text(MODEL.replace("<mujoco>", '<mujoco><option density="1"/>'))
    assert cli.main(["draw", str(model), "--out", str(target)]) == 2
    fluid = "a fluid (density or viscosity)"
    said = f"cgraph: error: a mechanism cannot have {fluid} (the option ignore leaves this out)\n"
    assert capsys.readouterr().err == said
    assert cli.main(["draw", str(model), "--ignore", "--out", str(target)]) == 0
    said = f"cgraph: warning: {str(model)!r}: left out {fluid}; joint limits (j); friction loss (j: 0.1)\n"
    assert capsys.readouterr().err == said
    model.write_text(
        MODEL.replace("<worldbody>", '<worldbody><geom type="plane" size="1 1 1"/>').replace(' contype="0"', "")
    )
    for options, contacts in ([], "contacts (the option contacts takes those of spheres and capsules); "), (TAKEN, ""):
        assert cli.main(["code", str(model), *options, "--c", "--out", str(tmp_path / "model.c")]) == 0
        said = f"cgraph: warning: {str(model)!r}: left out {contacts}joint limits (j); friction loss (j: 0.1)\n"
        assert capsys.readouterr().err == said
    assert "sqrt" in (tmp_path / "model.c").read_text()
    every = [*TAKEN, "--limits", "1000,10", "--friction", "0.01", "--actuators"]
    assert cli.main(["code", str(model), *every, "--c", "--out", str(tmp_path / "model.c")]) == 0
    assert capsys.readouterr().err == ""
    assert "tanh" in (tmp_path / "model.c").read_text()
    given = ["--contacts", "friction=mu,stiffness=1e5"]
    assert cli.main(["code", str(model), *given, "--c", "--out", str(tmp_path / "model.c")]) == 0
    assert "_IN_mu" in (tmp_path / "model.h").read_text()
    capsys.readouterr()
    for wrong in ("rigid", "radius=2"):
        assert cli.main(["draw", str(model), "--contacts", wrong, "--out", str(target)]) == 2
        assert capsys.readouterr().err.startswith("cgraph: error: ")


@each_row(
    ("arguments", "said"),
    [
        ("draw quadruple_pendulum --out x.dot", "there is no scene 'quadruple_pendulum'"),
        ("draw nowhere.xml --out x.dot", "there is no file 'nowhere.xml'"),
        ("draw a_file --out x.dot", "'a_file' is not XML, as MJCF and URDF are"),
        ("draw . --out x.dot", "'.' is a folder, and a model is a file"),
        ("draw chain --ignore --out x.dot", "scene 'chain' has no option 'ignore'"),
        ("draw spring_mass --out x.jpg", "must end in .svg, .png, .dot or .txt"),
        ("draw spring_mass --out missing/x.dot", "does not exist"),
        (["draw", "spring_mass", "--out", "x.dot", "--collapse", "link 9"], "link 9"),
        ("paper --out a_file", "cannot write into the folder a_file: a_file is a file"),
        ("why triple_pendulum tau0 q9", "nothing in the graph is called 'q9'"),
        (
            "why triple_pendulum tau9 q0",
            "there is no torque and no cause 'tau9'; it has gravity, Coriolis, inertia, damping, tau.joint 1",
        ),
        ("why triple_pendulum", "why needs to know WHAT: a torque, such as tau0, or a cause, such as gravity"),
        ("why triple_pendulum gravity --svg a.svg", "--svg draws the paths from INPUT: name one"),
        ("why triple_pendulum weigth", "there is no torque and no cause 'weigth'"),
        ("why spring_mass tau0 q0 --at zz=1", "the graph has no input zz"),
        ("lint spring_mass --box zz=0:1", "the graph has no input zz"),
        ("inspect spring_mass --out x.html --t-end 1e9", "--t-end must be at most 1000 s"),
        ("lint nowhere.py:system", "there is no file 'nowhere.py'"),
        (["simulate", "chain", "--start", "joint 11=1"], "there is no joint 11; did you mean"),
        ("simulate chain --start q0", "there is no start 'q0'; a start is such as q0=0.5,qd0=1, or all numbers of"),
        ("simulate chain --every 1e-300 --csv a.csv", "--every 1e-300 makes "),
        ("simulate chain --every 0.1", "--every goes with --csv"),
        ("simulate chain --dt 0.1", "--dt goes with methods of equal steps, such as --method rk4; dop853 chooses"),
        ("simulate chain --csv nowhere/a.csv", "cannot write"),
        ("simulate chain --method rk5", "there is no method 'rk5'; there are euler, rk4, "),
        ("simulate chain --method yoshida", "there is no method 'yoshida'; did you mean 'yoshida"),
        ("lint triple_pendulm", "there is no scene 'triple_pendulm'; did you mean 'triple_pendulum'?"),
        ("draw spring_mass --collapse nolink --out x.txt", "--collapse goes with .svg, .png, .dot"),
        ("report", "a report of run times needs a scene, as in: cgraph report spring_mass"),
        ("lesson --out lesson.txt", "--out must end in .html"),
        ("report spring_mass spring_mass", "each scene needs a name of its own"),
        ("report spring_mass --without gravity", "--without goes with --pruning"),
        ("report spring_mass --lock a=1", "--lock goes with --pruning"),
        ("report spring_mass --pruning --quick", "--quick goes with a report of run times or --stability"),
        ("report --stability --ignore", "--ignore goes with a report of run times or --pruning"),
        ("report --stability --pruning", "one at a time"),
        ("report chain --stability", "--stability takes no scene, got 'chain'"),
        ("code spring_mass --js --out a.c", "--out must end in .mjs for --js, got a.c"),
        ("code spring_mass --c --out 2.c", "must be a letter"),
        ("code spring_mass --c --out sin.c", "sin.c names the function: the name of a C function must not be a word"),
        ("report --pruning", "--pruning needs a scene"),
        ("report spring_mass --out a_file/new", "cannot write into the folder a_file/new: a_file is a file"),
        ("report spring_mass --pruning --out a_file/new", "cannot write into the folder a_file/new"),
        ("report --stability --out a_file/new", "cannot write into the folder a_file/new"),
        ("report chain --pruning --lock a=1 --lock a=2", "--lock takes each body once"),
    ],
)
def test_a_mistake_gets_one_line_and_exit_status_2(here, capsys, arguments, said):
    (here / "a_file").write_text("in the way")
    assert cli.main(arguments.split() if isinstance(arguments, str) else arguments) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith("cgraph: error: ")
    assert "Errno" not in error
    assert said in error
    assert sorted(path.name for path in here.iterdir()) == ["a_file"]


def test_an_answer_that_the_terminal_cannot_spell_is_written_and_its_files_too(here, monkeypatch):
    (here / "m\u00fchle.py").write_text("import dynamics as dyn\nm\u00fchle = dyn.planar_arm([1.0], [1.0])\n", "utf-8")
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = run("simulate", "m\u00fchle.py:m\u00fchle", "--csv", "a.csv", cwd=here)
    assert (done.returncode, done.stdout[:10]) == (0, r"m\xfchle.m"), done.stderr
    assert (here / "a.csv").is_file()


def test_the_exit_status_of_a_process_is_the_command_s():
    done = run("draw", "nowhere.xml", "--out", "x.dot")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "cgraph: error: there is no file 'nowhere.xml'\n"


USAGE = """paint|draw|draw chain --out x.dot --formulation f|lint|why
why spring_mass tau0 q0 --k 0|why spring_mass tau0 q0 --k -1
why spring_mass tau0 q0 --at q0|why spring_mass tau0 q0 --at q0=nan|why spring_mass tau0 q0 --at q0=1,q0=2
lint spring_mass --box q0=0:1,q0=0:2|certify spring_mass --seed -1|report spring_mass --t-end -1|lesson
inspect spring_mass --out x.html --t-end 0|why spring_mass tau0 q0 --svg answer.png
why spring_mass tau0 q0 --forward --formulation kinetic_only|lint spring_mass --box q0=1|lint spring_mass --box q0=2:1
compare spring_mass --formulations chain_rule|compare spring_mass --formulations chain_rule none
simulate chain --start a,b|simulate chain --start q0=1,q0=2|simulate chain --t-end -1|simulate chain --rtol 0
draw chain --out a.dot --forward --formulation kinetic_only"""


@each_row(
    ("arguments", "said"),
    [
        *[(line, "") for line in re.split(r"[|\n]", USAGE)],
        ("draw chain chain --out a.dot", "unrecognized arguments: "),
        ("--foo", "there is no option '--foo': `cgraph` alone lists the commands"),
        ("version", "there is no command 'version': did you mean '--version'?"),
        ("Simulat", "there is no command 'Simulat': did you mean 'simulate'?"),
        ("simulate chain --tend 2", "simulate: error: unrecognized arguments: --tend 2; did you mean '--t-end'?"),
        ("draw chain --out=", "argument --out: expected the name of a file or folder, got ''"),
        ("simulate chain --csv=", "argument --csv: expected the name of a file or folder, got ''"),
        ("report spring_mass --start a,b", "argument --start: expected a finite number, got 'a'"),
        ("report spring_mass --start 1,nan", "argument --start: expected a finite number, got 'nan'"),
        ("report spring_mass --pruning --lock tip=x", "argument --lock: expected a finite number, got 'x'"),
        (
            "report spring_mass --pruning --lock tip",
            "argument --lock: expected a body and a coordinate, BODY=AT, got 'tip'",
        ),
        ("lint spring_mass --momentum --forward", "not allowed with argument"),
        ("inspect spring_mass --momentum --forward --out a.html", "not allowed with argument"),
        ("compare spring_mass --momentum --formulations chain_rule kinetic_only", "not allowed with argument"),
        ("report spring_mass --t-end inf", "argument --t-end: expected a finite number, got 'inf'"),
    ],
)
def test_wrong_usage_gets_the_usage_and_exit_status_2(capsys, arguments, said):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments.split())
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert "usage: cgraph" in error
    assert said in error


def test_every_command_is_in_the_help_and_has_help(capsys):
    taking = {
        name: action.help
        for name, command in complete().items()
        for action in command._actions
        if "SCENE" in str(action.metavar) and not action.option_strings
    }
    assert {"inspect", "simulate", "animate", "lint", "why", "draw", "certify", "compare", "report"} <= set(taking)
    assert [name for name, said in taking.items() if IN_PYTHON not in said] == []
    assert list(FORMULATIONS) == sorted(dyn.FORMULATIONS)
    assert FORMER_NAMES == lagrange_terms.FORMER_NAMES
    shown = {}
    for arguments in ([], ["--help"], *([name, "--help"] for name in COMMANDS)):
        with pytest.raises(SystemExit) as stop:
            cli.main(arguments)
        assert stop.value.code == 0
        shown[arguments[0] if arguments else ""] = capsys.readouterr().out
    for name in COMMANDS:
        assert all(re.search(rf"^    {name}\s", shown[page], re.MULTILINE) for page in ("", "--help")), name
        assert shown[name].startswith(f"usage: cgraph {name} ")


def test_a_command_is_loaded_alone(monkeypatch):
    asked = []

    def load(name, package):
        asked.append(name)
        return import_module(name, package)

    monkeypatch.setattr("viz.commands.command.import_module", load)
    parse(["draw", "chain", "--out", "a.dot"])
    assert asked == [".draw"]
    complete()
    assert asked[1:] == [f".{name}" for name in COMMANDS]


def test_every_file_of_commands_is_listed_or_helps_one_that_is():
    files = {path.stem for path in Path(cli.__file__).parent.joinpath("commands").glob("*.py")}
    runs = {name for name in files - {"__init__"} if hasattr(import_module(f"viz.commands.{name}"), "add")}
    assert runs == set(COMMANDS)


def test_the_version_is_one(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"cgraph {cg.__version__}\n"
    assert viz.__version__ == dyn.__version__ == cg.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*", cg.__version__)


def test_words_of_a_list_may_stand_between_options():
    assert parse(["report", "--quick", "chain", "--json", "spring_mass"]).scenes == ["chain", "spring_mass"]


def test_tags_to_collapse_are_given_one_by_one_or_in_a_list(tmp_path, capsys):
    texts = []
    for i, tags in enumerate((["kinetic,potential"], ["kinetic", "--collapse", "potential"], [""])):
        target = tmp_path / f"{i}.dot"
        assert cli.main(["draw", "spring_mass", "--out", str(target), "--collapse", *tags]) == 0
        texts.append(target.read_text())
    assert texts[0] == texts[1]
    assert "box3d" in texts[0]
    assert "box3d" not in texts[2]


@pytest.mark.parametrize("command", [["draw", "chain", "--out"], *slow(["lint", "chain", "--svg"])])
def test_a_picture_of_too_many_nodes_has_a_box_for_a_link(tmp_path, monkeypatch, capsys, command):
    sources = []
    monkeypatch.setattr("viz.commands.library.render_svg", lambda drawing: sources.append(drawing.source) or "<svg/>")
    assert cli.main([*command, str(tmp_path / "a.svg")]) == 0
    assert "nodes are too many for one picture: those of a tag are one box" in capsys.readouterr().err
    (source,) = sources
    assert "link 7 (" in source
    assert source.count("->") < 500


def test_a_joint_is_locked_by_its_body_or_its_coordinate(capsys):
    sizes = []
    for lock in ("link 3=0.2", "joint 3=0.2"):
        assert cli.main(["report", "triple_pendulum", "--pruning", "--json", "--lock", lock]) == 0
        (content,) = json.loads(capsys.readouterr().out)
        sizes.append([each["pruned"] for each in content["graphs"]])
    assert sizes[0] == sizes[1]
    assert sizes[0][0]["nodes"] < 97
    for scene, said in (("spring_mass", "it has no bodies"), ("chain", "it has joint 1, joint 2")):
        assert cli.main(["report", scene, "--pruning", "--json", "--lock", "elbow=1"]) == 2
        assert f"{scene} has no joint 'elbow' to lock; {said}" in capsys.readouterr().err


def test_json_of_a_report_writes_no_file_unless_a_folder_is_named(here, capsys):
    assert cli.main(["report", "spring_mass", "--pruning", "--json"]) == 0
    assert not [*here.iterdir()]
    printed = capsys.readouterr()
    assert json.loads(printed.out)
    assert printed.err == ""
    assert cli.main(["report", "spring_mass", "--pruning", "--json", "--out", "there"]) == 0
    assert {path.suffix for path in (here / "there").iterdir()} == {".json", ".md", ".html"}


@pytest.mark.parametrize(
    "arguments",
    [
        "lint spring_mass --svg {}",
        "why spring_mass tau0 q0 --svg {}",
        "compare spring_mass --svg {}",
        "draw spring_mass --out {}",
    ],
)
@each_row("target", ["missing/a.svg", "folder.svg"])
def test_a_place_that_cannot_be_written_is_told_before_the_work(here, capsys, arguments, target):
    (here / "folder.svg").mkdir(exist_ok=True)
    assert cli.main(arguments.format(target).split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "cannot write" in printed.err
    assert [path.name for path in here.rglob("*")] == ["folder.svg"]


@pytest.mark.parametrize(
    ("module", "extra", "arguments"),
    [
        ("graphviz", "viz", "draw spring_mass --out a.dot"),
        ("graphviz", "viz", "lint spring_mass --svg a.svg"),
        ("resvg_py", "viz", "draw spring_mass --out a.png"),
        ("matplotlib.figure", "viz", "report spring_mass"),
        ("matplotlib.figure", "viz", "animate spring_mass --out a.gif"),
        ("mpmath", "reference", "report --stability --json"),
        ("mujoco", "mujoco", "draw robot.xml --out a.svg"),
    ],
)
def test_a_missing_package_is_an_error_that_names_its_extra(here, without, capsys, module, extra, arguments):
    without(module)
    (here / "robot.xml").write_text(MODEL)
    assert cli.main(arguments.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert f"pip install -e '.[{extra}]'" in printed.err.splitlines()[-1]
    assert [path.name for path in here.iterdir()] == ["robot.xml"]


def test_peers_that_are_not_installed_are_named_with_their_extra(without):
    without("mujoco")
    without("pinocchio")
    assert cli.main(["certify", "spring_mass", "--states", "1"]) == 0
    arm = dyn.certify(dyn.planar_arm([1.0], [1.0]), states=1)
    extras = {"MuJoCo": "mujoco", "Pinocchio": "pinocchio"}
    assert arm.left_out == tuple(
        [f"{name} is not installed: in a checkout of cgraph, pip install -e '.[{of}]'" for name, of in extras.items()]
    )


def test_the_stages_of_an_inspection_are_told_as_they_begin(tmp_path, capsys):
    assert cli.main(["inspect", "spring_mass", "--t-end", "0.2", "--out", str(tmp_path / "a.html")]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "cgraph: reading spring_mass"
    assert said[1].startswith("cgraph: spring_mass: deriving the equations of 1 coordinate, compiling them, and a")
    assert said[-1].startswith("cgraph: spring_mass: writing the page of ")


@pytest.mark.parametrize("arguments", ["report spring_mass --pruning --out a/b", "inspect spring_mass --out a.html"])
def test_a_disk_that_is_full_leaves_nothing_half(here, monkeypatch, capsys, arguments):
    def full(self, data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert cli.main(arguments.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "No space left on device" in printed.err
    assert not [*here.rglob("*")]


def test_a_page_opens_in_the_browser_once_it_is_written(tmp_path, monkeypatch):
    browser, opened, page = tmp_path / "browser.py", tmp_path / "opened", tmp_path / "page.html"
    browser.write_text(f"import sys, pathlib; pathlib.Path({str(opened)!r}).write_text(sys.argv[1])")
    monkeypatch.setenv("BROWSER", f"{sys.executable} {browser} %s")
    assert run("type", "--out", str(page), "--open").returncode == 0
    assert opened.read_text() == page.resolve().as_uri()
    monkeypatch.setenv("BROWSER", f"{tmp_path / 'nothing'} %s")
    monkeypatch.setenv("PATH", str(tmp_path))
    answer = run("type", "--out", str(page), "--open")
    assert (answer.returncode, page.exists()) == (0, True)
    assert "no browser was found" in answer.stderr
