"""Names: any printable text, kept as a label; every back end computes by position, whatever they are."""

import pickle
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import example, given, settings, strategies as st

import cgraph as cg
import dynamics as dyn
import viz

ALIKE = "ϕ φ ϵ ε ϑ θ µ μ q₁ q1 x² x2 ſin sin ａbs abs é e\u0301 ﬁ fi ℯ e \u212a K".split()  # one to Python, in pairs
WORDS = """lambda None yield x v1 x0 x_0 function np inf float print __import__ printf NULL size_t double EOF restrict
    class main */ /* // #define %1 {} {0} %s \\ \\N " ' ` <b> &lt; </script> onload= x"onpointerover="a {tables} $x
    __proto__ constructor toString 0 1.5 -1 nan a,b a;b # ;import""".split()
NAMES = st.sampled_from(ALIKE + WORDS) | st.text(
    st.characters(codec="utf-8", exclude_categories=["Cc", "Cf", "Cn", "Co", "Cs", "Z"]), min_size=1, max_size=6
).filter(lambda name: name.isprintable())


def weighted(names, outputs):
    """Every input times its own weight: a confusion of two names cannot cancel."""
    inputs = cg.variables(names)
    total = sum((i + 1.0) * x for i, x in enumerate(inputs))
    return cg.Graph(inputs, {name: cg.with_name(total * (k + 1.0), names[0]) for k, name in enumerate(outputs)})


@example(ALIKE, ["d"])
@given(st.lists(NAMES, min_size=1, max_size=8, unique=True), st.lists(NAMES, min_size=1, max_size=3, unique=True))
@settings(max_examples=10)
def test_generated_code_goes_by_position_whatever_the_names(names, outputs):
    graph = weighted(names, outputs)
    point = [3.0**i for i in range(len(names))]
    expected = list(graph.evaluate(dict(zip(names, point, strict=True))).values())
    assert expected == [(k + 1.0) * sum((i + 1.0) * x for i, x in enumerate(point)) for k in range(len(outputs))]
    for backend in ("python", "numpy", "auto"):
        assert cg.compile(graph, backend)(point).tolist() == expected, backend
    again = pickle.loads(pickle.dumps(graph))
    assert (again.input_names, list(again.outputs)) == (tuple(names), outputs)
    assert len(graph.listing().splitlines()) == 1 + len(outputs) + sum(bool(node.args) for node in graph.nodes)
    drawing = viz.to_dot(graph).source
    assert (
        len(re.findall(r"^\s*[no]\d+ \[", drawing, re.MULTILINE))
        == len([*outputs, *(node for node in graph.nodes if node.value is None)])
        or "->" in drawing
    )
    assert len(cg.gradient(cg.Graph(graph.inputs, {"L": graph.outputs[outputs[0]]})).outputs) == len(names)


def as_body(name, joint=""):
    return dyn.Mechanism([dyn.Body(name, dyn.Joint("revolute", name=joint), mass=1.0, center=(1.0, 0.0, 0.0))])


def as_tag(name):
    with cg.tag(name):
        return cg.sin(cg.variable("x"))


NAMED = {
    "variable": cg.variable,
    "variables": lambda name: cg.variables([name]),
    "node": lambda name: cg.with_name(cg.sin(cg.variable("x")), name),
    "leaf": lambda name: cg.with_name(cg.variable("x"), name),
    "output": lambda name: cg.Graph([], {name: 1.0}),
    "tag": as_tag,
    "coordinate": lambda name: dyn.System(lambda q, qd, t: qd[0] ** 2, [name]),
    "state": lambda name: dyn.OdeSystem(lambda x, t: [x[0]], [name]),
    "parameter": lambda name: dyn.System(lambda q, qd, t: qd[0] ** 2, ["x"], {name: 1.0}),
    "body": as_body,
    "joint": lambda name: as_body("a", name),
    "event": lambda name: dyn.Event(name, lambda q, qd, t: q[0]),
}
BREAKING = [f"a{sign}b" for sign in "\n\r\u2028\u202e\u200b\x85"]
REFUSED = [*BREAKING, "a\x00", "\x1b[31m", "\ud800", "x" * 10**6, 1, None]


@pytest.mark.parametrize("what", NAMED)
def test_a_name_that_would_break_a_text_is_refused_wherever_it_is_given(what):
    NAMED[what]("fine·name")
    for name in [*REFUSED, *([] if what == "joint" else [""])]:  # a joint without a name has its body's
        with pytest.raises((TypeError, ValueError)) as caught:
            NAMED[what](name)
        message = str(caught.value)
        assert message.isprintable()
        assert len(message) < 200


def test_threads_that_ask_for_one_name_get_one_node():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for trial in range(20):
            gate = threading.Barrier(8)

            def ask(_, trial=trial, gate=gate):
                gate.wait()
                return [(cg.variable(f"race{trial}_{i}"), cg.constant(trial + i / 7.0)) for i in range(20)]

            with ThreadPoolExecutor(8) as pool:
                seen = list(pool.map(ask, range(8)))
            assert all(pair == seen[0] for pair in seen)
    finally:
        sys.setswitchinterval(before)
