"""The functions of the operation table: signatures with names, help whose examples run, and rows that are refused."""

import doctest
import inspect
import math
import pickle
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

import cgraph as cg
from cgraph.core.row import ROWS
from cgraph.extend import OPS, Op, register


def test_every_operation_takes_its_arguments_by_name_and_shows_an_example_that_runs() -> None:
    for op in OPS.values():
        function, inputs = getattr(cg, op.name), cg.variables(op.parameters)
        assert list(inspect.signature(function).parameters) == op.parameters
        assert len(op.parameters) == op.arity
        (example,) = doctest.DocTestFinder().find(function, op.name, globs={})
        assert len(example.examples) == 4
        assert doctest.DocTestRunner().run(example).failed == 0
        parts = ("Parameters\n", "Returns\n", "Raises\n", "Examples\n")
        assert [function.__doc__.count(part) for part in parts] == [1] * 4
        node = function(**dict(zip(reversed(op.parameters), reversed(inputs), strict=True)))
        assert (node.op, node.args) == (op, tuple(inputs))


def test_a_wrong_number_of_arguments_is_told() -> None:
    x = cg.variable("x")
    with pytest.raises(TypeError, match="sin takes 1 argument"):
        cg.sin(x, x)
    with pytest.raises(TypeError, match=r"atan2\(y, x\): missing a required argument: 'x'"):
        cg.atan2(y=x, z=x)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"name": "sin"}, "'sin' is in the table already, as one of the library's"),
        ({"name": "my sine"}, "must be an identifier of Python, got 'my sine'"),
        ({"name": "lambda"}, "must be an identifier of Python, got 'lambda'"),
        ({"partials": None}, "operation 'sine': partials must be a function, got None"),
        ({"name": "compile"}, "cannot be called 'compile', which means something else in cgraph"),
        ({"partials": lambda y, x: ()}, "'sine' takes 1 argument.s., its partials are 0"),
        ({"partials": lambda y, x: (x, x)}, "'sine' takes 1 argument.s., its partials are 2"),
        ({"partials": lambda y, x: x}, "'sine': partials must give a tuple, got <node variable"),
        ({"partials": lambda y, x: (cg.sine(y), 1.0)}, "'sine' takes 1 argument.s., its partials are 2"),
        ({"partials": lambda y, x: (cg.sin(x),)}, "at x=0.3 its partial by x is 0.29552, where.*give 0.955336"),
        ({"array": lambda x: 1.0 + np.sin(x)}, "at x=0.3 scalar is 0.29552 and array 1.29552"),
        ({"array": math.sin}, "'sine': array must take and give arrays"),
        ({"python": "({0}*{0})"}, "at x=0.3 scalar is 0.29552 and python 0.09"),
        ({"numpy": "np.cos({0})"}, "at x=0.3 scalar is 0.29552 and numpy 0.955336"),
        ({"python": "sinus({0})"}, "python must be an expression of Python: 'sinus.x0.' raises NameError"),
        ({"numpy": "np.sin({0}"}, "numpy must be an expression of Python: .* raises SyntaxError"),
        ({"python": "sin({1})"}, "'sine': python has the places .0., got 'sin.*1"),
        ({"llvm": ("{y} = fneg {t} {0}",)}, "'sine': llvm has the places .0., .r., .t..*, got '.y. = "),
        ({"interval": lambda x: (0.0, 0.1)}, "x=0.3 scalar is 0.29552, and for x in .0.3, 0.3. the interval"),
        ({"interval": lambda x: (1.0, -1.0)}, "interval must give low <= high, got .1, -1. for x in .0.3, 0"),
        ({"interval": lambda x: 1.0}, "interval must give two numbers for x in .0.3, 0.3."),
        # Right at every point, and not between two:
        (
            {"interval": lambda x: (math.sin(x[0]), math.sin(x[0]))},
            "x=0.3 scalar is 0.29552, and for x in .-2, 0.3. the interval",
        ),
        ({"arguments": "x y"}, "takes 1 argument.s., got the names 'x y'"),
        ({"samples": ()}, "needs samples of 1 number.s. each"),
        ({"samples": ((1.0, 2.0),)}, "needs samples of 1 number.s. each, got .*2.0"),
    ],
)
def test_a_row_that_does_not_fit_is_refused(change: dict[str, object], said: str) -> None:
    before = dict(OPS)
    with pytest.raises((TypeError, ValueError), match=said):
        register(replace(OPS["sin"], **{"name": "sine", "domain": ((0.0, 1.0),), **change}))
    assert before == OPS
    assert not hasattr(cg, "sine")


