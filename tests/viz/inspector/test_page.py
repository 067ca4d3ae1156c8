"""The inspector's page: self-contained, and its script computes what the library does."""

import json
import math
import re
from importlib.resources import files

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
import viz
from dynamics.equations.states.consistent_state import nearest_state
from tests.each_row import each_row
from tests.hostile_texts import HOSTILE, hostile_page
from tests.viz.page_elements import Elements, data_of
from viz import cli
from viz.inspector import Motion, Table, Version
from viz.inspector.page import SCRIPTS
from viz.inspector.record import record
from viz.models.inspection import FORMULATIONS, inspection
from viz.pages.formulation_table import TITLES

pytestmark = pytest.mark.usefixtures("without_graphviz")


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory) -> str:
    out = tmp_path_factory.mktemp("page") / "page.html"
    assert cli.main(["inspect", "triple_pendulum", "--out", str(out)]) == 0
    return out.read_text(encoding="utf-8")


def test_it_has_all_formulations_with_their_counts_and_spurious_nodes(pendulum):
    data = data_of(pendulum)
    names = [*[TITLES[name] for name in FORMULATIONS], "forward dynamics", "Hamilton's equations", "state equation"]
    assert [each["name"] for each in data["versions"]] == names
    for name, each in zip(FORMULATIONS, data["versions"], strict=False):
        graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), name)
        arguments = sum(len(node) - 1 for node in each["nodes"] if isinstance(node, list))
        assert (len(each["nodes"]), arguments) == (graph.counts().nodes, graph.counts().edges)
        assert len(each["marked"]) == len(dyn.spurious_nodes(graph))
        names = {name for name, _ in each["inputs"]}
        assert names <= set(data["inputs"]) | {name for name, *_ in data["derived"]["outputs"]}
    assert [len(row) for row in data["rows"]] == [len(data["inputs"])] * len(data["motion"]["t"])
    (table,) = data["tables"]
    assert table["header"][:3] == ["link 1", "link 2", "link 3"]
    assert table["header"][-1] == "all"
    assert [row[0] for row in table["rows"]] == ["tau0", "tau1", "tau2"]


def test_no_text_of_a_graph_becomes_markup_or_script():
    plain = Elements(viz.page(cg.Graph([], {"y": 1.0}), tables=[Table("c", ["a", "b"], [["c", "d"]])]))
    for text in HOSTILE:
        page = hostile_page(text)
        found = Elements(page)
        assert [name for name, _ in found.elements] == [name for name, _ in plain.elements]
        assert not [key for _, attributes in found.elements for key in attributes if key.startswith("on")]
        assert found.texts["title"] == found.texts["h1"] == [text]
        assert text in found.texts["span"]
        assert found.texts["td"] == [text, text]
        assert data_of(page)["versions"][0]["names"]["0"][0] == text.replace(" ", "_")


def test_no_script_is_longer_than_a_file_may_be():
    assert max(len(files("viz.inspector").joinpath(name).read_text().splitlines()) for name in SCRIPTS) <= 350


def test_a_notebook_shows_it_in_a_frame():
    graph = cg.Graph(cg.variables("x y"), {"z": cg.variable("x") * cg.variable("y")})
    shown = viz.page(graph)._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert shown.count('"') == 8  # the page's own are escaped


@each_row(
    ("make", "said"),
    [
        (lambda graph: viz.page([]), "versions"),
        (lambda graph: viz.page([Version("a", graph)] * 2), "names of their own"),
        (lambda graph: viz.page(graph, at={"w": 1.0}), "'w'"),
        (lambda graph: viz.page([Version("a", graph)], marked=[cg.variable("w")]), "marked nodes"),
        (lambda graph: viz.page(graph, at={"x": math.nan}), "finite"),
        (lambda graph: viz.page(graph, at={"x": [1.0, 2.0]}), "one finite number"),
        (lambda graph: viz.page(graph, marked=[cg.variable("w")]), "not in its graph"),
        (lambda graph: viz.page(graph, motion=Motion(np.zeros(0))), "motion"),
        (lambda graph: viz.page(graph, motion=Motion(np.zeros(2), np.zeros((2, 1, 3)), (-1,))), "(2, 1, 2)"),
        (lambda graph: viz.page(graph, motion=Motion(np.zeros(2), np.zeros((2, 1, 2)), (0,))), "parents"),
        (
            lambda graph: viz.page(
                graph,
                motion=Motion(np.zeros(2), np.zeros((2, 1, 2)), (-1,), radii=(0.1,), surfaces=np.zeros((2, 4, 2))),
            ),
            "surfaces must be finite",
        ),
    ],
)
def test_a_mistake_is_told_in_one_line(make, said):
    graph = cg.Graph([cg.variable("x")], {"y": cg.sin(cg.variable("x"))})
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        make(graph)
    assert "\n" not in str(caught.value)


