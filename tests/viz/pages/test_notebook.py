"""What a notebook shows of results: HTML that holds what the text holds, pictures that fit, names that stay text."""

import re
import tomllib
from functools import cache
from html import escape, unescape
from importlib import import_module

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph._shared import remarks_of
from tests.sources import ROOT
from viz import theme
from viz.graph_drawing.render import LARGE_GRAPH
from viz.models.equations_text import model_html
from viz.pages.notebook import COLUMNS, graph_html, trajectory_html

LINE = theme.MARKED.line.lower()
EVIL = "<script>alert(1)</script>"


def words_of_text(text: str) -> list[str]:
    """Without the marks that stand for a column."""
    return re.findall(r"[^\s:()]+", text)


def words(text: str) -> list[str]:
    return unescape(re.sub(r"<[^>]*>", " ", text)).split()


@cache
def results() -> dict[str, object]:
    x, y = cg.variables("x y")
    with cg.tag(EVIL):
        product = x * cg.sin(y)
    graph = cg.Graph([x, y], {"f": product})
    arm = dyn.planar_arm([1.0, 0.5], [1.0, 1.0])
    table = dyn.torque_by_link(arm)
    return {
        "counts": graph.counts(),
        "why": cg.why(graph, "f", "y", at={"x": 1.0, "y": 2.0}, names={"y": EVIL}),
        "why, shortest": cg.why(graph, "f", "y"),
        "why not": cg.why_not(cg.Graph([x, y], {"f": x}), "f", "y"),
        "lint": cg.lint(graph, independent=("x", "y"), names={"x": EVIL}),
        "nothing declared": cg.lint(graph),
        "compare": cg.compare(graph, cg.Graph([x], {"f": x})),
        "compiled": cg.compile(graph, "python"),
        "table": table,
        "table at a state": table.at([0.1, 0.2]),
        "verdict": dyn.formulation_verdict(arm),
        "certificate": dyn.certify(dyn.scenes.load("spring_mass"), states=2),
    }


@pytest.mark.parametrize(("name", "result"), results().items())
def test_a_result_shows_in_a_notebook_what_it_prints(name, result):
    shown = result._repr_html_()
    assert "<script" not in shown
    if name not in {"counts", "compiled"}:
        assert not set(words_of_text(str(result))) - set(words_of_text(unescape(re.sub(r"<[^>]*>", " ", shown))))


def test_counts_and_compiled_graphs_show_their_sizes():
    shown = {name: words(result._repr_html_()) for name, result in results().items()}
    assert shown["counts"][:9] == ["count", "nodes", "4", "edges", "3", "depth", "2", "width", "2"]
    assert "back end python inputs 2 outputs 1 nodes 4 lines" in " ".join(shown["compiled"])


def test_a_large_graph_is_folded_and_the_way_to_its_page_is_said():
    x = cg.variable("x")
    with cg.tag("long"):
        y = x
        for _ in range(LARGE_GRAPH):
            y = cg.sin(y)
    folded = graph_html(cg.Graph([x], {"y": y}))
    assert folded.count("<svg") == 1
    assert "viz.page(graph)" in folded
    assert len(folded) < 20_000


def test_a_node_shows_its_formula():
    x = cg.variable(EVIL)
    shown = cg.sin(x * x)._repr_html_()
    assert "<math" in shown
    assert "<script" not in shown
    assert "sin" in words(shown)
    assert "<math" in cg.constant(2.0)._repr_html_()


def test_a_motion_is_plotted_and_says_how_it_went():
    run = dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], 0.1)
    shown = trajectory_html(run)
    assert shown.count("<svg") == 1
    assert "max-width:100%" in shown
    assert unescape(shown).endswith(f"<p>{run!r}</p>")


def test_states_of_an_ode_are_plotted_and_what_is_left_out_is_said():
    many = COLUMNS + 3
    ode = dyn.OdeSystem(lambda x, t: [-x[i] for i in range(many)], [f"x{i}" for i in range(many)])
    run = dyn.simulate(ode, np.ones(many), None, t_end=0.1)
    assert f"the first {COLUMNS} of {many}" in trajectory_html(run)


def test_every_renderer_that_the_package_names_is_there():
    named = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["cgraph.renderers"]
    for entry in named.values():
        module, _, function = entry.partition(":")
        assert callable(getattr(import_module(module), function))
    assert named["model"] == "viz.models.equations_text:model_html"


def test_a_model_is_shown_by_its_lagrangian_and_torque():
    pendulum = dyn.System(
        lambda q, qd, t, p: 0.5 * p["m"] * p["l"] ** 2 * qd[0] ** 2 + p["m"] * 9.81 * p["l"] * cg.cos(q[0]),
        ["theta"], {"m": 1.0, "l": 2.0},
    )  # fmt: skip
    decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    for model, titles in (
        (pendulum, ["Lagrangian", "Torque, τ = dp/dt − ∂L/∂q"]),
        (decay, ["State equation"]),
        (dyn.planar_arm([1.0] * 3, [1.0] * 3), ["Lagrangian", "Torque by matrices"]),
    ):
        shown = model_html(model)
        assert re.findall("<h4>(.*?)</h4>", shown) == titles
        assert shown.count("<math display") == len(titles)
        assert escape(repr(model)) in shown
    assert "<mi>θ</mi><mo>¨</mo>" in model_html(pendulum)
    assert "<math" not in model_html(dyn.planar_arm([1.0] * 20, [1.0] * 20))  # whose equations are long


def test_a_model_asks_for_what_draws_it(monkeypatch):
    monkeypatch.setattr("cgraph._shared.render_html", lambda kind, what: f"{kind}: {what!r}")
    body = dyn.Body("rotor", dyn.Joint("revolute"), inertia=(0.1, 0.1, 0.2))
    for model in (
        dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]),
        dyn.Mechanism([body]),
        dyn.planar_arm([1.0], [1.0]).system,
    ):
        assert model._repr_html_() == f"model: {model!r}"


@pytest.mark.parametrize("formulation", ["by_definition", "kinetic_only", "chain_rule"])
def test_a_notebook_paints_what_the_verdict_blames_and_calls_coordinates_by_their_names(formulation):
    scene = dyn.scenes.load("spring_mass")
    verdict, graph = dyn.formulation_verdict(scene, formulation), dyn.inverse_dynamics(scene, formulation)
    shown = graph_html(graph)
    groups = re.findall(r'<g id="([^"]+)" class="(node|edge)">(.*?)</a>', shown, flags=re.DOTALL)
    groups = [(unescape(name), of, text) for name, of, text in groups]
    painted = {kind: [name for name, of, text in groups if of == kind and LINE in text] for kind in ("node", "edge")}
    number = {node: i for i, node in enumerate(graph.nodes)}
    known = remarks_of(graph)
    assert len(known.nodes) == len(verdict.nodes)
    assert {f"n{number[node]}" for node in known.nodes} == {
        name for name in painted["node"] if name[0] == "n" and "-" not in name
    }
    assert {f"e{number[a]}-{number[b]}-{slot}" for a, b, slot in known.edges} <= set(painted["edge"])
    assert bool(painted["edge"]) == verdict.differs
    assert (f"<p>{verdict.summary}" in unescape(shown)) == (formulation != "chain_rule")
    assert "q.theta" in shown
    assert (theme.WRONG_OUTPUT.words in shown) == verdict.differs