def versin(factor: float) -> Op:
    values = lambda x: factor * (1.0 - math.cos(x)), lambda x: factor * (1.0 - np.cos(x))
    return Op("versin", 1, *values, lambda y, x: (factor * cg.sin(x),), samples=((0.6,), (-2.0,)))


def test_a_row_of_ones_own_can_be_replaced_and_earlier_graphs_keep_theirs() -> None:
    with patch.dict(OPS), patch.dict(ROWS):
        register(versin(1.0))
        x = cg.variable("x")
        graph, was = cg.Graph([x], {"y": cg.versin(x)}), 1.0 - math.cos(0.3)
        with pytest.raises(ValueError, match="replace=True puts this row in its place"):
            register(versin(2.0))
        with pytest.raises(ValueError, match="one of the library's"):
            register(OPS["sin"], replace=True)
        with pytest.raises(ValueError, match="its partial by x"):
            register(replace(versin(2.0), partials=lambda y, x: (cg.sin(x),)), replace=True)
        register(versin(2.0), replace=True)
        again = cg.Graph([x], {"y": cg.versin(x)})
        for made, factor in ((graph, 1.0), (again, 2.0)):
            assert made.evaluate({"x": 0.3})["y"] == factor * was
            assert cg.compile(made, "python")([0.3])[0] == factor * was
            assert cg.gradient(made).evaluate({"x": 0.3})["dy/dx"] == pytest.approx(factor * math.sin(0.3))
        both = cg.Graph([x], {"y": graph.outputs["y"] + again.outputs["y"]})
        with pytest.raises(cg.GraphError, match="two operations called 'versin'"):
            cg.compile(both, "python")


def test_instructions_that_llvm_does_not_know_are_told() -> None:
    pytest.importorskip("llvmlite")
    with patch.dict(OPS), patch.dict(ROWS):
        register(replace(versin(1.0), llvm=("{r} = sinus {t} {0}",)))
        x = cg.variable("x")
        with pytest.raises(ValueError, match=r"LLVM refuses instructions, .* error: .* = sinus double"):
            cg.compile(cg.Graph([x], {"y": cg.versin(x)}))([0.3])


def test_a_graph_is_not_read_without_the_row_of_its_operation(monkeypatch: pytest.MonkeyPatch) -> None:
    x = cg.variable("x")
    text = pickle.dumps(cg.Graph([x], {"y": cg.tan(x)}))
    monkeypatch.delitem(OPS, "tan")
    with pytest.raises(cg.GraphError, match="operation 'tan' is not in the table: register its row"):
        pickle.loads(text)


def test_a_row_fills_its_texts_from_its_name() -> None:
    row = Op("gauss", 2, lambda a, b: a, lambda a, b: a, lambda y, a, b: (1.0, 0.0), samples=((1.0, -2.0), (3.0, 0.0)))
    assert (row.python, row.numpy, row.c) == ("gauss({0}, {1})",) * 3
    assert (row.library, row.symbol, row.parameters, row.rounding) == ("gauss", "gauss", ["a", "b"], 2.0)
    assert row.domain == ((0.5, 4.5), (-3.0, 0.0))
    assert row.ufunc is None
    assert replace(row, name="cube", array=np.cbrt, numpy="", ufunc=None).numpy == "np.cbrt({0}, {1})"
