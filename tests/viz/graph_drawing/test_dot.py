"""The drawing of a graph as DOT: what is drawn, under which ids, and with which words."""

import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import pytest

import cgraph as cg
from cgraph.core.node import apply
from cgraph.operations.operation import OPS, Op
from tests.each_row import each_row
from viz import render_svg, theme, to_dot
from viz.graph_drawing.dot import main_tag

SVG = "{http://www.w3.org/2000/svg}"


def spring() -> cg.Graph:
    """L = I qd^2/2 - k q^2/2 with its two energies tagged."""
    inertia, k, q, qd = cg.variables("I k q0 qd0")
    with cg.tag("kinetic"):
        kinetic = 0.5 * inertia * qd * qd
    with cg.tag("potential"):
        potential = 0.5 * k * q * q
    return cg.Graph([inertia, k, q, qd], {"L": kinetic - potential})


def chain() -> cg.Graph:
    """Three links, each a few nodes, and one sum of all that no link owns."""
    x = cg.variable("x")
    terms, angle = [], x
    for i in range(1, 4):
        with cg.tag(f"link {i}"):
            angle = cg.sin(angle) * 2.0
            terms.append(angle * angle)
    return cg.Graph([x], {"y": terms[0] + terms[1] + terms[2]})


STATEMENT = re.compile(
    r'^\s*(?P<tail>\w[\w-]*|"[\w-]+")( -> (?P<head>\w[\w-]*|"[\w-]+"))? \[(?P<attributes>.*?)\]$',
    re.MULTILINE | re.DOTALL,
)
ATTRIBUTE = re.compile(r'(\w+)=("(?:[^"\\]|\\.)*"|[^\s"]+)')


def statements(source: str) -> Iterator[tuple[str, str | None, dict[str, str]]]:
    """(tail, head or None, attributes) of each node and edge of a DOT text."""
    for match in STATEMENT.finditer(source):
        if match["tail"] not in {"graph", "node", "edge"}:
            attributes = {key: value.strip('"') for key, value in ATTRIBUTE.findall(match["attributes"])}
            yield match["tail"].strip('"'), match["head"] and match["head"].strip('"'), attributes


def boxes(graph: cg.Graph, **options: Any) -> dict[str, dict[str, str]]:
    found = statements(to_dot(graph, **options).source)
    return {tail: attributes for tail, head, attributes in found if head is None}


def arrows(graph: cg.Graph, **options: Any) -> dict[str, tuple[str, str, dict[str, str]]]:
    found = statements(to_dot(graph, **options).source)
    return {a["id"]: (tail, head, a) for tail, head, a in found if head is not None and "id" in a}


def clusters(graph: cg.Graph, **options: Any) -> dict[str, set[str]]:
    """{title: ids of the nodes inside}."""
    source = to_dot(graph, legend=False, **options).source
    parts = re.findall(r"subgraph cluster_\w+ \{(.*?)\n\t\}", source, re.DOTALL)
    return {re.search(r'tooltip="?(.*?)"?$', p, re.MULTILINE)[1]: {tail for tail, _, _ in statements(p)} for p in parts}  # type: ignore[index]


def test_every_node_and_edge_is_drawn_under_its_number() -> None:
    graph = spring()
    number = {node: i for i, node in enumerate(graph.nodes)}
    assert {f"n{i}" for node, i in number.items() if node.value is None} <= set(boxes(graph))
    expected = {f"e{number[e.source]}-{number[e.target]}-{e.slot}" for e in graph.edges}
    assert set(arrows(graph)) == expected | {f"e{number[graph.outputs['L']]}-o0"}


def test_an_edge_joins_the_nodes_of_its_id() -> None:
    for identity, (tail, head, _) in arrows(spring()).items():
        source, target = identity[1:].split("-")[:2]
        assert tail == f"n{source}" or tail.startswith(f"n{source}-{target}-")
        assert head in (f"n{target}", target)


@each_row("op", [op for op in OPS.values() if op.symbol])
def test_every_operation_can_be_drawn(op: Op) -> None:
    inputs = cg.variables([f"x{i}" for i in range(op.arity)])
    graph = cg.Graph(inputs, {"y": apply(op, *inputs)})
    assert boxes(graph)[f"n{len(graph.nodes) - 1}"]["label"] == op.symbol


def test_a_constant_is_drawn_once_for_each_use() -> None:
    x = cg.variable("x")
    drawn = boxes(cg.Graph([x], {"y": (x * 0.123456) + cg.sin(x * 0.123456)}))
    assert [attributes["label"] for attributes in drawn.values()].count("0.1235") == 2


