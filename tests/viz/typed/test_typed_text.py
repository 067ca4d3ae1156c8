"""What people type: one meaning in every notation, and one sentence with its place for what has none."""

import re

import pytest
from hypothesis import given, strategies as st

from tests.each_row import each_row
from tests.viz.typed.typed_script import run_typed

PENDULUM = """\
m = 2, l = 0.5; g = 9.81   # kg, m, m/s^2
L = 0.5*m*l^2*theta'^2 + m*g*l*cos(theta)
damping = 0.1
theta(0) = 1.2
x1 = l*sin(theta), y1 = -l*cos(theta)
"""


@each_row(
    "line",
    [
        "L = 0.5*m*l**2*thetadot**2 + m*g*l*cos(theta)",
        "L = 0.5·m·l²·θ̇² + m·g·l·cos(θ)",
        "L = 0.5 * m × l^(+2) * θ′^2 − −m*g*l*cos(θ)",
        "L = 0.5*m*l²*θ'² +  # goes on\n\n   m*g*l*cos(\nθ)",
        "L = T - V\nT = 0.5*m*l²*theta_dot²\nV = −m*g*l*cos(theta)",
        "V = -m*g*l*cos(theta); T = 0.5*m*l²*theta'²",
        "q: phi\nL = 0.5*m*l**2*phi'**2 + m*g*l*cos(phi) // the same angle",
        "L = 0.5*m*l²*θ₁̇² + m*g*l*cos(θ1)",
    ],
)
def test_notations_mean_the_same(line):
    numbers = """(text) => {
      const graph = formulation(parsed(text), 'chain_rule').graph;
      return outputsAt(graph, { q0: 0.3, qd0: 2, qdd0: -1, m: 2, l: 0.5, g: 9.81 }).at;
    }"""
    values = "m = 2, l = 0.5, g = 9.81\n"
    assert run_typed(numbers, values + line) == run_typed(numbers, values + PENDULUM.splitlines()[1])


def test_rates_of_definitions_are_those_written_out():
    """Torques of a double pendulum from positions, and from the kinetic energy as in books."""
    start = "m1 = 1, m2 = 0.8, l1 = 1, l2 = 0.7, g = 9.81, x1 = l1*sin(a), y1 = -l1*cos(a)\n"
    places = "x2 = x1 + l2*sin(b), y2 = y1 - l2*cos(b)\nT = 0.5*m1*(x1'^2 + y1'^2) + 0.5*m2*(x2'^2 + y2'^2)"
    book = "T = 0.5*(m1 + m2)*l1²*a'² + 0.5*m2*l2²*b'² + m2*l1*l2*a'*b'*cos(a - b)"
    at = {"q0": 0.4, "q1": -1.1, "qd0": 0.7, "qd1": 1.9, "qdd0": -2.0, "qdd1": 0.6}
    at |= {"m1": 1, "m2": 0.8, "l1": 1, "l2": 0.7, "g": 9.81}
    torques = "(text, at) => outputsAt(formulation(parsed(text), 'chain_rule').graph, at).at"
    potential = "\nV = -(m1 + m2)*g*l1*cos(a) - m2*g*l2*cos(b)"
    found = [run_typed(torques, f"q: a, b\n{start}{each}{potential}", at) for each in (places, book)]
    assert found[0] == pytest.approx(found[1], rel=1e-13)


def test_a_text_says_what_a_system_has():
    found = run_typed(
        """(text) => {
          const { coordinates, parameters, damping, start, points, time, forces } = parsed(text);
          return [coordinates, [...parameters], damping, start, points.length, time, forces.map(({ value }) => value)];
        }""",
        PENDULUM + "time = 2*pi\ntau theta = 0.5",
    )
    expected = [["theta"], [["m", 2], ["l", 0.5], ["g", 9.81]], [0.1], {"q": [1.2], "qd": [0], "said": True}, 1]
    assert found == [*expected, pytest.approx(6.283185307179586), [0.5]]


def test_where_a_point_stays_is_no_parameter_unless_a_formula_has_it():
    names = "(text) => { const { parameters, points } = parsed(text); return [[...parameters.keys()], points.length]; }"
    assert run_typed(names, "L = m*u'^2, m = 1, x1 = u, y1 = 0") == [["m"], 1]
    assert run_typed(names, "L = u'^2 + y1, x1 = u, y1 = 0") == [["y1"], 1]
    assert run_typed(names, "L = u'^2, x1 = 1, y1 = 0, k = 3") == [["k"], 0]


L = "L = x'^2\n"


