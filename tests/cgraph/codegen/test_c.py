"""Generated C: compiled by a C compiler, every operation and many graphs to the last bit of evaluation."""

import ctypes
import itertools
import math
import re
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

import cgraph as cg
import dynamics as dyn
from cgraph.codegen import statements as body
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from cgraph.util.atomic_write import atomic_write
from tests.cgraph.core.test_names import ALIKE, WORDS
from tests.cgraph.engines import ODD_POINTS, SPECIAL, evaluated, odd_graphs, points_of
from tests.slow import slow
from tests.strategies import cases
from tests.tolerances import EQUATIONS
from tests.ulps import same

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
CXX = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler")
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
STRICT = ["-std=c99", *WARNINGS]


def build(folder, sources, flags=("-O2",)):
    files = [str(source.write(folder)[0]) for source in sources]
    library = folder / f"{sources[0].name}.so"
    run([CC, *STRICT, *flags, "-shared", "-fPIC", *files, "-o", str(library), "-lm"])
    return ctypes.CDLL(str(library))


def run(command):
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def called(library, name, graph, points, dtype=np.float64):
    function = library[name]
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], None
    found = np.full((len(points), len(graph.outputs)), 123.0, dtype)
    for point, row in zip(np.array(points, dtype).reshape(len(points), -1), found, strict=True):
        function(point.ctypes.data, row.ctypes.data)
    return found.astype(float)


def agrees(folder, graphs, points, flags=("-O2",)):
    """Asserts that graphs {name: graph}, compiled together, have the bits of evaluation at points {name: rows}."""
    library = build(folder, [cg.to_c(graph, name) for name, graph in graphs.items()], flags)
    found = {name: called(library, name, graph, points[name]) for name, graph in graphs.items()}
    assert [name for name, graph in graphs.items() if not same(found[name], evaluated(graph, points[name]))] == []


def with_specials(op):
    """The operation on variables, and on every special number in the place of each."""
    inputs = cg.variables(["a", "b", "c"][: op.arity])
    outputs = {"y": apply(op, *inputs)}
    for slot, number in itertools.product(range(op.arity), SPECIAL):
        if not math.isnan(number):
            outputs[f"{number!r} at {slot}"] = apply(op, *inputs[:slot], number, *inputs[slot + 1 :])
    return cg.Graph(inputs, outputs)


@needs_cc
@pytest.mark.parametrize("level", ["-O3", *slow("-O0")])
def test_every_operation_is_that_of_evaluate_to_the_last_bit(level, tmp_path):
    graphs = {f"op_{op.name}": with_specials(op) for op in OPS.values()}
    agrees(tmp_path, graphs, {f"op_{op.name}": points_of(op, 50) for op in OPS.values()}, [level])


@needs_cc
@pytest.mark.parametrize("links", [3, 8, *slow(20)])
def test_equations_of_motion_agree_with_evaluate_to_the_last_bit(links, tmp_path):
    """Those of arms, and those with quaternions."""
    arm = dyn.forward_dynamics(dyn.planar_arm([1.0] * links, [0.7] * links, damping=0.1))
    source = np.random.default_rng(links)
    agrees(tmp_path, {"arm": arm}, {"arm": source.normal(size=(100, len(arm.inputs)))},
           ["-O2", "-march=native"] if links == 3 else ["-O2"])  # fmt: skip
    if links == 3:
        kinds = {"ball": "ball", "floating": "free", "turned": "free (body axes)"}
        shape = {"mass": 2.0, "center": [0.1, 0.0, 0.2], "inertia": np.eye(3)}
        tip = dyn.Body("arm", dyn.Joint("revolute"), "base", 0.5, [0.2, 0.0, 0.0], 0.1 * np.eye(3))
        rates = {
            name: dyn.state_equation(dyn.Mechanism([dyn.Body("base", dyn.Joint(kind), **shape), tip]))
            for name, kind in kinds.items()
        }
        agrees(tmp_path, rates, {name: source.normal(size=(50, len(graph.inputs))) for name, graph in rates.items()})


