"""The commands that explain: lint, why and compare, as a person starts them."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import dynamics as dyn
from dynamics.equations.formulations.lagrange_terms import after_step
from tests import high_precision
from tests.each_row import each_row
from viz import cli, theme
from viz.commands.points import filled

EMBEDDED = ("by_definition", "kinetic_only", "kinetic_only_exact")
MODEL = """<mujoco><compiler angle="radian"/><worldbody>
<body name="a"><joint name="slide" type="slide" axis="1 0 0"/><geom size="0.1" contype="0"/>
<body name="b"><joint name="hinge" axis="0 1 0"/><geom size="0.1" pos="0 0 -0.5" contype="0"/></body></body>
</worldbody></mujoco>"""
ROUNDING = 1e-12  # relative, for sums of a few thousand products


@each_row("formulation", EMBEDDED)
def test_lint_blames_the_edges_of_the_embedding(figures, formulation):
    exact = formulation == "kinetic_only_exact"  # embedded, but no derivative is taken through it
    found = figures("lint", "triple_pendulum", "--formulation", formulation, status=int(not exact))
    (finding,) = found["findings"]
    energy = "L" if formulation == "by_definition" else "K"
    assert [cut["text"] for cut in finding["cut"]] == [f"qd.joint {i} * dt -> q.joint {i}" for i in (1, 2, 3)]
    assert [each["gains"] for each in finding["corrupted"]] == [f"dt * d{energy}/dq.joint {i}" for i in (1, 2, 3)]
    assert found["verdict"]["differs"] == (len(found["verdict"]["edges"]) == 3) == (not found["ok"]) == (not exact)
    assert (finding["derivatives_through"] == 0) == exact


@each_row("scene", ["triple_pendulum", "two_link"])
def test_a_state_that_is_asked_for_is_where_the_verdict_is_told(figures, said, scene):
    """With the Euler relation it is the state after the step, in the names that the text prints."""
    model = dyn.scenes.load(scene)
    names = dyn.display_names(model)
    at = {names["q1"]: 0.3, names["qd0"]: -0.7, names["qdd1"]: 0.2}
    point = ",".join([f"{name}={value}" for name, value in at.items()])
    asked = scene, "--formulation", "by_definition", "--at", point
    found = figures("lint", *asked, status=1)["verdict"]
    told = {names.get(name, name): value for name, value in found["at"].items()}
    assert {name: told[name] for name in at} == pytest.approx(at)
    assert len(said("lint", *asked, status=1).partition(" At ")[2].partition(":\n")[0].split(", ")) == len(told)
    verdict = dyn.formulation_verdict(model, "by_definition")
    excess = verdict.excess_at(told | dict(model.parameters))
    assert {name: each["value"] for name, each in found["excess"].items()} == pytest.approx(excess)
    right = dyn.inverse_dynamics(model, "chain_rule").evaluate(found["at"] | dict(model.parameters))
    assert all(each["right"] == pytest.approx(right[name]) for name, each in found["excess"].items())
    causes = figures("why", scene, names["tau0"], *asked[1:])
    system = model.system
    assert after_step(system, causes["at"])["q1"] == pytest.approx(0.3)
    assert after_step(system, causes["at"])["qd0"] == pytest.approx(-0.7)


def test_what_is_off_is_counted(figures):
    """Nothing of K depends on the first angle, and by its velocities dL/dq of it does not change."""
    off = figures("lint", "triple_pendulum", "--formulation", "by_definition", status=1)["verdict"]["off"]
    assert off == {"torques": 3, "of_torques": 3, "slopes": 15, "of_slopes": 18}
    off = figures("compare", "triple_pendulum", status=1)["verdicts"]["chain_rule"]["off"]
    assert (off["torques"], off["slopes"]) == (0, 0)


def test_the_inertial_term_is_drawn_and_its_sizes_are_printed(tmp_path, said, figures, capsys):
    place = tmp_path / "inertial.txt"
    printed = said("draw", "spring_mass", "--inertial-term", "--formulation", "by_definition", "--out", str(place))
    assert "20 nodes" in printed
    assert "p0_dot is" in place.read_text(encoding="utf-8")
    sizes = dyn.formulation_sizes(dyn.scenes.load("spring_mass"))
    rows = figures("compare", "spring_mass", "--sizes")
    assert [tuple(row.values()) for row in rows] == [(*key, *size) for key, size in sizes.items()]
    assert cli.main(["draw", "spring_mass", "--inertial-term", "--forward", "--out", str(place)]) == 2
    assert "--inertial-term is of a Lagrangian" in capsys.readouterr().err


def test_nothing_spurious_is_not_blamed(said):
    assert "What is spurious" not in said("why", "triple_pendulum", "tau.joint 1", "--formulation", "kinetic_only")
    assert "What is spurious" in said("why", "triple_pendulum", "tau.joint 2", "--formulation", "kinetic_only")


def test_a_file_with_a_coordinate_that_nothing_uses_and_with_forces_and_torques(tmp_path, said, figures):
    pytest.importorskip("mujoco")
    model, page = tmp_path / "cart.xml", tmp_path / "page.html"
    model.write_text(MODEL)
    assert "Holds" in said("lint", str(model))
    found = figures("lint", str(model), "--formulation", "by_definition", status=1)
    assert found["scene"] == "cart"
    assert "qd.hinge * dt -> q.hinge" in [cut["text"] for cut in found["findings"][0]["cut"]]
    found = figures("compare", str(model), status=1)
    assert found["left_classes"]["spurious"] > 0
    said("inspect", str(model), "--t-end", "0.1", "--out", str(page))
    text = page.read_text(encoding="utf-8")
    for name, called, unit in (("tau0", "tau.slide", "N"), ("tau1", "tau.hinge", "N m")):
        assert f'["{name}","{called}"]' in text
        assert f'["{name}","{unit}"]' in text


def test_lint_names_what_is_conserved(own, said, figures):
    assert "Constant while no tau acts: p.phi, energy." in said("lint", "own.py:planet")
    assert figures("lint", "own.py:planet")["conserved"] == ["p.phi", "energy"]
    assert "Not known to be constant, as a force or damping does work: energy." in said("lint", "triple_pendulum")


@pytest.mark.filterwarnings("always::dynamics.MechanismWarning")
@pytest.mark.parametrize(
    ("command", "page"),
    [
        (("inspect", "--t-end", "0.1", "--out", "out/cart.html"), "cart.html"),
        (("report", "--pruning", "--out", "out"), "cart-pruning.html"),
    ],
    ids=["inspect", "pruning"],
)
def test_pages_say_at_the_top_what_the_model_lacks(here, capsys, command, page):
    pytest.importorskip("mujoco")
    Path("out").mkdir()
    servo = '</worldbody><actuator><position name="servo" joint="hinge" kp="50"/></actuator>'
    Path("cart.xml").write_text(MODEL.replace("</worldbody>", servo))
    name, *options = command
    assert cli.main([name, "cart.xml", *options]) == 0
    what = "actuators that act with no input (servo: -50 length)"
    assert f"cgraph: warning: 'cart.xml': left out {what}\n" in capsys.readouterr().err
    assert f" {what}." in (here / "out" / page).read_text(encoding="utf-8")


def test_lint_looks_in_a_box_and_at_a_point(said):
    text = said("lint", "triple_pendulum", "--box", "q0=-1:1,qd0=0:2", "--at", "q0=0.5")
    assert "no slope is unbounded in the box" in text
    assert "no sum loses 4 digits at this point" in text


def test_why_adds_up_to_the_derivative(said, figures):
    found = figures("why", "triple_pendulum", "tau0", "q2", "--k", "1000")
    assert found["paths"] == len(found["listed"]) == 22
    graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), "chain_rule")
    exact = float(high_precision.directional(graph, found["at"], {"q2": 1.0})["tau0"])
    assert abs(sum(path["value"] for path in found["listed"]) - exact) <= ROUNDING
    assert found["difference"] <= ROUNDING
    text = said("why", "triple_pendulum", "tau0", "q2", "--k", "1000")
    assert "These are all." in text
    assert "|sum of path products - derivative by a reverse sweep| = " in text

    text = said("why", "triple_pendulum", "tau0", "q2", "--k", "3", "--at", "q0=0.1,q2=-0.4")
    assert "At q.joint 1=0.1, " in text
    assert " q.joint 3=-0.4, " in text
    assert "The 3 heaviest add up to " in text
    assert "% of the weight of all." in text
    assert "|sum over all 22 path products - derivative by a reverse sweep| = " in text


def test_why_a_torque_is_told_by_cause_and_body(said, figures):
    found = figures("why", "triple_pendulum", "joint 2", "--at", "qd0=2")
    scene = dyn.scenes.load("triple_pendulum")
    q, qd, qdd = ([found["at"][f"{kind}{i}"] for i in range(3)] for kind in ("q", "qd", "qdd"))
    table = dyn.torque_by_cause(scene).at(q, qd, qdd)
    assert [*found["parts"].values()] == pytest.approx(table.values[:, 1], rel=ROUNDING, abs=ROUNDING)
    assert found["value"] == pytest.approx(found["sum"], rel=ROUNDING)
    text = said("why", "triple_pendulum", "tau.joint 2", "--at", "qd0=2")
    assert "tau.joint 2 = " in text
    assert " N m, the sum of\n" in text
    assert re.search(r"  gravity +[-+][.0-9]+  [-+]+\n    of link 3 ", text)
    assert re.search(r"  sum +[-+][.0-9]+  = tau.joint 2; difference ", text)
    same = said("why", "triple_pendulum", "tau1", "--at", "qd.joint 1=2", "--formulation", "newton_euler")
    assert same.partition("; difference")[0] == text.partition("; difference")[0]


def test_why_a_cause_is_told_in_every_torque(said, figures):
    found = figures("why", "triple_pendulum", "gravity")
    whole = [figures("why", "triple_pendulum", f"tau{i}")["parts"] for i in range(3)]
    for each in found["causes"]:
        joint = int(each["what"][-1]) - 1
        assert each["parts"] == {name: part for name, part in whole[joint].items() if name.startswith("gravity")}
    heads = {"GRAVITY": "gravity", "coriolis of link 2": "Coriolis of link 2", "centrifugal": "Coriolis"}
    for asked, head in (heads | {"link 3": "what link 3 does", "damping": "damping"}).items():
        assert f"\n{head}, in each of\n  tau.joint " in said("why", "triple_pendulum", asked)
    slopes = figures("why", "triple_pendulum", "gravity", "q.joint 1")["causes"]
    assert [each["what"] for each in slopes] == [f"d tau.joint {i} / d q.joint 1" for i in (1, 2, 3)]
    assert "qdd.joint 1, in each of" not in said("why", "triple_pendulum", "inertia of link 1", "qdd0")


@pytest.mark.parametrize("formulation", ["chain_rule", "by_definition"])
def test_why_a_dependence_is_told_by_cause_and_body(figures, said, formulation):
    found = figures("why", "triple_pendulum", "tau1", "q0", "--formulation", formulation)
    causes = found["causes"]
    assert causes["value"] == pytest.approx(found["derivative"], rel=ROUNDING)
    assert causes["sum"] == pytest.approx(causes["value"], rel=ROUNDING)
    spurious = [part for name, part in causes["parts"].items() if name.startswith("spurious")]
    assert any(spurious) == (formulation == "by_definition")
    text = said("why", "triple_pendulum", "tau1", "q0", "--formulation", formulation)
    assert ("no physics, but a mistake of the formulation: without it" in text) == any(spurious)
    assert text.index("N m per rad, the sum of") < text.index(" along ")  # causes lead, paths follow


def test_why_on_equations_without_causes_lists_derivatives(figures):
    found = figures("why", "spring_mass", "qdd0", "--forward")
    assert found["derivatives"] == {"tau.theta": 1.0, "k": found["derivatives"]["k"], "q.theta": -1.0} | {
        "I": found["derivatives"]["I"]
    }


def test_why_nan_finds_the_operation_and_its_status_is_a_finding(own, said):
    assert said("why", "spring_mass", "--nan") == "All values and derivatives are finite here.\n"
    assert said("why", "triple_pendulum", "tau0", "--k", "2", "q0") == said(
        "why", "triple_pendulum", "tau0", "q0", "--k", "2"
    )
    text = said("why", "spring_mass", "--nan", "qdd0", "--forward", "--at", "I=0,k=3,q0=1,tau0=2", status=1)
    assert text.startswith("qdd.theta is -inf at q.theta = 1")
    assert "It begins with %" in text
    assert "which is -inf, where " in text


def test_two_that_are_not_connected_are_told_why_not(said, figures):
    assert said("why", "spring_mass", "tau0", "qd0").startswith("tau.theta does not depend on qd.theta.\n")
    found = figures("why", "spring_mass", "tau0", "qd0")
    assert found["depends"] is False
    assert found["made_from_inputs"] == ["q.theta", "qdd.theta", "I", "k"]


def test_compare_has_totals_that_add_up_and_a_class_for_every_node(said, figures):
    found = figures("compare", "triple_pendulum", status=1)
    for side in ("left", "right"):
        only = found[f"only_{side}"]
        assert found["in_both"] + len(only) == found[f"{side}_nodes"]
        assert sum(found[f"{side}_classes"].values()) == len(only)
    assert set(found["left_classes"]) == {"needed", "spurious", "takes in a spurious term", "Euler relation"}
    assert {name: each["differs"] for name, each in found["verdicts"].items()} == {
        "by_definition": True,
        "chain_rule": False,
    }
    assert set(found["right_classes"]) == {"needed"}
    arm = dyn.scenes.load("triple_pendulum")
    assert found["left_nodes"] == len(dyn.inverse_dynamics(arm, "by_definition").nodes)
    assert found["left_classes"]["spurious"] == len(dyn.formulation_verdict(arm, "by_definition").nodes)
    text = said("compare", "triple_pendulum", "--formulations", "chain_rule", "chain_rule_literal", status=1)
    assert text.startswith("left: chain_rule, 171 nodes = ")
    assert "spurious" not in text


def test_compare_says_what_the_chain_rule_carries_that_velocities_do_not(said):
    arguments = ("compare", "triple_pendulum", "--formulations", "chain_rule", "newton_euler")
    text = said(*arguments, status=1)
    assert text.startswith("left: chain_rule, 171 nodes = ")
    assert "right: newton_euler, 97 nodes = " in text
    left, right = text.split("Only right:")
    for link in ("link 2", "link 3"):
        assert f"{link}: rate of a slope, of d/dt dL/dqd, which dL/dq cancels in part" in left
    assert "rate of a slope" not in right
    assert "link 1: position, velocity, acceleration, force on a body" in right


def test_an_edge_that_is_wrong_by_itself_is_seen_by_every_command(own, said, figures):
    model, ball, page = "own.py:atwood", "own.py:ball", "page.html"
    found = figures("compare", model, status=1)
    assert found["left_classes"] == {"takes in a spurious term": 2}
    assert [found["verdicts"][name]["differs"] for name in ("by_definition", "chain_rule")] == [True, False]
    assert "By definition, the torque is wrong" in said("compare", model, status=1)
    versions = figures("inspect", model, "--t-end", "0.1", "--out", page)["versions"]
    shown = [(each["spurious"], each["spurious_edges"], each["differs"]) for each in versions.values()]
    assert shown == [(0, 1, True), *[(0, 0, False)] * 6]
    assert "Kinetic only, the torque is right: the mass matrix does not depend on q" in Path(page).read_text(
        encoding="utf-8"
    )
    assert "-dL/dq.y = 9.81 is missing." in said("lint", ball, "--formulation", "by_definition", status=1)
    versions = figures("inspect", ball, "--t-end", "0.1", "--out", page)["versions"]
    assert [each["differs"] for each in versions.values()] == [True, *[False] * 6]
    assert "-dL/dq.y = 9.81 is missing." in Path(page).read_text(encoding="utf-8")


@each_row(
    ("command", "word"),
    [
        ("inspect {} --t-end 0.1 --start knee=1 --out a.html", "chain_rule"),
        ("simulate {} --start qd.hip=1,knee=0.2 --t-end 0.1 --csv a.csv", "q.knee = "),
        ("lint {}", "q.hip"),
        ("lint {} --forward", "q.hip"),
        ("why {} tau.hip q.knee", "q.knee"),
        ("why {} qdd.hip q.knee --forward", "q.knee"),
        ("draw {} --out a.dot", "nodes"),
        ("draw {} --forward --out a.dot", "nodes"),
        ("certify {} --states 1", "energy"),
        ("compare {} --formulations chain_rule chain_rule", "left: chain_rule"),
        ("report {} --pruning", "own.system-pruning.html"),
    ],
)
def test_a_model_of_a_python_file_stands_where_a_scene_does(own, said, command, word):
    text = said(*command.format("own.py:system").split())
    assert word in text
    assert "made" not in text


@each_row(
    "command",
    ["inspect {} --t-end 0.1 --out a.html", "lint {}", "why {} decay_dot decay", "draw {} --out a.dot", "simulate {}"],
)
def test_a_system_of_first_order_has_its_state_equation(own, said, command):
    assert said(*command.format("own.py:slow").split())


def test_the_ten_lines_of_the_readme_are_a_page(own, figures):
    readme = Path(cli.__file__).parents[1].joinpath("README.md").read_text(encoding="utf-8")
    lines = readme.partition("```python\n")[2].partition("```")[0]
    Path("pendulum.py").write_text(lines)
    assert len([line for line in lines.splitlines() if line]) <= 10
    sizes = figures("inspect", "pendulum.py:system", "--out", "a.html")
    assert sizes["bytes"] == Path("a.html").stat().st_size < 500_000
    assert sizes["versions"]["chain_rule"]["spurious"] == 0 < sizes["versions"]["by_definition"]["spurious"]
    assert dyn.scenes.load("pendulum.py:system").coordinates == ("shoulder", "elbow")


def test_a_resting_model_is_told_where_it_starts(own, capsys):
    assert cli.main("inspect own.py:system --t-end 0.1 --out a.html".split()) == 0
    line = "nothing moves, so it starts at q.hip=0.5, q.knee=0.5"
    assert line in capsys.readouterr().err
    assert line in Path("a.html").read_text(encoding="utf-8")


def test_a_motion_is_written_as_csv_and_summed_up(own, figures):
    command = ["simulate", "own.py:system", "--start", "hip=1", "--every", "0.5", "--t-end", "1.2", "--csv", "a.csv"]
    found = figures(*command)
    run = dyn.simulate(dyn.scenes.load("own.py:system"), [1.0, 0.0], [0.0, 0.0], 1.2, t_eval=[0.0, 0.5, 1.0, 1.2])
    names, *rows = [line.split(",") for line in Path("a.csv").read_text().splitlines()]
    assert names == ["t", "q.hip", "q.knee", "qd.hip", "qd.knee", "energy"]
    assert [[float(number) for number in row[:3]] for row in rows] == np.column_stack([run.t, run.q]).tolist()
    assert found["end"]["q.hip"] == run.q[-1, 0]
    assert found["energy_drift"] == np.abs(run.energy - run.energy[0]).max()
    assert found["rows"] == 4
    assert found["steps"] == run.stats.steps


def test_surfaces_of_a_model_and_those_that_a_motion_met_are_told(own, said, figures):
    command = ["simulate", "own.py:belt", "--start", "qd.x=2", "--t-end", "1"]
    assert figures(*command)["surfaces"] == {"qd.x - 0.5": {"met": 1, "slides": [[pytest.approx(0.75), 1.0]]}}
    assert "  surface qd.x - 0.5: met 1 time, stays there t = 0.75 .. 1 s\n" in said(*command)
    assert "surfaces" not in figures("simulate", "own.py:free", "--start", "qd.x=2", "--t-end", "1")
    (found,) = figures("why", "own.py:belt", "--switches", "--at", "qd.x=1")["surfaces"]
    assert found == {"formula": "qd.x - 0.5", "tags": ["force"], "kind": "jump", "by": {"qd0_dot": -4.0}}
    assert "  qd.x - 0.5  [force]: jumps, qd_dot.x by -4\n" in said("why", "own.py:belt", "--switches")
    assert said("why", "own.py:free", "--switches") == "The rate is smooth: nothing in it switches.\n"
    assert cli.main(["why", "own.py:belt", "tau.x", "--switches"]) == 2


def test_a_motion_is_stepped_in_momenta(own, said, figures):
    command = ["simulate", "triple_pendulum", "--t-end", "0.05", "--method", "rk4"]
    found, scene = figures(*command, "--momentum"), dyn.scenes.load("triple_pendulum")
    run = dyn.simulate(scene, scene.q, scene.qd, 0.05, "rk4", form="momentum")
    assert [*found["end"].values()] == [*run.q[-1].tolist(), *run.qd[-1].tolist()]
    assert found["end"] != figures(*command)["end"]
    assert "steps, of coordinates and momenta" in said(*command, "--momentum")
    assert cli.main(["simulate", "own.py:slow", "--momentum"]) == 2


@pytest.mark.filterwarnings("always:the run stopped:dynamics.SimulationWarning")
def test_a_motion_cut_short_is_a_finding(own, figures, capsys):
    assert cli.main(["simulate", "own.py:late", "--csv", "a.csv"]) == 1
    printed = capsys.readouterr()
    assert [line[:37] for line in printed.err.splitlines()[1:]] == ["cgraph: warning: the run stopped at t"]
    assert Path("a.csv").read_text().startswith("t,q.x,qd.x,energy\n0.0,1.0,0.0,")
    found = figures("simulate", "own.py:slow", "--start", "decay=1", "--t-end", "1")
    assert found["end"] == {"decay": pytest.approx(np.exp(-1.0))}
    assert "energy" not in found


@pytest.mark.filterwarnings("always:the run stopped:dynamics.SimulationWarning")
def test_a_motion_that_ends_before_its_time_is_a_finding_and_the_page_says_so(own, capsys):
    page = own / "a.html"
    assert cli.main(["inspect", "own.py:late", "--out", str(page)]) == 1
    said = capsys.readouterr().err
    (line,) = [line for line in said.splitlines() if "stopped" in line]
    sentence = f"The motion is not whole: it {line.removeprefix('cgraph: warning: the run ')}."
    assert page.read_text(encoding="utf-8").count(json.dumps(sentence, ensure_ascii=False)[1:-1]) == 1
    assert cli.main(["inspect", "spring_mass", "--t-end", "0.2", "--out", str(page)]) == 0
    assert "not whole" not in page.read_text(encoding="utf-8")


@each_row(
    ("arguments", "status", "colors"),
    [
        (["lint", "spring_mass", "--formulation", "by_definition"], 1, theme.MARKS[:1]),
        (["why", "spring_mass", "tau0", "q0"], 0, theme.MARKS[:1]),
        (["why", "spring_mass", "tau0", "qd0"], 0, theme.MARKS[1:]),
        (["why", "spring_mass", "--nan", "--forward", "--at", "I=0"], 1, theme.MARKS[:1]),
        (["compare", "spring_mass"], 1, theme.MARKS),
    ],
)
def test_the_answer_is_marked(tmp_path, said, monkeypatch, arguments, status, colors):
    monkeypatch.setattr("viz.commands.library.render_svg", lambda drawing: drawing.source)  # a picture takes seconds
    target = tmp_path / "answer.svg"
    said(*arguments, "--svg", str(target), status=status)
    heavy = [line for line in target.read_text(encoding="utf-8").splitlines() if "penwidth" in line]
    for paint in theme.MARKS:
        assert any(f'color="{paint.line}"' in line for line in heavy) == (paint in colors)


def test_the_answer_is_drawn(tmp_path, said):
    target = tmp_path / "answer.svg"
    said("compare", "spring_mass", "--svg", str(target), status=1)
    svg = target.read_text(encoding="utf-8")
    assert svg.startswith("<svg")
    assert "only by_definition" in svg
    assert "only chain_rule" in svg


def test_a_point_of_a_file_is_its_start_and_takes_bare_names(tmp_path: Path) -> None:
    file = tmp_path / "slide.xml"
    free = '<body name="r" pos="0 0 2"><freejoint name="root"/><geom size="0.1" contype="0"/></body>'
    file.write_text(MODEL.replace("<worldbody>", f"<worldbody>{free}"))
    scene = dyn.scenes.load(str(file))
    at = filled(dyn.inverse_dynamics(scene), scene, {"hinge": 0.5})
    assert [at[f"q{k}"] for k in range(9)] == [*scene.q[:8], 0.5]
    assert not any(at[f"qd{k}"] for k in range(8))
    with pytest.raises(ValueError, match="--at gives hinge twice"):
        filled(dyn.inverse_dynamics(scene), scene, {"hinge": 0.5, "q.hinge": 1.0})


def test_one_node_is_no_plural(own, capsys):
    for command in (["compare", "own.py:free"], ["draw", "own.py:free", "--out", "free.dot"]):
        cli.main(command)
        printed = capsys.readouterr().out
        assert " 1 node" in printed
        assert not re.search(r"\b1 (nodes|edges|steps)", printed)
