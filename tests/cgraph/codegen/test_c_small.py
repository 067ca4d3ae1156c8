"""Generated C for small machines: numbers of float with their bounds, steps in C, one text for C and C++."""

import ctypes
import math
import re
from dataclasses import replace
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.core.node import apply
from cgraph.core.row import ROWS
from cgraph.operations.operation import OPS
from dynamics.integrators import TABLEAUS
from tests.cgraph.codegen.test_c import CC, CXX, STRICT, WARNINGS, build, called, needs_cc, run
from tests.cgraph.engines import evaluated, points_of
from tests.each_row import each_row
from tests.javascript import stepped_by_js
from tests.ulps import same

X, Y, T = cg.variables("x y t")
SINGLE = ["-Wdouble-promotion", "-Wfloat-conversion", "-Wunsuffixed-float-constants"]  # no arithmetic of doubles
SMALL = {"rk4": TABLEAUS["rk4"]}


def stepped(library, name, inputs, h, n):
    state = np.array(inputs)
    function = library[name]
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_double, ctypes.c_ulong], None
    function(state.ctypes.data, h, n)
    return state


def turning():
    """A state equation with time, a quotient and functions."""
    return cg.Graph([X, Y, T], {"x_dot": Y, "y_dot": -cg.sin(X) / (2.0 + cg.cos(X)) + 0.1 * cg.exp(-T) * X})


MODELS = {
    "arm": lambda: dyn.forward_dynamics(dyn.planar_arm([1.0, 0.7, 0.3], [0.7, 0.6, 0.5], damping=0.1)),
    "chain": lambda: dyn.forward_dynamics(dyn.planar_arm([1.0] * 8, [1.0] * 8)),
    "torques": lambda: dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum")),
    "base": lambda: dyn.state_equation(
        dyn.Mechanism([dyn.Body("body", dyn.Joint("free"), "world", 2.0, [0.1, 0.0, 0.2], np.diag([0.3, 0.4, 0.5]))])
    ),
}


@needs_cc
@each_row("name", MODELS)
def test_errors_of_float_stay_below_the_bound_that_the_header_states(name, tmp_path_factory):
    """Of states that are no numbers of float, beside the same graph in double."""
    graph = MODELS[name]()
    box = dict.fromkeys(graph.input_names, (-3.0, 3.0)) | ({"q3": (0.5, 1.0)} if name == "base" else {})
    source = cg.to_c(graph, name, dtype="float32", box=box)
    points = np.random.default_rng(1).uniform(*np.transpose([*box.values()]), (300, len(box)))
    library = build(tmp_path_factory.mktemp(name), [source], ["-O2", *SINGLE])
    off = np.abs(called(library, name, graph, points, np.float32) - evaluated(graph, points)).max(axis=0)
    bounds = np.array([*source.errors.values()])
    assert np.all(off <= bounds)
    assert np.all(off >= 1e-2 * bounds)  # and say something, also of an elimination
    stated = np.array(re.findall(r"_OUT_\w+ = \d+, /\* (?:.*: )?to (\S+), seen (\S+) \*/", source.header), dtype=float)
    assert np.all((bounds <= stated[:, 0]) & (stated[:, 0] <= 1.1 * bounds))
    assert np.all((0.2 * off <= stated[:, 1]) & (stated[:, 1] <= 1.1 * bounds))


@needs_cc
def test_every_operation_is_one_of_float_alone(tmp_path):
    inputs = cg.variables("a b c")
    graphs = {
        f"op_{op.name}": cg.Graph(inputs[: op.arity], {"y": apply(op, *inputs[: op.arity])}) for op in OPS.values()
    }
    sources = [cg.to_c(graph, name, dtype="float32") for name, graph in graphs.items()]
    library = build(tmp_path, sources, ["-O1", *SINGLE])
    for op in OPS.values():
        name = f"op_{op.name}"
        points = np.float32([point for point in points_of(op, 20) if np.all(np.abs(point) < 1e3)])
        found = called(library, name, graphs[name], points, np.float32)[:, 0]
        exact = evaluated(graphs[name], points.astype(float))[:, 0]
        usable = np.isfinite(exact) & (np.abs(exact) < 1e38) & (np.abs(exact) > 1e-37)
        np.testing.assert_allclose(found[usable], exact[usable], rtol=1e-6, err_msg=op.name)


@needs_cc
@each_row("timed", [True, False])
def test_steps_of_c_and_of_javascript_have_the_same_bits(timed, tmp_path_factory):
    """Without functions of a library."""
    push = 0.25 * T if timed else 0.25
    graph = cg.Graph([X, Y, T][: 2 + timed], {"x_dot": Y, "y_dot": -X * 1.7 - 0.3 * Y * X * X + push})
    methods = {name: TABLEAUS[name] for name in ("euler", "rk4", "dopri5")}
    library = build(tmp_path_factory.mktemp("steps"), [cg.to_c(graph, "linear", methods)])
    text, start = cg.to_js(graph, methods), [0.7, -0.2, *[0.0] * timed]
    for name in methods:
        found = stepped(library, f"linear_{name}", start, 0.01, 1000)
        assert same(found, stepped_by_js(text, name, start, 0.01, 1000))


MAIN = """
#include "swing.h"
#include <stdio.h>

int main(void)
{
    %(type)s x[SWING_N_IN] = {%(one)s}, y[SWING_N_OUT];
    swing_rk4(x, %(h)s, 1000);
    swing(x, y);
    printf("%%.17g %%.17g %%.17g\\n", (double)x[0], (double)x[1], (double)x[2]);
    return 0;
}
"""
DOUBLE = {"type": "double", "one": "1.0", "h": "0.001"}
FLOAT = {"type": "float", "one": "1.0f", "h": "0.001f"}
SANITIZED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-O1", "-g"]


