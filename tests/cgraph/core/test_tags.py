"""Tags and roles: given where a node is written, kept by differentiation, united by merging."""

import gc
import threading
import tracemalloc

import pytest
from hypothesis import given, settings

import cgraph as cg
from cgraph import GraphError
from tests.strategies import cases, examples

x, y = cg.variables("x y")


def labels(graph: cg.Graph) -> set[tuple[str, frozenset[str], frozenset[str]]]:
    return {(node.op.name, node.tags, node.roles) for node in graph.nodes if node.args}


def label(operation: str, tags: str, roles: str) -> tuple[str, frozenset[str], frozenset[str]]:
    return operation, frozenset(tags.split()), frozenset(roles.split())


def test_nodes_carry_the_tags_of_the_blocks_around_them():
    with cg.tag("link 2", "kinetic"):
        outer = x * y
        with cg.tag("linear", "kinetic"):
            inner = x * y
        after = x * y
    outside = x * y
    assert outer.tags == after.tags == {"link 2", "kinetic"}
    assert inner.tags == {"link 2", "kinetic", "linear"}
    assert outside.tags == set()
    assert outside.roles == inner.roles == {"primal"}


def test_leaves_carry_no_tags():
    with cg.tag("a"):
        assert cg.variable("fresh_and_tagged").tags == set()
        assert cg.constant(12345.5).tags == set()
    assert x.roles == {"input"}
    assert cg.constant(12345.5).roles == set()


def test_a_block_that_fails_takes_its_tags_with_it():
    with pytest.raises(GraphError), cg.tag("a"):
        cg.Graph([], {"f": x})
    assert (x + y).tags == set()


@pytest.mark.parametrize("wrong", ["", None, 1, x, ["a"]])
def test_a_tag_must_be_a_non_empty_string(wrong):
    with pytest.raises((TypeError, ValueError), match="the name of a tag must"), cg.tag("a", wrong):
        pass
    assert (x + y).tags == set()


def test_a_derivative_carries_the_tags_of_its_origin_and_its_role():
    with cg.tag("inner"):
        s = cg.sin(x)
    with cg.tag("outer"):
        f = cg.exp(s)
    graph = cg.Graph([x], {"f": f})
    primal = {label("sin", "inner", "primal"), label("exp", "outer", "primal")}
    assert labels(cg.gradient(graph)) == primal | {label("cos", "inner", "adjoint"), label("mul", "inner", "adjoint")}
    assert labels(cg.jvp(graph)) == primal | {
        label("cos", "inner", "tangent"),
        label("mul", "inner", "tangent"),
        label("mul", "outer", "tangent"),
    }


def test_a_second_derivative_has_both_roles():
    with cg.tag("a"):
        graph = cg.Graph([x], {"f": cg.sin(x)})
    assert labels(cg.hessian(graph)) == {label("sin", "a", "adjoint tangent"), label("neg", "a", "adjoint tangent")}
    assert label("mul", "a", "tangent") in labels(cg.jvp(cg.jvp(graph)))
    assert labels(cg.jvp(graph)) == {label("cos", "a", "tangent"), label("mul", "a", "tangent")}


@settings(max_examples=examples(50))
@given(cases())
def test_a_derivative_has_no_tag_that_the_graph_has_not(case):
    written = set().union(*(node.tags for node in case.graph.nodes))
    one = [cg.hessian, cg.gradient] if len(case.graph.outputs) == 1 else []
    with cg.tag("while differentiating"):
        for transform in (cg.jvp, cg.vjp, cg.jacobian, cg.simplify, *one):
            assert set().union(*(node.tags for node in transform(case.graph).nodes)) <= written