@each_row(
    ("text", "sentence", "place"),
    [
        ("", "Line 1: There is no Lagrangian: write a line L = ..., or T = ... and V = ....", ""),
        ("L = 3", "Line 1: There is no coordinate: write q: x, or a velocity such as x'.", "L"),
        (L + "= 3", "Line 2: A line is a name, = and a formula, such as m = 1.0, but “=” is here.", "="),
        ("L = 0.5 m x'^2", "Line 1: Between “0.5” and “m” an operator is missing: write * for a product.", "m"),
        ("L = x'^2 (x + 1)", "Line 1: Between “2” and “(” an operator is missing: write * for a product.", "("),
        ("mass = 2\nL = mas*x'^2", "Line 2: There is no “mas”: did you mean mass?", "mas"),
        ("L = m*x'^2", "Line 1: There is no “m”: a line such as m = 1 gives its value.", "m"),
        ("L = x'^2/(2 - 2)", "Line 1: Here something is divided by zero.", "/"),
        ("L = x'^2 + (3", "Line 1: This parenthesis is not closed.", "("),
        ("L = x'^2 + 3)", "Line 1: This parenthesis was not opened.", ")"),
        ("q: x, y\n" + L, "Line 2: L has no y', so “y” has no inertia: a coordinate needs its velocity in L.", "L"),
        (
            "q: a, b, c, d, e\n" + L,
            "Line 1: This page takes up to 4 coordinates, and “e” is one more; the library takes any number.",
            "e",
        ),
        ("L = x'^2 + sin x", "Line 1: “sin” is a function: write what it is of in parentheses, sin(...).", "sin"),
        (
            "L = sine(x)*x'",
            "Line 1: There is no function “sine”: did you mean sin, or is a * missing before the parenthesis?",
            "sine",
        ),
        ("L = x'^2 + atan2(x)", "Line 1: atan2 takes 2 arguments, not 1.", "atan2"),
        ("L = x''^2", "Line 1: “x''” is an acceleration; a formula may have coordinates and velocities.", "x''"),
        ("a = b, b = a, L = x'^2 + a", "Line 1: “a” is defined by itself.", "a"),
        (L + "m = 1\nm = 2", "Line 3: “m” is defined twice.", "m"),
        (L + "pi = 3", "Line 2: “pi” has a meaning of its own; choose another name.", "pi"),
        (L + "x' = 3", "Line 2: A rate is not set by a line; for the start write x'(0) = a number.", "x'"),
        (
            "x = 3\n" + L,
            "Line 2: “x” is set to a number, so it has no rate; for the start write x(0) = that number.",
            "x'",
        ),
        (L + "x(1) = 3", "Line 2: The start is set at time 0, as in x(0) = 1, but “1” is here.", "1"),
        (L + "damping = -1", "Line 2: Damping must be at least 0.", "damping"),
        (L + "tau y = 1", "Line 2: There is no “y”: a line q: lists all coordinates.", "y"),
        ("L = |x'|", "Line 1: “|” is not understood here; write abs(...) for a size.", "|"),
        ("L = x'^2 $ 3", "Line 1: “$” is not understood here.", "$"),
        ("L = sqrt(-1)*x'^2", "Line 1: Here the numbers have no finite result.", "sqrt"),
        (L + "time = 0", "Line 2: The time of a motion must be positive.", "time"),
        ("L = " + "(" * 200 + "x'", "Line 1: More than 100 parentheses and signs stand within one another.", "("),
        ("L = x'" + "+x" * 2000, "Line 1: L has 2002 nodes, and this page takes up to 2000.", "L"),
        ("L = x" + "'" * 6000, "Line 1: The text has 6005 characters, and this page reads up to 5000.", "'"),
    ],
)
def test_what_has_no_meaning_gets_a_sentence_and_its_place(text, sentence, place):
    wrong = run_typed("read", text)["wrong"]
    assert wrong["sentence"] == sentence
    assert wrong["source"] == (text.split("\n")[wrong["line"] - 1] if text else "")
    assert wrong["source"][wrong["column"] : wrong["column"] + wrong["length"]] == place


WORDS = ("L", "x'", "x", "T", "sin(", "tau ", "damping", "q:", "(0)", "y1 = ", "1e9")
PIECES = st.sampled_from([*"+-*/^()=,:;'\n #.01²·", *WORDS])
READ = "(texts) => texts.map((text) => ({ ...read(text), system: 0 }))"


@st.composite
def spoiled(draw):
    """A good text with pieces put in, taken out or put twice; or any text at all."""
    if draw(st.integers(0, 4)) == 0:
        return draw(st.text(max_size=60))
    text = PENDULUM
    for _ in range(draw(st.integers(1, 4))):
        at, length = draw(st.integers(0, len(text))), draw(st.integers(0, 6))
        text = text[:at] + draw(PIECES | st.just("") | st.characters()) + text[at + length :]
    return text


@given(st.lists(spoiled(), min_size=4, max_size=4))
def test_no_text_crashes_it(texts):
    """A system, or one sentence with a place inside the text."""
    for text, found in zip(texts, run_typed(READ, texts), strict=True):
        assert "defect" not in found, (text, found)
        if wrong := found.get("wrong"):
            assert re.fullmatch(r"Line \d+: [A-Za-z“].*[.?]", wrong["sentence"].replace("\n", "⏎")), wrong
            assert 0 <= wrong["column"] <= len(wrong["source"].encode("utf-16-le")) // 2
            assert "\n" not in wrong["source"]


def test_names_of_objects_are_no_functions():
    """What JavaScript's objects inherit has no meaning in a formula."""
    for name in ("constructor", "__proto__", "toString", "hasOwnProperty", "valueOf"):
        for text in (f"L = {name}(x')", f"L = {name} * x'", f"{name} = 3\nL = {name} * x'^2"):
            (found,) = run_typed(READ, [text])
            assert "defect" not in found, found
            assert ("wrong" in found) == (not text.startswith(name))
