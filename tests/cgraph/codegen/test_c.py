"""Generated C: compiled by a C compiler, every operation and many graphs to the last bit of evaluation."""

import ctypes
import itertools
import math
import random
import re
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest
from hypothesis import Phase, given, settings, strategies as st

import cgraph as cg
import dynamics as dyn
from cgraph.codegen.c import c_statements as body
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from cgraph.util.atomic_write import atomic_write
from tests.slow import slow
from tests.strategies import cases
from tests.tolerances import EQUATIONS

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
CXX = shutil.which("c++") or shutil.which("g++") or shutil.which("clang++")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler")
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
STRICT = ["-std=c99", *WARNINGS]
SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -3.0, 5e-324, -2.5e-310, 1e300, -1e300, 800.0, math.inf, -math.inf, math.nan)


def build(folder, sources, flags=("-O2",)):
    """One shared library of several sources, loaded."""
    files = [str(source.write(folder)[0]) for source in sources]
    library = folder / f"{sources[0].name}.so"
    run([CC, *STRICT, *flags, "-shared", "-fPIC", *files, "-o", str(library), "-lm"])
    return ctypes.CDLL(str(library))


def run(command):
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def called(library, name, graph, points):
    """Rows of outputs at rows of inputs."""
    function = library[name]
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], None
    found = np.full((len(points), len(graph.outputs)), 123.0)
    for point, row in zip(np.array(points, dtype=float).reshape(len(points), -1), found, strict=True):
        function(point.ctypes.data, row.ctypes.data)
    return found


def evaluated(graph, points):
    values = [graph.evaluate(dict(zip(graph.input_names, map(float, point), strict=True))) for point in points]
    return np.array([[float(value) for value in row.values()] for row in values])


def same(found, expected):
    """Equal to the last bit and in the sign of a zero; any NaN equals another."""
    bits = np.ascontiguousarray(found).view(np.int64) == np.ascontiguousarray(expected).view(np.int64)
    return bool(np.all(bits | (np.isnan(found) & np.isnan(expected))))


def graph_of(op):
    """The operation on variables, and on every special number in the place of each."""
    inputs = cg.variables(["a", "b", "c"][: op.arity])
    outputs = {"y": apply(op, *inputs)}
    for slot, number in itertools.product(range(op.arity), SPECIAL):
        if not math.isnan(number):
            outputs[f"{number!r} at {slot}"] = apply(op, *inputs[:slot], number, *inputs[slot + 1 :])
    return cg.Graph(inputs, outputs)


def points_of(op):
    """Samples, points of the domain, and every combination of IEEE specials."""
    source = random.Random(op.name)
    drawn = [tuple(source.uniform(*interval) for interval in op.domain) for _ in range(50)]
    return [*op.samples, *drawn, *itertools.product(SPECIAL, repeat=op.arity)]


ROWS = [pytest.param(op, id=op.name) for op in OPS.values()]


@pytest.fixture(scope="module")
def operations(tmp_path_factory):
    """Every operation of the table, by optimisation level."""
    folder = tmp_path_factory.mktemp("operations")

    @cache
    def at(level):
        (folder / level).mkdir()
        return build(folder / level, [cg.to_c(graph_of(op), f"op_{op.name}") for op in OPS.values()], [f"-{level}"])

    return at


@needs_cc
@pytest.mark.parametrize("level", ["O3", *slow("O0")])
@pytest.mark.parametrize("op", ROWS)
def test_an_operation_is_that_of_evaluate_to_the_last_bit(op, level, operations):
    graph, points = graph_of(op), points_of(op)
    found = called(operations(level), f"op_{op.name}", graph, points)
    assert same(found, evaluated(graph, points))


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
@pytest.mark.parametrize("links", [3, 8, *slow(20)])
def test_forward_dynamics_agree_with_evaluate_to_the_last_bit(links, tmp_path):
    graph = dyn.forward_dynamics(dyn.planar_arm([1.0] * links, [0.7] * links, damping=0.1))
    points = np.random.default_rng(links).normal(size=(100, len(graph.inputs)))
    library = build(tmp_path, [cg.to_c(graph, "arm")], ["-O2", "-march=native"] if links == 3 else ["-O2"])
    assert same(called(library, "arm", graph, points), evaluated(graph, points))


@needs_cc
def test_state_equations_with_quaternions_agree_with_evaluate_to_the_last_bit(tmp_path):
    kinds = ["ball", "free", "free (body axes)"]
    bodies = [dyn.Body("base", dyn.Joint(kind), mass=2.0, center=[0.1, 0.0, 0.2], inertia=np.eye(3)) for kind in kinds]
    arm = dyn.Body("arm", dyn.Joint("revolute"), "base", mass=0.5, center=[0.2, 0.0, 0.0], inertia=0.1 * np.eye(3))
    graphs = [dyn.state_equation(dyn.Mechanism([base, arm])) for base in bodies]
    library = build(tmp_path, [cg.to_c(graph, f"rate{k}") for k, graph in enumerate(graphs)])
    for k, graph in enumerate(graphs):
        points = np.random.default_rng(k).normal(size=(50, len(graph.inputs)))
        assert same(called(library, f"rate{k}", graph, points), evaluated(graph, points))