def test_the_command_tells_sizes(tmp_path, capsys):
    out = tmp_path / "page.html"
    assert cli.main(["inspect", "spring_mass", "--forward", "--json", "--out", str(out)]) == 0
    found = json.loads(capsys.readouterr().out)
    counts = dyn.forward_dynamics(dyn.scenes.load("spring_mass")).counts()
    right = {"spurious": 0, "spurious_edges": 0, "differs": False}
    assert found["versions"]["forward dynamics"] == {"nodes": counts.nodes, "edges": counts.edges} | right
    assert found["bytes"] == out.stat().st_size
    data = data_of(out.read_text(encoding="utf-8"))
    assert data["motion"]["points"] is None
    assert data["view"] == "forward dynamics"


def test_a_page_of_coordinates_with_names_shows_these_and_their_units():
    hinge, ball = dyn.Joint("revolute", (0, 1, 0), name="hip_" * 20), dyn.Joint("ball", (0, 0, 0.1), name="knee")
    model = dyn.Mechanism([dyn.Body("thigh", hinge, mass=1.0, center=(0.0, 0.0, -0.2)),
                           dyn.Body("shank", ball, "thigh", 1.0, (0.0, 0.0, -0.2), (0.1, 0.2, 0.2))])  # fmt: skip
    found = inspection(dyn.scenes.Scene("leg", "", model, (0.1, 1.0, 0.0, 0.0, 0.0), (0.0,) * 4, 0.1))
    data = record([found.versions["chain_rule"]], None, dyn.display_names(model), found.units)
    called, units = dict(data["called"]), dict(data["units"])
    (version,) = data["versions"]
    names = [name for name, *_ in version["inputs"] + version["outputs"]]
    assert set(names) <= set(called)
    assert set(names) <= set(units)
    assert (called["q1"], units["q1"]) == ("q.knee.qw", "1")
    assert (called["qd1"], units["qd1"]) == ("qd.knee.wx", "rad/s")
    assert (called["tau0"], units["tau0"]) == ("tau." + "hip_" * 20, "N m")


def test_what_a_model_leaves_out_stands_above_everything():
    x = cg.variable("x")
    page = viz.page(cg.Graph([x], {"y": cg.sin(x)}), notices=["The model leaves out <friction>."])
    assert data_of(page)["notices"] == ["The model leaves out <friction>."]
    assert page.index("<main>") < page.index('id="notices"') < page.index('id="introduction"') < page.index('id="view"')


def test_a_page_of_loops_shows_where_they_close_and_does_not_promise_torques_of_zero():
    rod = {"mass": 1.0, "center": (0.5, 0.0, 0.0), "inertia": (0.0, 0.1, 0.1)}
    first = dyn.Body("a", dyn.Joint("revolute", (0, 1, 0)), **rod)
    bars = [first, dyn.Body("b", dyn.Joint("revolute", (0, 1, 0), (1.0, 0, 0)), "a", **rod)]
    pin = dyn.Loop("point", "b", "world", at=(1.0, 0, 0), to_at=(1.0, 0, 0))
    q, qd = nearest_state(model := dyn.Mechanism(bars, loops=[pin]), [0.5, 1.0], [1.0, 0.0])
    found = inspection(dyn.scenes.Scene("truss", "", model, tuple(q), tuple(qd), 0.1))
    assert "should be 0" not in found.versions["chain_rule"].about
    assert "constraints" in found.versions["chain_rule"].about
    assert np.ptp(found.motion.points[:, -1], axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)