@pytest.mark.parametrize("alike", [(cg.sin, cg.sin), (lambda u: u * y, lambda u: y * u)], ids=["sin", "mul"])
def test_merging_unites_tags_and_roles(alike):
    with cg.tag("a"):
        first = alike[0](x)
    with cg.tag("b"):
        second = alike[1](x)
    merged = cg.simplify(cg.Graph([x, y], {"f": first, "g": second}))
    assert labels(merged) == {label(first.op.name, "a b", "primal")}
    assert (first.tags, second.tags) == ({"a"}, {"b"})  # the graph that was given is as it was
    with cg.tag("c"):
        value = cg.cos(x)
    with cg.tag("a"):
        graph = cg.Graph([x], {"f": cg.sin(x)})
    both = cg.simplify(cg.Graph([x], {"f": value, "g": cg.gradient(graph).outputs["df/dx"]}))
    assert labels(both) == {label("cos", "a c", "primal adjoint")}


def test_tags_of_one_thread_do_not_reach_another():
    barrier = threading.Barrier(3, timeout=30)
    made: dict[str, list[cg.Node]] = {}

    def work(name: str) -> None:
        before = x * y
        with cg.tag(name):
            barrier.wait()  # all three are inside their blocks
            inside = x * y
            barrier.wait()
        made[name] = [before, inside, x * y]

    threads = [threading.Thread(target=work, args=(name,)) for name in ("one", "two")]
    for thread in threads:
        thread.start()
    with cg.tag("main"):
        barrier.wait()
        mine = x * y
        barrier.wait()
    for thread in threads:
        thread.join(30)
    assert mine.tags == {"main"}
    assert {name: [node.tags for node in nodes] for name, nodes in made.items()} == {
        "one": [set(), {"one"}, set()],
        "two": [set(), {"two"}, set()],
    }


def test_differentiating_in_one_thread_does_not_fold_what_another_writes():
    barrier = threading.Barrier(2, timeout=30)
    written: list[cg.Node] = []

    def write() -> None:
        barrier.wait()
        written.extend(x * 1 for _ in range(2000))

    thread = threading.Thread(target=write)
    thread.start()
    chain = x
    for _ in range(2000):
        chain = cg.sin(chain) * 2
    graph = cg.Graph([x], {"f": chain})
    barrier.wait()
    cg.gradient(graph)
    thread.join(30)
    assert {node.op.name for node in written} == {"mul"}


def test_a_name_is_kept_by_listings_and_inlining():
    energy = cg.with_name(x * y, "K")
    assert (energy.name, energy.op.name, energy.args) == ("K", "mul", (x, y))
    assert cg.Graph([x, y], {"f": energy + 1})(x=1.0, y=x)["f"].args[0].name == "K"
    assert cg.with_name(x, "K") is x
    assert cg.with_name(2.0, "K") is cg.constant(2.0)


def test_a_name_is_kept_by_simplify():
    twice = cg.Graph([x, y], {"f": cg.sin(x * y) + cg.exp(cg.with_name(x * y, "K"))})
    assert "K" in {node.name for node in cg.simplify(twice).nodes}
    first, other = cg.with_name(x * y, "K"), cg.with_name(x * y, "J")
    for after in (other, x * y):  # of equal nodes the first name stays
        merged = cg.simplify(cg.Graph([x, y], {"f": cg.sin(first) + cg.exp(after)}))
        assert [node.name for node in merged.nodes if node.op.name == "mul"] == ["K"]


def tagged_chain(n: int) -> cg.Graph:
    """A product of n factors, each with a tag of its own: its gradient sums over all of them."""
    node = cg.variable("x")
    for i in range(n):
        with cg.tag(f"link {i}"):
            node = node * cg.sin(cg.variable("x"))
    return cg.gradient(cg.Graph([cg.variable("x")], {"y": node}))


def test_tags_take_memory_with_their_number_and_give_it_back():
    tagged_chain(10)
    tracemalloc.start()
    try:
        taken = []
        for n in (100, 400):
            gc.collect()
            before = tracemalloc.get_traced_memory()[0]
            graph = tagged_chain(n)
            last = max(graph.nodes, key=lambda node: len(node.tags))
            assert last.tags == {f"link {i}" for i in range(n)}
            taken.append(tracemalloc.get_traced_memory()[0] - before)
            del graph, last
            gc.collect()
            assert tracemalloc.get_traced_memory()[0] - before < 0.1 * taken[-1]
    finally:
        tracemalloc.stop()
    assert taken[1] < 5.5 * taken[0]  # four times the tags; the square of four is sixteen
