"""One table of counts: the figures, the lesson, lint, the inspector and the page on the paper say the same."""

from pathlib import Path

import dynamics as dyn
from dynamics.equations.formulations.formulation_sizes import TORQUE, blamed
from viz import theme
from viz.graph_drawing.dot import short_formulas
from viz.graph_drawing.legend import kinds_in, legend_svg
from viz.pages.document import Document, to_markdown
from viz.pages.formulation_table import COLORS, TITLES, size_table

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_on_the_paper_has_the_table() -> None:
    table = size_table(dyn.formulation_sizes(dyn.scenes.load("spring_mass")))
    text = to_markdown(Document("", [table]))
    assert text[text.index("|  |") :].strip() in (DOCS / "paper.md").read_text(encoding="utf-8")


def test_an_edge_that_is_there_by_mistake_starts_at_such_a_node_or_enters_what_is_right() -> None:
    """Of a chain every one starts at such a node; of a machine of Atwood's there is none, and the edge is wrong."""
    atwood = dyn.System(lambda q, qd, t, p: p["m"] * qd[0] ** 2 + p["w"] * q[0], ["x"], {"m": 1.5, "w": 9.81})
    for model in (dyn.scenes.load("chain", n=2), atwood):
        for (term, formulation), size in dyn.formulation_sizes(model).items():
            graph, wrong = blamed(model, term, formulation)
            mistakes = {edge for edge in graph.edges if edge.source in wrong.nodes} | wrong.edges
            shape = (len(graph.nodes), len(graph.edges), graph.counts().depth)
            assert size == (*shape, len(wrong.nodes), len(mistakes), 0)
            if model is not atwood:
                assert wrong.nodes == dyn.spurious_nodes(graph)
                assert {edge.source for edge in mistakes} <= wrong.nodes
    size = dyn.formulation_sizes(atwood)[TORQUE, "by_definition"]
    assert (size.spurious_nodes, size.spurious_edges) == (0, 1)


def test_a_term_that_is_gone_is_in_the_table() -> None:
    ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["y"])
    mistakes = [row[-1] for row in size_table(dyn.formulation_sizes(ball)).rows]
    assert mistakes == ["2 nodes, 3 edges", "none", "none", "1 missing term", "none", "none"]


def test_every_formulation_has_a_name_and_a_color_of_its_own() -> None:
    assert list(TITLES) == list(theme.FORMULATIONS)
    assert set(TITLES) == set(dyn.FORMULATIONS)
    assert len(set(COLORS.values())) == len(TITLES)


def test_inner_nodes_are_called_what_they_are() -> None:
    graph = dyn.momentum_rate(dyn.scenes.load("spring_mass"), "by_definition", keep_momentum=True)
    formulas = short_formulas(graph, theme.ONE_JOINT)
    assert {"I α", "I ω", "k θ", "ω dt", "k θ dt"} <= set(formulas.values())
    assert all(len(text) <= 10 and node.name is None for node, text in formulas.items())


def test_a_legend_has_the_kinds_that_are_there_and_is_small() -> None:
    graph = dyn.momentum_rate(dyn.scenes.load("spring_mass"), "chain_rule", keep_momentum=True)
    words = [paint.words for paint in kinds_in(graph)]
    assert words == [theme.ROLES[role].words for role in ("input", "adjoint", "several")] + [theme.OUTPUT.words]
    assert kinds_in(graph, marked=graph.nodes[-1:])[-1] is theme.MARKED
    svg = legend_svg(kinds_in(graph))
    assert 'height="40pt"' in svg
    assert all(f">{text}</text>" in svg for text in words)
