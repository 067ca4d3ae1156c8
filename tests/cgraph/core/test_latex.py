"""LaTeX of nodes and graphs: it parses, means what the graph means, and says what it leaves out."""

import math
import re

import pytest
from hypothesis import given, strategies as st

import cgraph as cg
from cgraph.extend import OPS
from cgraph.writing.latex import name_texts

mathtext = pytest.importorskip("matplotlib.mathtext")
A, B, C = cg.variables("a b c")


def parses(text: str) -> None:
    """Raises ValueError where matplotlib's reader of LaTeX does."""
    mathtext.MathTextParser("path").parse(f"${text.replace('&', '')}$")


def rows(block: str) -> list[str]:
    first, *lines, last = block.split("\n")
    assert (first, last) == (r"\begin{aligned}", r"\end{aligned}")
    return [line.removesuffix(r" \\") for line in lines]


def test_every_operation_has_a_formula_that_can_be_read() -> None:
    for op in OPS.values():
        parses(cg.latex(cg.Node(op, (A, B, C)[: op.arity])))
        parses(cg.latex(cg.Node(op, (-(A + B), A * -2.0, A / B)[: op.arity])))


def value(block: str, **at: float) -> dict[str, float]:
    """The equations of a block as a program: +, -, products, powers, sines and fractions."""
    known = {"sin": math.sin, "cos": math.cos, **at}
    for row in rows(block):
        left, right = row.split("&=")
        for latex, python in ((r"\left", ""), (r"\right", ""), (r"\cdot", "*"), (r"\,", "*"), (r"\sin", "sin")):
            right = right.replace(latex, python)
        right = re.sub(r"(v)_{(\d+)}", r"\1\2", right)
        while r"\frac" in right:
            right = re.sub(r"\\frac{([^{}]*)}{([^{}]*)}", r"((\1)/(\2))", right)
        right = right.replace("^", "**").replace("{", "(").replace("}", ")")
        known[re.sub(r"[{}_ ]", "", left)] = eval(right, {}, known)
    return known


@given(st.lists(st.tuples(st.sampled_from(["add", "sub", "mul", "neg", "sin", "square"]), st.integers(0, 9),
                          st.integers(0, 9)), min_size=1, max_size=25), st.integers(1, 60))  # fmt: skip
def test_the_equations_are_the_graph(steps, lines) -> None:
    """Of random graphs; and what is left out is counted."""
    nodes = [A, B, cg.constant(-2.5), cg.constant(3.0)]
    for name, i, j in steps:
        a, b = nodes[i % len(nodes)], nodes[-1 - j % len(nodes)]
        made = {"add": a + b, "sub": a - b, "mul": a * b, "neg": -a, "square": a**2.0}
        nodes.append(made[name] if name in made else cg.sin(a))
    graph = cg.Graph([A, B], {"y": nodes[-1], "z": nodes[-2]})
    point = {"a": 0.3, "b": -0.7}
    found = value(cg.latex(graph, lines=10**6), **point)
    for name, expected in graph.evaluate(point).items():
        assert found[name] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    whole, cut = rows(cg.latex(graph, lines=10**6)), rows(cg.latex(graph, lines=lines))
    if "left~out" in cut[-1]:
        (left, total) = map(int, re.findall(r"out:~(\d+)~of~(\d+)~lines", cut[-1])[0])
        assert total == len(whole)
        assert left + len(cut) - 1 == total
    else:
        assert cut == whole


def test_names_become_letters_with_dots_and_indices() -> None:
    expected = {
        "q0": "q_{0}", "qd12": r"\dot{q}_{12}", "qdd1": r"\ddot{q}_{1}", "tau0": r"\tau_{0}", "M_0_1": "M_{0,1}",
        "p0_dot": r"\dot{p}_{0}", "q_bar": r"\bar{q}", "dt": r"\mathrm{dt}", "qd.knee": r"\dot{q}_{\mathrm{knee}}",
        "q_old.joint 1": r"q_{\mathrm{old},\mathrm{joint~1}}",
        "link 2": r"\mathrm{link~2}", "50%": r"\mathrm{50\%}",
    }  # fmt: skip
    assert name_texts(expected) == expected
    for text in expected.values():
        parses(text)
    assert len(set(name_texts(["a1", "a_1", "qd0", "q0_dot"]).values())) == 4


def test_names_of_people_are_shown() -> None:
    graph = cg.Graph([A], {"y": A * A})
    assert rows(cg.latex(graph, names={"a": "q.knee"})) == [r"y &= q_{\mathrm{knee}} \, q_{\mathrm{knee}}"]


def test_a_node_alone_is_a_formula() -> None:
    assert cg.latex(A / (B - 1.0)) == r"\frac{a}{b - 1}"
    shared = cg.sin(A * B)
    assert rows(cg.latex(shared + shared)) == [r"v_{2} &= \sin\left(a \, b\right)", r"& v_{2} + v_{2}"]


def test_a_method_that_became_a_function_works_with_a_warning() -> None:
    graph = cg.Graph([A], {"y": A * A})
    with pytest.warns(DeprecationWarning, match="call cgraph.latex"):
        assert graph.latex(lines=1) == cg.latex(graph, lines=1)
    with pytest.warns(DeprecationWarning, match="call cgraph.to_networkx"):
        network = graph.to_networkx()
    with pytest.warns(DeprecationWarning, match="call cgraph.from_networkx"):
        assert cg.Graph.from_networkx(network).listing() == graph.listing()


def test_a_long_graph_is_written_in_time_that_grows_linearly() -> None:
    node = A
    for _ in range(5000):
        node = cg.sin(node) * node
    assert len(rows(cg.latex(cg.Graph([A], {"y": node})))) == 41