@needs_cc
@given(batch=st.lists(cases(max_operations=30), min_size=12, max_size=12), part=st.sampled_from([1, 3, 7, 2000]))
@settings(max_examples=3, phases=[Phase.generate])  # to shrink would compile for minutes
def test_random_graphs_agree_with_evaluate_to_the_last_bit(batch, part, tmp_path_factory):
    """Also when cut into parts of a few operations."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(body, "PART", part)
        sources = [cg.to_c(case.graph, f"graph{k}") for k, case in enumerate(batch)]
    library = build(tmp_path_factory.mktemp("random"), sources)
    for case, source in zip(batch, sources, strict=True):
        point = [case.values[name] for name in case.graph.input_names]
        assert same(called(library, source.name, case.graph, [point]), evaluated(case.graph, [point]))


@needs_cc
def test_what_compilers_know_of_functions_changes_no_bit(tmp_path):
    """One call for a sine and its cosine; x * x for pow(x, 2.0), 1 / x for pow(x, -1.0), exp2(x) for pow(2.0, x).

    Behind a comparison they know an argument; their own functions round correctly, the library's do not.
    """
    x, y = cg.variables("x y")
    drawn = np.random.default_rng(0)
    powers = [[x] for x in drawn.uniform(0.5, 4.0, 20_000).tolist() if x**2.0 != x * x or x**-1.0 != 1 / x]
    chosen = [1.0 + 0.05 * k + 0.1 * cg.less(x, y) for k in range(30)]
    told = {
        f"{f.__name__}{k}": f(each)
        for f in (cg.cbrt, cg.expm1, cg.erfc, cg.tan, cg.sinh, cg.exp2)
        for k, each in enumerate(chosen)
    }
    graphs = {
        "both": cg.Graph([x], {"sin": cg.sin(x), "cos": cg.cos(x)}),
        "powers": cg.Graph([x], {"square": x**2, "inverse": x**-1, "exponential": 2**x}),
        "told": cg.Graph([x, y], told),
    }
    points = {"both": drawn.uniform(-1e3, 1e3, (5000, 1)), "powers": powers, "told": [[0.0, 1.0], [1.0, 0.0]]}
    agrees(tmp_path, graphs, points, ["-O3"])


@needs_cc
def test_fused_multiply_add_only_when_asked(tmp_path):
    """Where the processor has it; GCC without -std=c99 would fuse by itself."""
    x, y, z = cg.variables("x y z")
    graph = cg.Graph([x, y, z], {"f": x * y + z})
    points = np.random.default_rng(0).normal(size=(300, 3))
    found = {}
    for fma in (False, True):
        (tmp_path / str(fma)).mkdir()
        flags = ["-std=gnu99", "-O2", "-march=native"]
        found[fma] = called(build(tmp_path / str(fma), [cg.to_c(graph, "f", fma=fma)], flags), "f", graph, points)
    assert same(found[False], evaluated(graph, points))
    macros = run([CC, "-march=native", "-dM", "-E", "-x", "c", "/dev/null"])
    if "__FP_FAST_FMA " in macros:
        assert not same(found[True], found[False])
    np.testing.assert_allclose(found[True], found[False], rtol=EQUATIONS)


@needs_cc
def test_inputs_unused_passed_on_and_shared_by_outputs(tmp_path):
    agrees(tmp_path, odd_graphs(), ODD_POINTS)


AWKWARD = r"a_b a/b a+b a_b_ double exp y0 θ theta Ω N_IN x */evil/* ??/ λ₁ \ ".split()


@needs_cc
def test_names_that_collide_have_places_of_their_own(tmp_path):
    names = list(dict.fromkeys([*AWKWARD, *ALIKE, *WORDS]))
    inputs = cg.variables(names)
    outputs = {name: (k + 1.0) * node for k, (name, node) in enumerate(zip(names, inputs, strict=True))}
    outputs |= {"two words \\": cg.with_name(2 * inputs[0], "*/ named /*"), "\U0001d49c": inputs[1] * 3}
    graph = cg.Graph(inputs, outputs)
    source = cg.to_c(graph, "odd")
    places = re.findall(r"^    (ODD_(?:IN|OUT)_\w+) = (\d+),", source.header, re.MULTILINE)
    assert [int(row) for _, row in places] == [*range(len(inputs)), *range(len(outputs))]
    assert len({name for name, _ in places}) == len(places)
    assert [name for name, _ in places][: len(AWKWARD)] == [
        f"ODD_IN_{word}"
        for word in "a_b a_b_1 a_b_2 a_b_ double exp y0 theta_7 theta Omega N_IN x __evil__ ___ lambda1 _".split()
    ]
    agrees(tmp_path, {"odd": graph}, {"odd": [range(1, len(inputs) + 1)]})


def test_a_name_of_one_s_own_stands_beside_the_value():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": cg.exp(cg.with_name(x * y, "radius"))})
    assert "const double v1 = x[F_IN_x] * x[F_IN_y]; /* radius */" in cg.to_c(graph, "f").source


@cache
def pendulum():
    return dyn.forward_dynamics(dyn.planar_arm([2.0], [0.5], damping=0.1))


USE = """
#include "pendulum.h"
#include "pendulum.h"
#include <stdio.h>

int main(void)
{
    double x[PENDULUM_N_IN] = {0}, qdd[PENDULUM_N_OUT];

    x[PENDULUM_IN_q0] = 1.0;
    x[PENDULUM_IN_qd0] = -0.3;
    x[PENDULUM_IN_tau0] = 0.7;
    pendulum(x, qdd);
    printf("%.17g\\n", qdd[PENDULUM_OUT_qdd0]);
    return 0;
}
"""


@needs_cc
@pytest.mark.skipif(CXX is None, reason="no C++ compiler")
@pytest.mark.parametrize("standard", ["c++98", "c++20"])
def test_the_header_is_one_of_cpp_too(standard, tmp_path):
    source, _ = cg.to_c(pendulum(), "pendulum").write(tmp_path)
    atomic_write(tmp_path / "main.cpp", USE)
    run([CC, *STRICT, "-O2", "-c", str(source), "-o", str(tmp_path / "pendulum.o")])
    files = [str(tmp_path / name) for name in ("main.cpp", "pendulum.o")]
    run([CXX, f"-std={standard}", *WARNINGS, "-ffp-contract=off", *files, "-o", str(tmp_path / "main")])
    assert float(run([str(tmp_path / "main")])) == pendulum().evaluate({"q0": 1.0, "qd0": -0.3, "tau0": 0.7})["qdd0"]


TAKEN = """double main sin sinf erfc isnan islessgreater y0 math restrict printf NULL size_t read getc_unlocked stdin
    EOF class atomic_load va_arg PRIu64""".split()


def test_a_name_that_is_no_identifier_or_taken_is_an_error():
    for name in ("", "2x", "a b", "a-b", "f\n", "_f", "θ", "x.y"):
        with pytest.raises(ValueError, match="must be a letter, then letters, digits and _, got"):
            cg.to_c(pendulum(), name)
    for name in TAKEN:
        with pytest.raises(ValueError, match=f"must not be a word of C, C\\+\\+ or their library, got '{name}'"):
            cg.to_c(pendulum(), name)