@needs_cc
def test_a_long_graph_is_cut_into_parts(tmp_path, monkeypatch):
    graph = dyn.forward_dynamics(dyn.planar_arm([1.0] * 10, [0.7] * 10))
    monkeypatch.setattr(body, "PART", 100)
    source = cg.to_c(graph, "arm")
    statements = [len(part.splitlines()) for part in source.source.split("static void")[1:]]
    assert len(statements) == math.ceil(sum(1 for node in graph.nodes if node.args) / 100)
    (size,) = map(int, re.findall(r"double w\[(\d+)\];", source.source))
    assert size < 200  # far fewer than the values that cross from part to part: places are used again
    points = np.random.default_rng(0).normal(size=(20, len(graph.inputs)))
    assert same(called(build(tmp_path, [source]), "arm", graph, points), evaluated(graph, points))


def test_a_deep_graph_needs_no_recursion():
    x = node = cg.variable("x")
    for _ in range(20_000):
        node = cg.sin(node)
    source = cg.to_c(cg.Graph([x], {"y": node}), "deep").source
    assert source.count("static void deep_part_") == 10
    assert "double w[1];" in source


@needs_cc
def test_the_sine_and_the_cosine_of_one_angle_are_those_of_evaluate(tmp_path):
    """Compilers call one function for both."""
    x = cg.variable("x")
    graph = cg.Graph([x], {"sin": cg.sin(x), "cos": cg.cos(x)})
    points = np.random.default_rng(0).uniform(-1e3, 1e3, (5000, 1))
    assert same(called(build(tmp_path, [cg.to_c(graph, "both")]), "both", graph, points), evaluated(graph, points))


@needs_cc
def test_powers_by_a_constant_are_those_of_evaluate(tmp_path):
    """Compilers know pow(x, 2.0) as x * x, pow(x, -1.0) as 1.0 / x and pow(2.0, x) as exp2(x): mostly the same."""
    x = cg.variable("x")
    graph = cg.Graph([x], {"square": x**2, "inverse": x**-1, "exponential": 2**x})
    drawn = np.random.default_rng(0).uniform(0.5, 4.0, 20_000).tolist()
    points = [[x] for x in drawn if math.pow(x, 2.0) != x * x or math.pow(x, -1.0) != 1 / x]
    library = build(tmp_path, [cg.to_c(graph, "power")])
    assert same(called(library, "power", graph, points), evaluated(graph, points))


@needs_cc
def test_an_argument_that_the_compiler_can_tell_goes_to_the_library_as_any_other(tmp_path):
    """Behind a comparison it knows the argument; its own functions round correctly, the library's do not."""
    x, y = cg.variables("x y")
    functions = (cg.cbrt, cg.expm1, cg.erfc, cg.tan, cg.sinh, cg.exp2)
    chosen = [1.0 + 0.05 * k + 0.1 * cg.less(x, y) for k in range(30)]
    outputs = {f"{f.__name__}{k}": f(each) for f in functions for k, each in enumerate(chosen)}
    graph, points = cg.Graph([x, y], outputs), [[0.0, 1.0], [1.0, 0.0]]
    library = build(tmp_path, [cg.to_c(graph, "told")], ["-O3"])
    assert same(called(library, "told", graph, points), evaluated(graph, points))


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
    x, y, z = cg.variables("x y z")
    u = x * y
    several = cg.Graph([z, y, x], {"a": u, "b": u, "x": x, "x again": x, "c": -math.inf, "d": -0.0, "nan": x / x})
    fixed = cg.Graph([], {"c": cg.sin(cg.constant(0.3)), "nan": cg.log(cg.constant(-1.0))})
    library = build(tmp_path, [cg.to_c(several, "several"), cg.to_c(fixed, "fixed")])
    assert same(called(library, "several", several, [[3, 0, 0]]), evaluated(several, [[3, 0, 0]]))
    assert same(called(library, "fixed", fixed, [[]]), evaluated(fixed, [[]]))


AWKWARD = [
    "a_b",
    "a/b",
    "a+b",
    "a_b_",
    "double",
    "exp",
    "y0",
    "θ",
    "theta",
    "Ω",
    "N_IN",
    "x",
    "*/evil/*",
    "??/",
    "λ₁",
    "\\",
]


@needs_cc
def test_names_that_collide_have_places_of_their_own(tmp_path):
    inputs = cg.variables(AWKWARD)
    outputs = dict(zip(AWKWARD, inputs, strict=True)) | {
        "two words \\": cg.with_name(2 * inputs[0], "*/ named /*"),
        "\U0001d49c": inputs[1] * 3,
    }
    graph = cg.Graph(inputs, outputs)
    source = cg.to_c(graph, "odd")
    places = re.findall(r"^    (ODD_(?:IN|OUT)_\w+) = (\d+),", source.header, re.MULTILINE)
    assert [int(row) for _, row in places] == [*range(len(inputs)), *range(len(outputs))]
    assert len({name for name, _ in places}) == len(places)
    assert [name for name, _ in places][: len(inputs)] == [
        f"ODD_IN_{word}"
        for word in "a_b a_b_1 a_b_2 a_b_ double exp y0 theta_7 theta Omega N_IN x __evil__ ___ lambda1 _".split()
    ]
    point = [list(map(float, range(1, len(inputs) + 1)))]
    assert same(called(build(tmp_path, [source]), "odd", graph, point), evaluated(graph, point))


