"""What every part of the library does with the row "asinh"; run by `test_one_row.py`, in a process that has the row."""

import math
import pickle
import re
from dataclasses import replace
from decimal import Decimal

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.core.node import apply
from cgraph.explain.lint.cancellation import ROUNDOFF, rounded
from cgraph.explain.names import Names
from cgraph.extend import OPS
from cgraph.operations.bounds import intervals
from tests.cgraph.engines import RUNNERS
from tests.javascript import evaluated_by_js
from tests.page_script import run_script
from tests.repeated import repeated
from tests.viz.typed.typed_script import run_typed
from viz.inspector.content import State, Version
from viz.inspector.record import record

X = cg.variable("x")
GRAPH = cg.Graph([X], {"y": cg.asinh(X)})
DEEP = cg.Graph([X], {"y": cg.asinh(cg.sin(X) + 2.0) * X})
SEVERAL = 1e-13  # relative: a few dozen roundings


def exact(x: float) -> float:
    return float(mpmath.asinh(mpf(x)))


def deep(x: mpf) -> mpf:
    return mpmath.asinh(mpmath.sin(x) + 2) * x


def test_the_ufunc_and_a_name_make_the_node():
    assert np.arcsinh(X).op is cg.asinh(x=X).op is OPS["asinh"]
    assert "asinh(x[AREA_IN_x])" in cg.to_c(GRAPH, "area").source


@pytest.mark.parametrize("backend", RUNNERS)
def test_in_a_native_loop(backend):
    assert repeated(GRAPH, {"x": "y"}, backend)([512.0], 2)[-1] == pytest.approx([exact(exact(512.0))], rel=SEVERAL)


def test_javascript_has_it_in_math():
    assert evaluated_by_js(cg.to_js(GRAPH), [[27.0]]) == [[pytest.approx(exact(27.0), rel=SEVERAL)]]


def test_simplification_folds_and_shares():
    twice = cg.Graph([X], {"y": cg.asinh(X) + cg.asinh(X), "c": cg.asinh(cg.constant(8.0))})
    simple = cg.simplify(twice)
    assert [node.op.name for node in simple.nodes].count("asinh") == 1
    assert simple.outputs["c"].value == math.asinh(8.0)


def test_lint():
    (finding,) = cg.lint(GRAPH, box={"x": (0.5, 2.0)}).findings
    assert "asinh, of which no bounds are known; x is within [0.5, 2]" in str(finding)
    assert set(intervals(GRAPH.nodes, {"x": (0.5, 2.0)}).values()) == {(0.5, 2.0), (-math.inf, math.inf)}
    at = {"x": 0.6}
    value = GRAPH.evaluate(at)["y"]
    inherited = 0.6 * ROUNDOFF / math.hypot(1.0, 0.6)  # of an input that is half a unit off
    assert rounded(Names(GRAPH), at).errors[GRAPH.outputs["y"]] == pytest.approx(inherited + 2.0 * ROUNDOFF * value)
    lossy = cg.Graph([X], {"y": cg.asinh(X) - 1.0})
    assert "digits are lost" in str(cg.lint(lossy, at={"x": math.sinh(1.0) + 1e-9}))


def test_structure_hash_pickle_and_listing():
    again = pickle.loads(pickle.dumps(DEEP))
    assert again.listing() == DEEP.listing()
    assert "asinh" in again.listing()
    assert cg.structure_hash(again) == cg.structure_hash(DEEP)
    other = cg.Graph([X], {"y": cg.sqrt(cg.sin(X) + 2.0) * X})
    assert cg.structure_hash(other) != cg.structure_hash(DEEP)
    assert not cg.compare(DEEP, again).only_right


def test_why():
    found = cg.why(DEEP, "y", "x", at={"x": 0.7})
    assert found.count == 2
    assert found.derivative == pytest.approx(float(mpmath.diff(deep, 0.7)), rel=1e-10)
    assert "asinh(" in str(cg.why(cg.Graph([X], {"y": cg.asinh(X) * X}), "y", "x"))