def test_outputs_are_boxes_of_a_constant_an_input_and_twice_of_one_node_and_names_stand_above_symbols() -> None:
    x = cg.variable("x")
    named = cg.with_name(x * x, "energy")
    shown = boxes(cg.Graph([x], {"a": named, "b": named}))
    assert [shown[each]["label"] for each in ("n1", "o0", "o1")] == ["energy\n×", "a", "b"]
    graph = cg.Graph([x], {"x": x, "two": 2.0})
    drawn = arrows(graph)
    assert {head for _, head, _ in drawn.values()} == {"o0", "o1"}
    assert {tail for tail, _, _ in drawn.values()} <= set(boxes(graph))


def test_given_names_win_over_prettified_ones() -> None:
    drawn = boxes(spring(), names={"qd0": "ω", "L": "Lagrangian"})
    labels = {attributes["label"] for attributes in drawn.values()}
    assert {"ω", "Lagrangian", "q₀"} <= labels


def test_argument_order_is_written_where_it_matters() -> None:
    a, b = cg.variables("a b")
    marks = {
        op: {x.get("headlabel") for _, h, x in arrows(g).values() if h == "n2"}
        for op, g in {"sub": cg.Graph([a, b], {"y": a - b}), "add": cg.Graph([a, b], {"y": a + b})}.items()
    }
    assert marks == {"sub": {"1", "2"}, "add": {None}}


def test_a_role_has_its_color_and_its_line_in_the_legend() -> None:
    graph = cg.jvp(cg.gradient(spring()))
    drawn = boxes(graph)
    for i, node in enumerate(graph.nodes):
        if node.value is None:
            assert drawn[f"n{i}"]["fillcolor"] == theme.ROLES[theme.role_of(node)].fill
    entries = {attributes["label"] for identity, attributes in drawn.items() if identity.startswith("k")}
    expected = {theme.ROLES[theme.role_of(node)].words for node in graph.nodes} | {theme.OUTPUT.words}
    assert entries == expected


def test_the_legend_has_other_words_where_a_role_is_something_else() -> None:
    source = to_dot(spring(), legend={"primal": "stated", "adjoint": "elimination"}).source
    assert "stated" in source
    assert "elimination" not in source  # there is none
    assert theme.ROLES["primal"].words not in source
    assert theme.ROLES["input"].words in source
    assert "legend" not in to_dot(spring(), legend=False).source
    assert "wrong term" in to_dot(spring(), marked={spring().nodes[0]}, marked_label="wrong term").source
    assert "wrong term" not in to_dot(spring(), marked_label="wrong term").source


def test_marked_nodes_and_the_edges_out_of_them_have_a_color_for_each_of_two_groups() -> None:
    graph = spring()
    groups = {name: {node for node in graph.nodes if name in node.tags} for name in ("kinetic", "potential")}
    number = {node: i for i, node in enumerate(graph.nodes)}
    for marked, paints in (
        ({"": groups["potential"]}, {"": theme.SPURIOUS}),
        (groups, dict(zip(groups, [paint.line for paint in theme.MARKS], strict=True))),
    ):
        given = marked if len(marked) > 1 else marked[""]
        drawn, lines = boxes(graph, marked=given), arrows(graph, marked=given)
        for name, nodes in marked.items():
            assert nodes
            for node, i in number.items():
                if node.value is None:
                    assert (drawn[f"n{i}"]["color"] == paints[name]) == (node in nodes)
                    assert ("penwidth" in drawn[f"n{i}"]) == any(node in each for each in marked.values())
            for edge in graph.edges:
                line = lines[f"e{number[edge.source]}-{number[edge.target]}-{edge.slot}"][2]
                assert (line.get("color") == paints[name]) == (edge.source in nodes)
            assert not name or f"label={name}" in to_dot(graph, marked=groups).source
    assert theme.MARKS[0].line != theme.MARKS[1].line


NODE = chain().nodes[-1]


@each_row(
    ("options", "words"),
    [
        ({"marked": {"a": {NODE}, "b": {NODE}}}, "1 marked nodes are in both groups"),
        ({"marked": {"a": {NODE}, "b": (), "c": ()}}, "at most 2 groups, got 3"),
        ({"marked": {spring().nodes[-1]}}, "1 of 1 marked nodes are not in the graph"),
        ({"collapse": ["link 9"]}, r"'link 9'.*link 1, link 2, link 3"),
    ],
)
def test_what_makes_no_sense_is_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        to_dot(cg.Graph([cg.variable("x")], {"y": NODE}), **options)


def test_numbered_tags_make_the_clusters() -> None:
    graph = chain()
    found = clusters(graph)
    assert list(found) == ["link 1", "link 2", "link 3"]
    for i, node in enumerate(graph.nodes):
        if node.value is None:
            assert {title for title, inside in found.items() if f"n{i}" in inside} == set(node.tags)


def test_a_constant_is_in_the_cluster_of_its_user() -> None:
    assert sum("-" in identity for identity in clusters(chain())["link 2"]) == 1


