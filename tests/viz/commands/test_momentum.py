"""The commands on the momentum graph: draw, lint, why, compare and inspect with --momentum."""

from pathlib import Path

import pytest

import dynamics as dyn
from tests.each_row import each_row
from viz import cli, theme

ROUNDING = 1e-12  # relative, for sums of a few hundred products
SCENES = ("spring_mass", "own.py:planet", "own.py:flying")


@each_row("scene", SCENES)
def test_lint_and_compare_have_the_sizes_of_both_forms(own, figures, scene):
    model = dyn.scenes.load(scene)
    forms = dyn.state_equation(model), dyn.hamilton_equations(model)
    linted = figures("lint", scene, "--momentum")
    sizes = [{key: getattr(graph.counts(), key) for key in ("nodes", "edges", "depth", "width")} for graph in forms]
    assert [*linted["sizes"].values()][:2] == sizes
    found = figures("compare", scene, "--momentum", status=1)
    assert found["sizes"] == linted["sizes"]
    assert found["sizes"]["velocities alone"]["depth"] <= found["sizes"]["Hamilton's equations"]["depth"]
    assert [found[f"{side}_nodes"] for side in ("left", "right")] == [len(graph.nodes) for graph in forms]
    assert max(found["agreement"].values()) < ROUNDING
    assert not any("bias" in name for name in found["right_classes"])


def test_a_state_at_which_there_is_nothing_to_compare_is_no_number(own, figures):
    assert set(figures("compare", "own.py:away", "--momentum", status=1)["agreement"].values()) == {None}


def test_the_momenta_and_positions_are_proven_apart(own, said):
    text = said("lint", "triple_pendulum", "--momentum")
    assert "no path leads from p.joint 1, p.joint 2 and p.joint 3 to q.joint 1" in text
    counts = dyn.hamilton_equations(dyn.scenes.load("triple_pendulum")).counts()
    assert text.splitlines()[-2].split()[-4:] == [str(counts.nodes), "238", str(counts.depth), "28"]


@each_row(
    ("scene", "asked", "told"),
    [
        ("own.py:planet", "p_dot.phi q.r", True),
        ("own.py:planet", "p_dot.r q.phi", True),  # it is the coordinate that nothing depends on
        ("own.py:planet", "p_dot.r tau.phi", False),
        ("spring_mass", "p0_dot p0", False),
    ],
)
def test_a_rate_that_is_0_is_told_why(own, said, figures, scene, asked, told):
    text = said("why", scene, *asked.split(), "--momentum")
    assert "does not depend on" in text
    assert ("The momentum of 'phi' is constant" in text) is told
    assert ("constant" in figures("why", scene, *asked.split(), "--momentum")) is told


def test_the_momentum_graph_is_drawn(own, said):
    for scene in ("own.py:planet", "triple_pendulum"):
        assert "nodes" in said("draw", scene, "--momentum", "--out", "a.txt")
        listing = Path("a.txt").read_text(encoding="utf-8")
        assert dyn.hamilton_equations(dyn.scenes.load(scene)).listing() in listing
        assert "# p0 is p." in listing
    said("draw", "triple_pendulum", "--momentum", "--out", "a.dot")
    drawn = Path("a.dot").read_text(encoding="utf-8")
    assert all(theme.MOTION_WORDS[role] in drawn for role in ("primal", "adjoint", "tangent"))


COMMANDS = ["draw {} --out a.dot", "lint {}", "why {} p0_dot q0", "compare {}", "inspect {} --out a.html"]


@pytest.mark.parametrize("command", COMMANDS)
@each_row(
    ("scene", "message"),
    [
        ("own.py:ring", "constraint 'ring' holds the momenta"),
        ("own.py:slow", "a first-order system, which has no Lagrangian"),
        ("own.py:named", "parameter 'p0' has the name of a momentum"),
    ],
)
def test_what_has_no_momentum_graph_is_refused_in_one_sentence(own, capsys, command, scene, message):
    assert cli.main([*command.format(scene).split(), "--momentum"]) == 2
    *_, error = capsys.readouterr().err.splitlines()
    assert error.startswith("cgraph: error: ")
    assert message in error
