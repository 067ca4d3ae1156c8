"""Names of coordinates and velocities: shown and taken wherever a person reads or writes, beside the graphs' own."""

import json

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
import viz
from viz import cli

INERTIA = (0.1, 0.2, 0.25)
HOPPER = dyn.Mechanism(
    [
        dyn.Body("base", dyn.Joint("free"), "world", 2.0, (0.0, 0.0, 0.1), np.diag(INERTIA)),
        dyn.Body("leg", dyn.Joint("ball", name="hip"), "base", 1.0, (0.0, 0.0, -0.2), np.diag(INERTIA)),
        dyn.Body("foot", dyn.Joint("revolute", (0, 1, 0), name="ankle"), "leg", 0.3, (0.1, 0.0, 0.0)),
    ]
)
CALLED = dyn.display_names(HOPPER)


def test_every_input_and_output_of_the_equations_of_a_model_is_called_by_its_coordinate():
    for graph in (
        dyn.inverse_dynamics(HOPPER),
        dyn.inverse_dynamics(HOPPER, "by_definition"),
        dyn.forward_dynamics(HOPPER),
        dyn.momentum(HOPPER),
        dyn.bias(HOPPER),
        dyn.gravity_force(HOPPER),
        dyn.state_equation(HOPPER),
    ):
        unnamed = {*graph.input_names, *graph.outputs} - set(CALLED)
        assert unnamed <= {"dt", "t", "info"}
    for kind, names in (("q", HOPPER.coordinates), ("qd", HOPPER.velocities), ("tau", HOPPER.velocities)):
        assert [CALLED[f"{kind}{i}"] for i in range(len(names))] == [f"{kind}.{name}" for name in names]
    assert CALLED["q3"] == "q.base.qw"
    assert CALLED["qd3"] == "qd.base.wx"
    assert CALLED["q10"] == "q.hip.qz"


def test_questions_are_answered_alike_by_either_name_and_shown_by_the_coordinate_s():
    graph = dyn.inverse_dynamics(HOPPER)
    at = dict.fromkeys(graph.input_names, 0.3)
    shown = {CALLED[name]: value for name, value in at.items()}
    for output, source in (("tau0", "q11"), ("tau9", "q3"), ("tau4", "qd7")):
        one = cg.why(graph, output, source, at=at, k=2)
        other = cg.why(graph, CALLED[output], CALLED[source], at=shown, k=2, names=CALLED)
        assert (one.count, one.derivative) == (other.count, other.derivative)
        assert str(other).startswith(f"{CALLED[output]} depends on {CALLED[source]} along")
    told = str(cg.why_not(graph, CALLED["tau9"], "q0", names=CALLED))
    assert told.startswith("tau.ankle does not depend on q.base.x.")
    box = {"q.ankle": (0.0, 1.0)}
    report = cg.lint(graph, independent=("q.base.qw", "qd3"), depends={"tau.ankle": "q.ankle"}, box=box, names=CALLED)
    assert report.proofs[0] == "no path leads from qd.base.wx to q.base.qw: q.base.qw is an input."
    assert "Nothing uses the input q.base.x." in str(report)


@pytest.mark.parametrize(("wrong", "near"), [("tau.ankel", "tau.ankle"), ("TAU.hip.WX", "tau.hip.wx")])
def test_a_name_that_is_not_there_is_told_the_nearest(wrong, near):
    graph = dyn.inverse_dynamics(HOPPER)
    with pytest.raises(cg.GraphError, match=f"did you mean {near}"):
        cg.why(graph, wrong, "q.ankle", names=CALLED)
    with pytest.raises(cg.GraphError, match=r"did you mean q\.ankle"):
        cg.why(graph, "tau.ankle", "q.ankel", names=CALLED)


def test_a_name_in_the_graph_stands_where_a_coordinate_is_called_alike():
    x, y = cg.variables("q0 q.a")
    graph = cg.Graph([x, y], {"f": 2.0 * x + 3.0 * y})
    assert cg.why(graph, "f", "q.a", at={"q0": 1.0, "q.a": 1.0}, names={"q0": "q.a"}).derivative == 3.0
    with pytest.raises(cg.GraphError, match="twice"):
        cg.why(graph, "f", "q0", at={"q0": 1.0, "x": 1.0, "q.a": 1.0}, names={"q0": "x"})


