"""Where a model has loops, the page and the commands say that inverse dynamics is that of its tree."""

import json

import pytest

import dynamics as dyn
from tests.viz.page_elements import data_of
from viz import cli
from viz.models.inspection import inspection
from viz.models.inspection_page import inspection_page
from viz.models.remarks import tree_alone

SCENE = """
from tests.dynamics.linkages import four_bar
import dynamics as dyn
from dynamics.equations.states.consistent_state import nearest_state
model = four_bar()
q, qd = nearest_state(model, [0.9, 0.3, 1.4], [1.0, 0.0, 0.0])
linkage = dyn.scenes.Scene("linkage", "", model, tuple(q), tuple(qd), 0.1)
"""


def test_a_tree_needs_no_word():
    assert tree_alone(dyn.scenes.load("triple_pendulum")) == ""


def test_the_page_and_the_commands_say_so(tmp_path, capsys):
    path = tmp_path / "model.py"
    path.write_text(SCENE)
    scene = dyn.scenes.load(f"{path}:linkage")
    said = tree_alone(scene)
    assert "the loop coupler to rocker:" in said
    for command, *arguments in (["lint"], ["why", "tau2", "q1", "--json"]):
        cli.main([command, f"{path}:linkage", *arguments])
        out = capsys.readouterr().out
        assert json.loads(out)["of_the_tree"] if "--json" in arguments else said in out
    page = inspection_page(scene, inspection(scene))
    notices = data_of(page)["notices"]
    assert said in notices
    assert any("No equations in momenta: " in each for each in notices)


@pytest.mark.parametrize("many", [1, 9])
def test_few_names_are_told_and_more_are_counted(many):
    system = dyn.System(
        lambda q, qd, t: 0.5 * sum(each**2 for each in qd), [f"x{i}" for i in range(9)],
        constraints=lambda q, t: {f"row {i}": q[i] for i in range(many)},
    )  # fmt: skip
    said = tree_alone(dyn.scenes.Scene("s", "", system, (0.0,) * 9, (0.0,) * 9, 0.1))
    assert ("constraints row 0, " if many > 1 else "constraint row 0:") in said
    assert ("and 5 more" in said) == (many > 4)
