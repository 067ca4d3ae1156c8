"""Equations of typed Lagrangians are those of the library: torques, accelerations, counts of nodes, lint in words."""

import math
import operator
from collections.abc import Callable
from functools import partial, reduce
from typing import Any

import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
import dynamics as dyn
from tests.each_row import each_row
from tests.strategies import examples
from tests.viz.typed.typed_script import run_typed
from viz.commands.lint import lint_text

ROUNDING = 1e-12  # of the largest number in a graph: two orders of sums, and sines of two libraries
COORDINATES, PARAMETERS = ("u", "v"), {"m": 1.3, "k": 0.7}
POWERS = (2.0, 3.0, 0.5, 1.0)


def trees(n: int) -> st.SearchStrategy[Any]:
    """Formulas over q, qd, t, parameters and numbers, smooth where their values stay small."""
    names = [*COORDINATES[:n], *[f"{name}'" for name in COORDINATES[:n]], *PARAMETERS, "t"]
    leaves = st.sampled_from(names) | st.sampled_from([0.5, 2.0, 3.25, 1.0, 0.0])

    def larger(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
        return (
            st.tuples(st.sampled_from(ONE), inner)
            | st.tuples(st.sampled_from(TWO), inner, inner)
            | st.tuples(st.just("pow"), inner, st.sampled_from(POWERS))
        )

    return st.recursive(leaves, larger, max_leaves=8).filter(has_names)


def has_names(tree: Any) -> bool:
    """Whether it is no number: a line of numbers is a parameter."""
    return isinstance(tree, str) or (isinstance(tree, tuple) and any(has_names(arg) for arg in tree[1:]))


def function(name: str, a: Any) -> Any:
    """Of a number a number, as in a text."""
    if isinstance(a, cg.Node):
        return cg.cbrt(a) if name == "cbrt" else abs(a) if name == "abs" else getattr(cg, name)(a)
    return getattr(math, {"abs": "fabs"}.get(name, name))(a)


# {operation: as one types it, and in Python}; what could be singular is kept away from it.
SPELLED: dict[str, tuple[str, Callable[..., Any]]] = {
    **{name: (f"{name}({{0}})", partial(function, name)) for name in ("sin", "cos", "tanh", "atan", "abs")},
    "exp": ("exp(sin({0}))", lambda a: function("exp", function("sin", a))),
    "cbrt": ("cbrt(2 + cos({0}))", lambda a: function("cbrt", 2.0 + function("cos", a))),
    "neg": ("(-{0})", operator.neg),
    "add": ("({0} + {1})", operator.add),
    "sub": ("({0} - {1})", operator.sub),
    "mul": ("({0} * {1})", operator.mul),
    "div": ("({0} / (1.5 + {1}^2))", lambda a, b: a / (1.5 + b**2)),
    "pow": ("((1.5 + {0}²)^{1})", lambda a, b: (1.5 + a**2) ** b),
}
ONE = [name for name, (text, _) in SPELLED.items() if "{1}" not in text]
TWO = [name for name in SPELLED if name not in ONE and name != "pow"]


def as_text(tree: Any) -> str:
    """The formula as one types it."""
    if isinstance(tree, str | float):
        return str(tree)
    op, *args = tree
    return SPELLED[op][0].format(*map(as_text, args))


def as_node(tree: Any, named: dict[str, Any]) -> Any:
    """The same in Python."""
    if isinstance(tree, str | float):
        return named[tree] if isinstance(tree, str) else tree
    op, *args = tree
    return SPELLED[op][1](*[as_node(arg, named) for arg in args])


def both(tree: Any, n: int) -> tuple[str, dyn.System]:
    """A text with that formula in L, beside a kinetic energy that moves every coordinate, and its System."""
    single = f"0.5 * m * (20 + {as_text(tree)}^2)^-1 * u'^2"
    several = "0.5 * m * u'^2 + 20 * v'^2 + u' * v' * cos(v)"
    lines = ["q: " + ", ".join(COORDINATES[:n]), *[f"{name} = {value}" for name, value in PARAMETERS.items()]]
    lines += (
        [f"L = {single} + 0.1 * sin({as_text(tree)})"]
        if n == 1
        else [f"T = {several}", "V = 0.1 * sin(d)", f"d = {as_text(tree)}"]
    )
    lines += [f"damping {COORDINATES[n - 1]} = k", "tau u = sin(t) * u'"]

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        moving = dict(zip(COORDINATES, q, strict=False))
        moving |= {f"{name}'": node for name, node in zip(COORDINATES, qd, strict=False)}
        moving |= {"t": t, **p}
        if n == 1:
            kinetic = 0.5 * p["m"] * (20.0 + as_node(tree, moving) ** 2) ** -1.0 * qd[0] ** 2.0
            return kinetic + 0.1 * function("sin", as_node(tree, moving))
        with cg.tag("kinetic"):
            kinetic = 0.5 * p["m"] * qd[0] ** 2.0 + 20.0 * qd[1] ** 2.0 + qd[0] * qd[1] * cg.cos(q[1])
        with cg.tag("definition"):
            defined = as_node(tree, moving)
        with cg.tag("potential"):
            potential = 0.1 * function("sin", defined)
        return kinetic - potential

    damping = [0.0] * (n - 1) + [cg.variable("k")]
    system = dyn.System(
        lagrangian,
        COORDINATES[:n],
        PARAMETERS,
        forces=lambda q, qd, t: [cg.sin(t) * qd[0], *[0.0] * (n - 1)],
        damping=damping,
    )
    return "\n".join(lines), system


def point(graph: cg.Graph, numbers: list[float]) -> dict[str, float]:
    values = {name: numbers[i % len(numbers)] for i, name in enumerate(graph.input_names)}
    return values | {name: value for name, value in (PARAMETERS | {"dt": 1e-3}).items() if name in values}


@given(st.integers(1, 2).flatmap(lambda n: st.tuples(st.just(n), trees(n))))
@settings(max_examples=examples(30))
def test_typed_equations_and_accelerations_are_those_of_the_library(case):
    n, tree = case
    text, system = both(tree, n)
    expected = {name: dyn.inverse_dynamics(system, name) for name in ("by_definition", "kinetic_only", "chain_rule")}
    at = {name: point(graph, [0.3, -0.7, 0.45, 0.9, -0.2]) for name, graph in expected.items()}
    found = run_typed(
        """(text, at) => {
          const system = parsed(text);
          return Object.fromEntries(Object.entries(at).map(([name, values]) => {
            const { graph, ...rest } = formulation(system, name);
            return [name, { ...rest, ...outputsAt(graph, values), inputs: graph.inputs.map(({ name }) => name) }];
          }));
        }""",
        text,
        at,
    )
    for name, graph in expected.items():
        mine = found[name]
        assert mine["inputs"] == list(graph.input_names)
        verdict = dyn.formulation_verdict(system, name)
        assert [mine["nodes"], mine["edges"]] == [len(graph.nodes), len(graph.edges)], name
        assert (mine["differs"], mine["off"]) == (verdict.differs, list(verdict.excess))
        assert mine["words"] == without_formulas(verdict)
        if verdict.differs:
            wrong = [len(verdict.nodes), len(verdict.edges), bool(verdict.missing)]
            assert [mine["spurious"], mine["blamed"], mine["lacking"]] == wrong
        q, qd = ([f"{kind}{i}" for i in range(n)] for kind in ("q", "qd"))
        known = {node.name for node in (*graph.inputs, *graph.nodes)}
        if known.issuperset(q):
            lint = cg.lint(
                graph,
                independent=[(q, [each for each in qd if each in known])],
                function="K" if name == "kinetic_only" else "L",
                names=dyn.display_names(system),
            )
            told = lint_text(lint, verdict).splitlines()[len(str(verdict).splitlines()) :]
            told = [line for line in told if not line.startswith("Off are ")]  # the page counts nodes alone
            assert mine["lint"][len(mine["lines"]) :] == told
        if mine["largest"] is None:  # infinite on the way
            continue
        for output, value in graph.evaluate(at[name]).items():
            assert mine["at"][output] == pytest.approx(value, rel=0.0, abs=ROUNDING * max(1.0, mine["largest"]))
    graph = dyn.forward_dynamics(system, "dense", check=True)
    at = point(graph, [0.3, -0.7, 0.45, 0.9, -0.2])
    expected = graph.evaluate(at)
    found = run_typed("(text, at) => outputsAt(TYPED.forwardDynamics(parsed(text)), at)", text, at)
    if expected.pop("info") == 0.0 and found["largest"] is not None:
        expected |= dyn.energy(system).evaluate({name: at[name] for name in dyn.energy(system).input_names})
        bound = ROUNDING * max(1.0, found["largest"])
        assert {name: found["at"][name] for name in expected} == pytest.approx(expected, rel=0.0, abs=bound)


def without_formulas(verdict: dyn.Verdict) -> list[str]:
    """The verdict's sentences as the page has them, which writes no formula of what a torque is off by."""
    formulas = [f" = {each.formula}" for each in verdict.excess.values() if each.formula]
    return [reduce(lambda text, formula: text.replace(formula, ""), formulas, verdict.summary), verdict.why]


# What dL/dq is of each: a number, a parameter's, of a velocity; 0, also by an identity that only numbers show.
NAMED = {
    "L = 1/2*(a + b)*x'^2 + (a - b)*9.81*x\na = 2, b = 1": (True, 1, False),
    "L = 1/2*(x'^2 + y'^2) - 9.81*y": (True, 0, True),
    "L = 1/2*(x'^2 + y'^2) + x*y'": (True, 1, False),
    "L = 1/2*(x'^2 + 3*y'^2)": (False, 0, False),
    "L = 1/2*(sin(x)^2 + cos(x)^2)*x'^2": (False, 0, False),
}


@each_row("text", NAMED)
def test_where_an_edge_alone_is_wrong_or_gone_the_page_says_so(text: str) -> None:
    differs, edges, lacking = NAMED[text]
    found, shown = run_typed(
        """(text) => {
          const system = parsed(text), { graph, ...found } = formulation(system, "by_definition");
          return [found, TYPED.recordOf(system, TYPED.motionOf(system), false).versions];
        }""",
        text,
    )
    assert (found["differs"], found["blamed"], found["lacking"]) == (differs, edges, lacking)
    assert [each["flawed"] for each in shown] == [differs, differs and "x*y'" in text, False]
    assert len(shown[0]["blamed"]) == edges
    assert shown[0]["about"].startswith(f"By definition, the torque is {'wrong at every dt' if differs else 'right'}")
    assert ("-dL/dq.y = 9.81 is missing." in shown[0]["about"]) == lacking