def test_columns_of_a_trajectory_have_names():
    start = dyn.scenes.Scene("hopper", "", HOPPER, tuple(HOPPER.system.kinematics.neutral), (0.1,) * 10, 0.1)
    run = dyn.simulate(start, start.q, start.qd, 0.02, "rk4", dt=0.01)
    for kind, names in (("q", HOPPER.coordinates), ("qd", HOPPER.velocities), ("qdd", HOPPER.velocities)):
        table = getattr(run, kind)
        for i, name in enumerate(names):
            assert run[f"{kind}.{name}"].tolist() == run[f"{kind}{i}"].tolist() == table[:, i].tolist()
    with pytest.raises(ValueError, match=r"did you mean 'q\.ankle'"):
        run["q.ankel"]
    decay = dyn.simulate(dyn.OdeSystem(lambda x, t: [-x[0]], ["level"]), [1.0], None, 0.1, "rk4", dt=0.1)
    assert decay["level"].tolist() == decay.q[:, 0].tolist()


def test_headers_drawings_and_pages_show_them():
    graph = dyn.forward_dynamics(HOPPER)
    header = cg.to_c(graph, "hopper", names=CALLED).header
    assert "HOPPER_IN_q3 = 3, /* q.base.qw */" in header
    assert "HOPPER_OUT_qdd9 = 9, /* qdd.ankle */" in header
    drawing = viz.to_dot(graph, names=CALLED, collapse=["base", "leg"]).source
    assert "q.hip.qw" in drawing
    assert "qd.base.wx" in drawing


URDF = """<robot name="crawler"><link name="trunk"><inertial><mass value="4"/><inertia ixx="0.1" iyy="0.2" izz="0.2"
ixy="0" ixz="0" iyz="0"/></inertial></link><link name="thigh"><inertial><origin xyz="0 0 -0.1"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="continuous"><parent link="trunk"/><child link="thigh"/><axis xyz="0 1 0"/></joint></robot>"""


def test_the_command_line_takes_and_shows_them(tmp_path, capsys):
    (tmp_path / "crawler.urdf").write_text(URDF)
    scene = [str(tmp_path / "crawler.urdf"), "--floating"]
    assert cli.main(["why", *scene, "tau.hip", "q.trunk.qy", "--k", "1", "--at", "q.hip=0.5"]) == 0
    out = capsys.readouterr().out
    assert "tau.hip depends on q.trunk.qy along" in out
    assert "q.hip=0.5" in out
    assert cli.main(["why", *scene, "tau.hipp", "q.hip"]) == 2
    assert "did you mean 'tau.hip'" in capsys.readouterr().err
    assert cli.main(["lint", *scene, "--json"]) == 0
    proof = json.loads(capsys.readouterr().out)["proofs"][0]
    assert "q.hip" in proof  # the last of the coordinates, which are more than the velocities


def test_what_is_pruned_of_joints_of_several_coordinates_is_counted(tmp_path, capsys):
    """Effects that a joint cannot have, such as a free base's armature, are none that it lacks."""
    (tmp_path / "crawler.urdf").write_text(URDF)
    report = ["report", str(tmp_path / "crawler.urdf"), "--floating", "--pruning", "--json"]
    assert cli.main(report) == 0
    found = json.loads(capsys.readouterr().out)[0]["graphs"]
    absent = {row["what"] for row in found[0]["absent"]}
    assert "springs of thigh" in absent
    assert cli.main([*report, "--lock", "hip=0.5"]) == 0
    assert cli.main([*report, "--lock", "hipp=0.5"]) == 2
    assert "did you mean 'hip'" in capsys.readouterr().err
    assert cli.main([*report, "--lock", "trunk=0.5"]) == 2
    assert "(7,)" in capsys.readouterr().err
