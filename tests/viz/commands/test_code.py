"""`cgraph code`: files that compute the equations of a scene."""

import math
import shutil
import subprocess

import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from tests.each_row import each_row
from tests.javascript import evaluated_by_js
from tests.tolerances import SUMS
from viz import cli
from viz.commands.code import EQUATIONS, python_text

SCENE = dyn.scenes.load("triple_pendulum")


def point(graph):
    return [math.sin(1.0 + k) for k in range(len(graph.inputs))]


def function_of(text):
    """What a text defines, with nothing else known."""
    names: dict = {}
    exec(text, names)
    return names["function"]


@each_row("what", EQUATIONS)
def test_python_is_the_graph(what, capsys):
    """With what it calls above it: the text alone runs."""
    assert cli.main(["code", "triple_pendulum", "--python", "--what", what]) == 0
    function = function_of(capsys.readouterr().out)
    graph = getattr(dyn, what)(SCENE)
    expected = graph.evaluate(dict(zip(graph.input_names, point(graph), strict=True)))
    assert function(point(graph)) == tuple(expected.values())


def test_operations_that_python_lacks_are_taken_from_the_table():
    inputs = cg.variables("a b c")
    graph = cg.Graph(inputs, {name: apply(op, *inputs[: op.arity]) for name, op in OPS.items()})
    at = [0.3, 0.6, 0.2]
    assert function_of(python_text(graph))(at) == tuple(graph.evaluate(dict(zip("abc", at, strict=True))).values())


def test_javascript_has_steps_with_the_state_equation(tmp_path, capsys):
    out = tmp_path / "arm.mjs"
    line = ["code", "triple_pendulum", "--js", "--what", "state_equation"]
    assert cli.main([*line, "--out", str(out)]) == 0
    assert f"{out}: " in capsys.readouterr().out
    assert cli.main(line) == 0
    text, graph = out.read_text(encoding="utf-8"), dyn.state_equation(SCENE)
    assert capsys.readouterr().out == text
    assert evaluated_by_js(text, [point(graph)])[0] == pytest.approx(
        list(graph.evaluate(dict(zip(graph.input_names, point(graph), strict=True))).values()), rel=SUMS
    )
    assert all(f'"{method}"(x, h, n)' in text for method in ("euler", "rk4", "dopri5"))


def test_of_a_first_order_system_it_is_the_state_equation(tmp_path, capsys):
    (tmp_path / "decay.py").write_text('import dynamics as dyn\nsystem = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])\n')
    assert cli.main(["code", f"{tmp_path}/decay.py:system", "--python"]) == 0
    assert function_of(capsys.readouterr().out)([3.0]) == (-3.0,)


def test_c_is_one_text_or_two_files(tmp_path, capsys):
    assert cli.main(["code", "spring_mass", "--c"]) == 0
    text = capsys.readouterr().out
    assert "#include <math.h>" in text
    assert '#include "' not in text
    assert cli.main(["code", "spring_mass", "--c", "--out", str(tmp_path / "spring.c")]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"spring.c", "spring.h"}
    if compiler := shutil.which("cc"):
        (tmp_path / "alone.c").write_text(text, encoding="utf-8")
        for name in ("alone.c", "spring.c"):
            subprocess.run([compiler, "-c", "-Werror", name, "-o", "out.o"], cwd=tmp_path, check=True)