@needs_cc
@pytest.mark.skipif(CXX is None, reason="no C++ compiler")
@each_row(("dtype", "texts"), [("float64", DOUBLE), ("float32", FLOAT)])
def test_one_text_is_c_and_cpp_and_clean_under_sanitizers(dtype, texts, tmp_path_factory):
    folder = tmp_path_factory.mktemp(dtype)
    source, _ = cg.to_c(turning(), "swing", SMALL, dtype=dtype).write(folder)
    (folder / "main.c").write_text(MAIN % texts, encoding="utf-8")
    out = str(folder / "main")
    printed = []
    for compiler in ([CC, *STRICT], [CXX, "-std=c++17", "-x", "c++", *WARNINGS]):
        run([*compiler, *SANITIZED, str(folder / "main.c"), str(source), "-o", out, "-lm"])
        printed.append(run([out]))
    assert printed[0] == printed[1]
    assert np.isfinite([float(number) for number in printed[0].split()]).all()


def test_the_header_says_what_the_text_is_of():
    source = cg.to_c(turning(), "swing", SMALL, dtype="float32", box={"x": (-3.0, 3.0), "t": 2.0}, fma=True)
    for said in (
        f"cgraph {cg.__version__}, structure hash {cg.structure_hash(turning())}; ",
        "numbers are float, fused multiply-add is allowed, steps by rk4.",
        "claims no rights in this text",
        "SWING_IN_x = 0, /* -3 .. 3 */",
        "SWING_IN_t = 2, /* 2 */",
        "void swing_rk4(float *x, float h, unsigned long n);",
    ):
        assert said in source.header
    assert "double" not in source.source + source.header
    assert source.source.count("swing(at,") == 1
    assert cg.to_c(turning(), "swing").errors == {}


def test_a_bound_that_there_is_not_is_said():
    source = cg.to_c(cg.Graph([X], {"y": 1.0 / X, "z": X}), "inverse", dtype="float32", box={"x": 0.0})
    assert "INVERSE_OUT_y = 0, /* no bound */" in source.header
    assert math.isnan(source.errors["y"])
    assert source.errors["z"] == 0.0
    square = cg.to_c(cg.Graph([X], {"y": X * X}), "square", dtype="float32", box={"x": (1.0, 1e30)})
    assert "seen overflow" in square.header


def test_a_constant_too_small_for_float_does_not_vanish():
    """hypot's slope at the origin divides by the smallest number."""
    graph = cg.gradient(cg.Graph([X, Y], {"r": cg.hypot(X, Y)}))
    assert "0x1p-126f" in cg.to_c(graph, "slope", dtype="float32").source


def test_an_operation_without_a_text_in_c_is_an_error():
    """And no call of a function that there is not; one of <math.h> needs none, and a text of one's own is taken."""
    known = type(OPS["sin"])("bessel", 1, math.sin, np.sin, lambda y, a: (1.0,), ((0.3,),))
    with patch.dict(OPS, bessel=known), patch.dict(ROWS, bessel=known):
        graph = cg.Graph([X], {"y": apply(known, X)})
        with pytest.raises(ValueError, match=r"'bessel' has no text in C, and <math\.h> has no function bessel"):
            cg.to_c(graph)
        helper = "static double {name}_bessel(double a)\n{{\n    return 0.5 * sin(a);\n}}\n"
        own = replace(known, c="{name}_bessel({0})", c_helper=helper)
        assert "return 0.5f * sinf(a);" in cg.to_c(cg.Graph([X], {"y": apply(own, X)}), dtype="float32").source
        of_library = replace(known, library="tgamma", c="")
        assert "= tgamma(x[" in cg.to_c(cg.Graph([X], {"y": apply(of_library, X)})).source


@each_row(
    ("make", "kind", "said"),
    [
        (partial(cg.to_c, turning(), "f", dtype="float16"), ValueError, "dtype must be one of float64, float32"),
        (partial(cg.to_c, turning(), "f", box={"x": 1.0}), ValueError, "box says for which inputs"),
        (partial(cg.to_c, turning(), "f", dtype="float32", box={"z": 1.0}), cg.GraphError, "no input z"),
        (partial(cg.to_c, turning(), "f", dtype="float32", box={"x": (1, 0)}), ValueError, "low <= high"),
        (partial(cg.to_c, turning(), "f", dtype="float32", box={"x": (0, math.inf)}), ValueError, "finite numbers"),
        (partial(cg.to_c, cg.Graph([X], {"y": X * 1e300}), "f", dtype="float32"), ValueError, "1e[+]300 is beyond"),
        (partial(cg.to_c, turning(), "f", {"rk4": 4}), TypeError, "method 'rk4' must be a tableau"),
        (partial(cg.to_c, turning(), "f", {"a-b": TABLEAUS["rk4"]}), ValueError, "must be a letter, then letters"),
        (partial(cg.to_c, cg.Graph([X], {"a": X, "b": X}), "f", SMALL), cg.GraphError, "2 outputs of 1 input"),
        (partial(cg.to_c, turning(), "f", SMALL, time=3), TypeError, "time must be the name"),
        (
            partial(cg.to_c, cg.Graph([X], {"y": X**1.5}), "f", {"pow": TABLEAUS["rk4"]}),
            ValueError,
            "must not be called pow",
        ),
    ],
)
def test_a_mistake_is_told_in_one_sentence(make, kind, said):
    with pytest.raises(kind, match=said) as caught:
        make()
    assert "\n" not in str(caught.value)
