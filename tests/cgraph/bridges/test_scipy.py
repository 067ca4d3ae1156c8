"""`fn.address` and `to_scipy`: machine code called by address, by ctypes and by SciPy's integrals."""

import ctypes
import gc
import math

import numpy as np
import pytest
from scipy.integrate import dblquad, nquad, quad

import cgraph as cg
from tests.cgraph.bridges.agreement import ARM, POINT

NUMBERS = ctypes.POINTER(ctypes.c_double)
x, y, a = cg.variables("x y a")


def test_by_its_address_a_function_has_the_bits_of_a_call():
    fn, result = cg.compile(ARM), np.zeros(7)
    point = POINT.copy()
    ctypes.CFUNCTYPE(None, NUMBERS, NUMBERS)(fn.address)(point.ctypes.data_as(NUMBERS), result.ctypes.data_as(NUMBERS))
    assert result.tolist() == fn(POINT).tolist()
    assert fn.address == fn.address != cg.compile(ARM).address


def test_an_integral_calls_it_with_variables_first_and_keeps_it_alive():
    power = cg.to_scipy(cg.compile(cg.Graph([x, a], {"f": x**a})))
    gc.collect()
    assert quad(power, 0.0, 2.0, args=(3.0,))[0] == pytest.approx(4.0, rel=1e-12)
    product = cg.to_scipy(cg.compile(cg.Graph([x, y], {"f": x * cg.exp(y)})))
    exact = 2.0 * (math.e - 1.0)
    assert nquad(product, [(0.0, 2.0), (0.0, 1.0)])[0] == pytest.approx(exact, rel=1e-12)
    assert dblquad(product, 0.0, 1.0, 0.0, 2.0)[0] == pytest.approx(exact, rel=1e-12)


def test_another_number_of_values_gives_nan():
    power = cg.to_scipy(cg.compile(cg.Graph([x, a], {"f": x**a})))
    assert [power.function(n, (ctypes.c_double * 3)(2.0, 3.0)) for n in (1, 2)] == pytest.approx(
        [math.nan, 8.0], nan_ok=True
    )
    with pytest.warns(UserWarning, match=r"roundoff|divergent|integral"):
        assert math.isnan(quad(power, 0.0, 1.0)[0])


def test_what_has_no_address_is_told():
    graph = cg.Graph([x], {"f": x, "g": -x})
    with pytest.raises(RuntimeError, match="needs machine code, and this is generated Python, backend 'python'"):
        _ = cg.compile(graph, "python").address
    with pytest.raises(cg.GraphError, match="to_scipy takes one output, got 2: f, g"):
        cg.to_scipy(cg.compile(graph))
    for needy in (cg.to_scipy, cg.as_jax, cg.to_torch):
        with pytest.raises(TypeError, match=r"needs a compiled graph, got Graph: .*; write cg.compile\(graph\)"):
            needy(graph)


def test_without_its_package_a_bridge_names_the_extra(monkeypatch: pytest.MonkeyPatch):
    fn = cg.compile(cg.Graph([x], {"f": x}))
    bridges = {
        "casadi": lambda: cg.to_casadi(fn.graph),
        "jax": lambda: (cg.to_jax(fn.graph), cg.as_jax(fn)),
        "torch": lambda: cg.to_torch(fn),
        "scipy": lambda: cg.to_scipy(fn),
    }
    for extra, make in bridges.items():
        monkeypatch.setitem(__import__("sys").modules, extra, None)
        with pytest.raises(ImportError, match=rf"needs \w+: .*\[{extra}\]"):
            make()