def test_clusters_follow_the_given_tags_or_function() -> None:
    graph = chain()
    assert clusters(graph, clusters=False) == {}
    assert list(clusters(graph, clusters=["link 3"])) == ["link 3"]
    assert list(clusters(graph, clusters=lambda node: "sines" if node.op.name == "sin" else None)) == ["sines"]


@each_row(
    ("tags", "cluster"),
    [
        ((), None),
        (("kinetic",), "kinetic"),
        (("link 2", "kinetic"), "link 2"),
        (("link 1", "link 2"), None),
        (("a", "b"), None),
    ],
)
def test_the_main_tag_is_the_one_with_a_number_or_the_only_one(tags: tuple[str, ...], cluster: str | None) -> None:
    with cg.tag(*tags):
        assert main_tag(cg.variable("x") * 2.0) == cluster


def test_a_collapsed_tag_is_one_box_that_counts_its_nodes() -> None:
    graph = chain()
    inside = [i for i, node in enumerate(graph.nodes) if "link 2" in node.tags]
    drawn = boxes(graph, collapse=["link 2"])
    assert drawn["c0"]["label"] == f"link 2 ({len(inside)} nodes)"
    assert not set(drawn) & {f"n{i}" for i in inside}


def test_merged_edges_say_how_many_they_are() -> None:
    x = cg.variable("x")
    with cg.tag("part"):
        y = x * x
    drawn = arrows(cg.Graph([x], {"y": y + cg.sin(y)}), collapse=["part"])
    assert {(tail, head): a.get("label") for tail, head, a in drawn.values() if "c0" in (tail, head)} == {
        ("n0", "c0"): "×2",
        ("c0", "n2"): None,
        ("c0", "n3"): None,
    }
    assert {"e0-c0", "ec0-2", "ec0-3"} <= set(drawn)


def test_collapsing_loses_no_connection() -> None:
    graph = chain()
    number = {node: i for i, node in enumerate(graph.nodes)}
    box = {
        node: "c0" if "link 1" in node.tags else "c1" if "link 2" in node.tags else f"n{number[node]}"
        for node in graph.nodes
    }
    expected = {(box[e.source], box[e.target]) for e in graph.edges if e.source.value is None}
    drawn = {(t, h) for t, h, _ in arrows(graph, collapse=["link 1", "link 2"]).values() if "-" not in t and h != "o0"}
    assert drawn == {(tail, head) for tail, head in expected if tail != head}


def test_a_node_with_two_collapsed_tags_belongs_to_the_first() -> None:
    x = cg.variable("x")
    with cg.tag("a", "b"):
        y = x * x
    graph = cg.Graph([x], {"y": y})
    assert [i for i in boxes(graph, collapse=["b", "a"]) if i.startswith("c")] == ["c0"]


def test_a_collapsed_box_with_marked_nodes_says_so() -> None:
    graph = chain()
    marked = [node for node in graph.nodes if "link 3" in node.tags][:1]
    box = boxes(graph, collapse=["link 3"], marked=marked)["c0"]
    assert "1 spurious" in box["label"]
    assert box["color"] == theme.SPURIOUS


def test_a_caption_counts_nodes_and_edges() -> None:
    graph = spring()
    assert f"A spring\n{len(graph.nodes)} nodes, {len(graph.edges)} edges" in to_dot(graph, caption="A spring").source
    assert "nodes," not in to_dot(graph).source


def test_tooltips_tell_operation_roles_and_tags() -> None:
    graph = spring()
    i = next(i for i, node in enumerate(graph.nodes) if "kinetic" in node.tags)
    assert boxes(graph)[f"n{i}"]["tooltip"] == "%1: mul; primal; tags: kinetic"


NASTY = ['a"b', r"back\slash", r"\N", "<b>bold</b>", "<html", 'quote\\"', "{record|x}", "a;b", "ω₀"]


def test_any_name_and_tag_is_shown_letter_by_letter() -> None:
    outputs = {}
    for name in NASTY:
        with cg.tag(name):
            outputs[name] = cg.sin(cg.variable(name))
    graph = cg.Graph(cg.variables(NASTY), outputs)
    tree = ElementTree.fromstring(render_svg(to_dot(graph, caption=NASTY[0], legend=False)))
    texts = ["".join(text.itertext()) for text in tree.iter(f"{SVG}text")]
    assert [texts.count(name) for name in NASTY] == [4] + [3] * (len(NASTY) - 1)  # input, output, cluster; a caption


def test_the_picture_carries_the_ids() -> None:
    graph = chain()
    tree = ElementTree.fromstring(render_svg(to_dot(graph)))
    identities = {group.get("id") for group in tree.iter(f"{SVG}g")}
    assert set(boxes(graph)) | set(arrows(graph)) <= identities
