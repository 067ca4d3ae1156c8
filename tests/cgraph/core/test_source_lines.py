"""Source lines: recorded in their scope alone, kept by whatever derives from a node, named in explanations."""

import inspect
import pickle
from pathlib import Path

import numpy as np

import cgraph as cg
import dynamics as dyn

x, y = cg.variables("x y")


def here() -> int:
    frame = inspect.currentframe()
    assert frame is not None
    assert frame.f_back is not None
    return frame.f_back.f_lineno


def numbers(node: cg.Node) -> set[int]:
    """The recorded line numbers of a node, all of this file."""
    assert {Path(line.file).name for line in node.lines} <= {Path(__file__).name}
    return {line.number for line in node.lines}


def test_only_the_scope_records_and_it_closes_on_an_error():
    assert not cg.sin(x).lines
    try:
        with cg.recording_lines():
            assert cg.sin(x).lines
            raise KeyError
    except KeyError:
        pass
    assert not cg.sin(x).lines


def test_a_node_knows_its_own_line_within_tags_arrays_and_calls():
    def twice(node: cg.Node) -> cg.Node:
        return 2.0 * node

    with cg.recording_lines(), cg.tag("link 1"):
        node, line = cg.sin(x), here()
        array = np.array([x, y]) + 1.0
        called = twice(x)
        with cg.recording_lines(), cg.tag("inner"):
            nested, inner = x * y, here()
    assert numbers(node) == {line}
    assert node.tags == {"link 1"}
    assert [numbers(each) for each in array] == [{line + 1}] * 2
    assert numbers(called) == {twice.__code__.co_firstlineno + 1}
    assert numbers(nested) == {inner}
    assert nested.tags == {"link 1", "inner"}
    assert not x.lines


def test_derived_merged_simplified_and_pickled_nodes_keep_the_lines():
    with cg.recording_lines():
        first, one = cg.sin(x) * y, here()
        second, two = cg.sin(x) * cg.exp(y), here()
        graph = cg.Graph([x, y], {"f": first + second})
        three = here() - 1
    for made in (cg.simplify(graph), cg.gradient(graph), cg.jvp(graph), cg.hessian(graph)):
        operations = [node for node in made.nodes if node.args]
        assert all(node.lines for node in operations)
        found = set().union(*[numbers(node) for node in operations])
        assert {one, two} <= found <= {one, two, three}
        again = pickle.loads(pickle.dumps(made))
        assert [node.lines for node in again.nodes] == [node.lines for node in made.nodes]
        assert all(a.label is b.label for a, b in zip(again.nodes, made.nodes, strict=True))
    assert numbers(cg.simplify(graph).outputs["f"]) == {three}
    (sine,) = [node for node in cg.simplify(graph).nodes if node.op.name == "sin"]
    assert numbers(sine) == {one, two}


def test_recording_changes_no_graph():
    arm = [1.0] * 2, [1.0] * 2
    with cg.recording_lines():
        recorded = dyn.inverse_dynamics(dyn.planar_arm(*arm), "by_definition").listing()
    assert recorded == dyn.inverse_dynamics(dyn.planar_arm(*arm), "by_definition").listing()


def test_a_model_of_the_library_has_the_line_that_asked_for_it():
    with cg.recording_lines():
        arm, asked = dyn.planar_arm([1.0], [1.0]), here()
        graph, derived = dyn.inverse_dynamics(arm, "by_definition"), here()
    lines = [numbers(node) for node in graph.nodes if node.args]
    assert set().union(*lines) <= {asked, derived}
    found = cg.lint(graph, independent=("q0", "qd0"), function="L")
    place = f"{Path(__file__).name}:{derived}"
    assert f"{place}\n" in str(found)
    assert "written at" in str(found)
    (said,) = found.to_dict()["findings"][0]["cut"][0]["lines"]
    assert said.endswith(place)


def test_explanations_name_the_lines_where_they_are_known():
    def explained() -> tuple[str, str]:
        node = cg.sin(x) * y
        return str(cg.why(cg.Graph([x, y], {"f": node}), "f", "x")), str(
            cg.lint(cg.Graph([x], {"g": 1.0 - cg.cos(x)}), at={"x": 1e-6})
        )

    first = explained.__code__.co_firstlineno
    with cg.recording_lines():
        why, lint = explained()
    assert why.endswith(f"{Path(__file__).name}:{first + 1}")
    assert f"{Path(__file__).name}:{first + 3}:" in lint
    assert ".py" not in "".join(explained())
