"""Models of Python files and modules, by name, and what is said where there is none."""

import sys
from pathlib import Path

import pytest

import dynamics as dyn
from dynamics import scenes
from tests.each_row import each_row

PENDULUM = """
import cgraph as cg
import dynamics as dyn
from lengths import LENGTH

def lagrangian(q, qd, t):
    return 0.5 * LENGTH**2 * qd[0] ** 2 + 9.81 * LENGTH * cg.cos(q[0])

print("made")
system = dyn.System(lagrangian, ["swing"])
arm = dyn.planar_arm([1.0], [LENGTH])
scene = dyn.Scene("own", "with a start", arm, (0.3,), (0.1,), 1.0)
first = dyn.OdeSystem(lambda x, t: [-x[0]], ["decay"])

def make():
    return arm

def fail():
    return 1 / 0

def leave():
    raise SystemExit(3)

def nothing():
    pass

class Signal(SystemExit):
    pass

def stopped():
    raise Signal(130)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "models.py").write_text(PENDULUM)
    (tmp_path / "lengths.py").write_text("LENGTH = 0.5\n")
    (tmp_path / "shelf").mkdir()
    (tmp_path / "shelf" / "__init__.py").write_text("from .arms import arm\n")
    (tmp_path / "shelf" / "arms.py").write_text("import dynamics as dyn\narm = dyn.planar_arm([1.0], [1.0])\nbad = 3\n")
    (tmp_path / "broken.py").write_text("import dynamics\n\nsystem = 1 / 0\n")
    (tmp_path / "half.py").write_text("x = 1\nsystem = (\n")
    (tmp_path / "away.py").write_text("import nowhere_at_all\n")
    (tmp_path / "bytes.py").write_bytes(b"\xff\xfe")
    (tmp_path / "empty.py").write_text("")
    (tmp_path / "folder.py").mkdir()
    (tmp_path / "bare").mkdir()
    monkeypatch.chdir(tmp_path)
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if name.partition(".")[0] in ("shelf", "lengths"):
            del sys.modules[name]


@each_row(
    ("name", "called", "coordinates"),
    [
        ("models.py:system", "models.system", ("swing",)),
        ("{}/models.py:system", "models.system", ("swing",)),
        ("models.py:arm", "models.arm", ("joint 1",)),
        ("models.py:make", "models.make", ("joint 1",)),
        ("models.py:first", "models.first", ("decay",)),
        ("models.py:scene", "own", ("joint 1",)),
        ("models:arm", "models.arm", ("joint 1",)),
        ("shelf:arm", "shelf.arm", ("joint 1",)),
        ("shelf.arms:arm", "arms.arm", ("joint 1",)),
    ],
)
def test_any_model_in_python_is_a_scene(name, called, coordinates, folder, capsys):
    path = list(sys.path)
    scene = scenes.load(name.format(folder))
    assert (scene.name, scene.coordinates) == (called, coordinates)
    assert scene.q == ((0.3,) if called == "own" else (0.0,))
    assert sys.path == path
    sys.modules.pop("models", None)
    assert capsys.readouterr().out == ""  # what a file prints is no answer


@each_row(
    ("name", "message"),
    [
        ("nowhere.py:system", "there is no file 'nowhere.py'"),
        ("folder.py:system", "'folder.py' is a folder, and a model is in a file"),
        ("bare:system", "'bare' is a folder, and a model is in a file, as in 'bare/model.py:system'"),
        ("models.py", "'models.py' is a Python file: name the model in it, as in 'models.py:system'"),
        ("models.py:sistem", "'models.py' has no 'sistem'; did you mean 'system'?"),
        ("models.py:xyz", "'models.py' has no 'xyz'; it has system, arm, scene, first"),
        ("empty.py:xyz", "'empty.py' has no 'xyz'; it has none"),
        ("models.py:LENGTH", "'models.py:LENGTH' is no model but float: 0.5; needed is a System, "),
        ("models.py:nothing", "'models.py:nothing()' is no model but NoneType: None; needed is a System, "),
        ("models.py:lagrangian", "'models.py:lagrangian' takes (q, qd, t); needed is a System, "),
        ("models.py:fail", "models.py, line 19: ZeroDivisionError: division by zero"),
        ("models.py:leave", "models.py, line 22: SystemExit: 3"),
        ("broken.py:system", "broken.py, line 3: ZeroDivisionError: division by zero"),
        ("half.py:system", "half.py, line 2: SyntaxError: '(' was never closed"),
        ("away.py:system", "away.py, line 1: ModuleNotFoundError: No module named 'nowhere_at_all'"),
        ("bytes.py:system", "bytes.py"),
        ("shelf.arms:bad", "'shelf.arms:bad' is no model but int: 3; needed is a System, "),
        ("broken:system", "broken, line 3: ZeroDivisionError: division by zero"),
        ("nowhere_at_all.arms:arm", "there is no module 'nowhere_at_all'"),
        ("shelf.legs:leg", "there is no module 'shelf.legs'"),
    ],
)
def test_what_is_no_model_is_told_in_one_sentence(name, message):
    path = list(sys.path)
    with pytest.raises(ValueError, match=r".") as raised:
        scenes.load(name)
    assert str(raised.value).startswith(message)
    assert "\n" not in str(raised.value)
    assert sys.path == path


def test_what_a_signal_raises_is_no_error_of_the_file():
    with pytest.raises(SystemExit, match="130"):
        scenes.load("models.py:stopped")


def test_a_file_that_changes_is_executed_anew(folder):
    for name in ("a", "b"):
        text = f"import dynamics as dyn\nsystem = dyn.System(lambda q, qd, t: qd[0] ** 2, '{name}')"
        (folder / "again.py").write_text(text)
        assert scenes.load("again.py:system").coordinates == (name,)


def test_options_of_files_are_none_of_a_python_model_s():
    with pytest.raises(TypeError, match=r"scene 'models.py:system' has no option 'ignore'; it has none"):
        scenes.load("models.py:system", ignore=True)


@pytest.mark.parametrize("model", [None, 3, dyn.System, "chain"])
def test_what_is_no_model_makes_no_scene(model):
    with pytest.raises(TypeError, match="expected a"):
        scenes.of_model(model)