def test_a_name_of_one_s_own_stands_beside_the_value():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": cg.exp(cg.with_name(x * y, "radius"))})
    assert "const double v1 = x[F_IN_x] * x[F_IN_y]; /* radius */" in cg.to_c(graph, "f").source
    assert "%1 = mul x y  (radius)" in graph.listing()


def pendulum():
    return dyn.forward_dynamics(dyn.planar_arm([2.0], [0.5], damping=0.1))


USE = """
#include "pendulum.h"
#include <stdio.h>

int main(void)
{
    double x[PENDULUM_N_IN] = {0}, qdd[PENDULUM_N_OUT];
    const double dt = 1e-3;
    int step;

    x[PENDULUM_IN_q0] = 1.0;
    for (step = 0; step < 5000; step++) {
        x[PENDULUM_IN_tau0] = -0.5 * x[PENDULUM_IN_qd0];
        pendulum(x, qdd);
        x[PENDULUM_IN_qd0] += dt * qdd[PENDULUM_OUT_qdd0];
        x[PENDULUM_IN_q0] += dt * x[PENDULUM_IN_qd0];
    }
    printf("%.17g %.17g\\n", x[PENDULUM_IN_q0], x[PENDULUM_IN_qd0]);
    return 0;
}
"""


def stepped():
    q, qd, dt, graph = 1.0, 0.0, 1e-3, pendulum()
    for _ in range(5000):
        qd += dt * graph.evaluate({"q0": q, "qd0": qd, "tau0": -0.5 * qd})["qdd0"]
        q += dt * qd
    return q, qd


@needs_cc
def test_a_program_simulates_with_the_header_alone(tmp_path):
    source, _ = cg.to_c(pendulum(), "pendulum").write(tmp_path)
    atomic_write(tmp_path / "main.c", USE)
    run(
        [
            CC,
            *STRICT,
            "-O2",
            "-ffp-contract=off",
            str(tmp_path / "main.c"),
            str(source),
            "-o",
            str(tmp_path / "main"),
            "-lm",
        ]
    )
    assert tuple(map(float, run([str(tmp_path / "main")]).split())) == stepped()


@needs_cc
@pytest.mark.skipif(CXX is None, reason="no C++ compiler")
@pytest.mark.parametrize("standard", ["c++98", "c++20"])
def test_the_header_is_one_of_cpp_too(standard, tmp_path):
    source, _ = cg.to_c(pendulum(), "pendulum").write(tmp_path)
    atomic_write(tmp_path / "main.cpp", USE)
    (tmp_path / "twice.cpp").write_text('#include "pendulum.h"\n#include "pendulum.h"\n', encoding="utf-8")
    run([CC, *STRICT, "-O2", "-c", str(source), "-o", str(tmp_path / "pendulum.o")])
    files = [str(tmp_path / name) for name in ("main.cpp", "twice.cpp", "pendulum.o")]
    run([CXX, f"-std={standard}", *WARNINGS, "-ffp-contract=off", *files, "-o", str(tmp_path / "main")])
    assert tuple(map(float, run([str(tmp_path / "main")]).split())) == stepped()


@pytest.mark.parametrize("name", ["", "2x", "a b", "a-b", "f\n", "_f", "θ", "x.y"])
def test_a_name_that_is_no_identifier_is_an_error(name):
    with pytest.raises(ValueError, match="must be a letter, then letters, digits and _, got"):
        cg.to_c(pendulum(), name)


@pytest.mark.parametrize(
    "name",
    [
        "double",
        "class",
        "main",
        "sin",
        "sinf",
        "erfc",
        "isnan",
        "islessgreater",
        "y0",
        "math",
        "restrict",
        "printf",
        "NULL",
        "size_t",
        "read",
        "getc_unlocked",
        "stdin",
        "EOF",
        "atomic_load",
        "va_arg",
        "PRIu64",
    ],
)
def test_a_name_that_is_taken_is_an_error(name):
    with pytest.raises(ValueError, match=f"must not be a word of C, C\\+\\+ or their library, got '{name}'"):
        cg.to_c(pendulum(), name)


def test_a_name_that_is_no_string_is_an_error():
    with pytest.raises(TypeError, match="must be a string, got int: 3"):
        cg.to_c(pendulum(), 3)


def test_both_files_are_written(tmp_path):
    made = cg.to_c(pendulum(), "pendulum")
    source, header = made.write(str(tmp_path))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pendulum.c", "pendulum.h"]
    assert source.read_text(encoding="utf-8") == made.source
    assert header.read_text(encoding="utf-8") == made.header
    with pytest.raises(OSError, match=r"the folder .* does not exist"):
        made.write(tmp_path / "missing")