def test_the_page_computes_and_writes_the_formula():
    at = {"x": 0.7}
    text = viz.page(DEEP, at=at)
    assert "asinh: Math.asinh ?? (() => NaN)" in text
    program = """(record) => {
      const state = makeState(record), [version] = state.versions, values = state.evaluate(version);
      const out = version.outputs[0][2], bars = adjoints(version, slopesAt(version, values), out);
      return [values[out], bars[version.inputs[0][1]], equation(version, out, 5)];
    }"""
    value, slope, formula = run_script(program, record([Version("deep", DEEP)], None, state=State(at)))
    assert value == pytest.approx(float(deep(mpf(0.7))), rel=SEVERAL)
    assert slope == pytest.approx(float(mpmath.diff(deep, 0.7)), rel=1e-10)
    texts = re.findall(r"'inside': \['([^']*)'\]", str(formula))
    assert texts[texts.index("asinh") + 1] == "("


def test_it_can_be_typed_and_the_page_differentiates_it():
    system = dyn.System(lambda q, qd, t: cg.asinh(q[0] + 2.0) * qd[0] ** 2, ["x"])
    at = {"q0": 0.3, "qd0": 1.5, "qdd0": -0.7}
    program = "(text, at) => outputsAt(TYPED.inverseDynamics(parsed(text), 'chain_rule'), at).at"
    expected = dyn.inverse_dynamics(system, "chain_rule").evaluate(at)
    assert run_typed(program, "L = asinh(x + 2)*x'^2", at) == pytest.approx(expected, rel=SEVERAL)


def test_reference_solutions_take_it_and_ask_for_a_multiprecision_value_that_they_lack(monkeypatch):
    from dynamics.multiprecision.decimal_numbers import mpmath_context, working
    from dynamics.multiprecision.taylor_integrator import Series
    from dynamics.systems.ode_system import OdeSystem

    def coefficients(row):
        monkeypatch.setitem(OPS, row.name, row)
        with working(50):
            graph = OdeSystem(lambda x, t: [apply(row, 1.0 + t)], ["y"]).graph
            (found,) = Series(graph, ["y"], {}, mpmath_context(50)).expand([Decimal(0)], Decimal(0), 8)
            return [mpf(str(k * found[k])) for k in range(1, 9)]

    with mpmath.workdps(50):
        unknown = replace(OPS["asinh"], name="area_sine", library="asinh")
        with pytest.raises(
            NotImplementedError, match=r"area_sine has no multiprecision value: .* the column `precise`"
        ):
            coefficients(unknown)
        precise = replace(unknown, precise=lambda x: mpmath.log(x + (x * x + 1) ** 0.5))
        expected = mpmath.taylor(lambda t: mpmath.asinh(1 + t), 0, 7)
        for row in (OPS["asinh"], precise):
            for found, each in zip(coefficients(row), expected, strict=True):
                assert abs(found - each) < mpf(10) ** -30


def test_an_operation_that_the_c_library_lacks_is_compiled_to_python(monkeypatch):
    pytest.importorskip("llvmlite")
    row = replace(OPS["asinh"], name="area_sine_of", library="area_sine_of", llvm=(), python="", c="")
    monkeypatch.setitem(OPS, row.name, row)
    graph = cg.Graph([X], {"y": apply(row, X)})
    assert cg.compile(graph)([8.0])[0] == math.asinh(8.0)
    with pytest.raises(RuntimeError, match="C library of this machine has no area_sine_of"):
        cg.compile(graph, "llvm")


def test_every_optional_column_is_left_out():
    """So that all that is tested here is what a row needs and its defaults."""
    row, needed = OPS["asinh"], {"name", "arity", "scalar", "array", "partials", "samples"}
    filled = {"arguments", "about", "symbol", "domain", "ufunc", "python", "numpy", "library", "c", "javascript"}
    fields = type(row).__dataclass_fields__
    assert all(getattr(row, name) == fields[name].default for name in set(fields) - needed - filled)
