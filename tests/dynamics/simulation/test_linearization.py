"""Reverse and forward mode over statements of every kind: products with the Jacobian of what they compute."""

from __future__ import annotations

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
from cgraph.extend import Array, Call, Factor, If, Map, Solve, Statement, Sum, While, runner
from dynamics.simulation.gradients.linearization import Linearization, Linearized
from dynamics.simulation.gradients.products import Products
from tests.tolerances import CONDITIONED, LONG_SUM

N = 3


def statements() -> list[Statement]:
    """x <- v with v = sin(0.3 v) + y, y = A(x, p)^-1 (h x) + h s, s = sum of (A^-1 h x)_i x_i."""
    x = cg.variables("x0 x1 x2")
    p, a, b, h, s, v, y, left, turns = cg.variables("p a b h s v y left turns")
    rows = [3.0 * (i == j) + 0.2 * cg.sin(x[i] * p + 0.5 * j) for i in range(N) for j in range(N)]
    more = cg.Graph([turns], {"turns": turns + 1.0, "left": 60.0 - turns})
    return [
        Call(cg.Graph([*x, p], {f"{k}": node for k, node in enumerate(rows)}), ("x", "p"), ("A",)),
        Factor("A", "pivots"),
        Map(cg.Graph([a, h], {"b": a * h}), ("x", "h"), ("b",)),
        Solve("A", "pivots", "b"),
        Sum(cg.Graph([a, b], {"s": a * b}), ("b", "x"), "s"),
        Map(cg.Graph([b, s, h], {"y": b + s * h}), ("b", "s", "h"), ("y",)),
        Call(cg.Graph([], {"turns": 0.0, "left": 1.0}), (), ("turns", "left")),
        While(
            "left",
            (
                Map(cg.Graph([v, y], {"v": cg.sin(0.3 * v) + y}), ("v", "y"), ("v",)),
                Call(more, ("turns",), ("turns", "left")),
            ),
        ),
        Map(cg.Graph([v, left], {"v": v + 0.0 * left}), ("v", "left"), ("x",)),
    ]


LENGTHS = {"x": N, "p": 1, "A": N * N, "pivots": N, "b": N, "h": 1, "s": 1, "v": N, "y": N, "turns": 1, "left": 1}
START, STEPS = {"x": np.array([0.3, -0.5, 0.8]), "p": np.array([0.7])}, np.array([[0.9], [1.3], [0.6]])


def linearization() -> Linearization:
    return Linearization(
        statements(),
        LENGTHS,
        fed=["h"],
        inputs=["p"],
        varied=["h"],
        fixed=["turns", "left"],
        carried=["x"],
        renamed={},
        products=Products({}),
    )


def run(passes: Linearization, linear: Linearized, start: dict[str, Array], h: Array) -> tuple[Array, Array]:
    """The end, and what was recorded."""
    forward = runner(passes.forward(linear.program.feed), "python")
    memory = forward.memory({passes.handed["x"]: start["x"], "p": start["p"]})
    rows = forward.run(memory, len(h), 1, h).rows
    return forward.read(memory, passes.handed["x"]), rows


def test_a_cotangent_times_a_tangent_is_the_same_before_and_after() -> None:
    passes, rng = linearization(), np.random.default_rng(0)
    reverse, forward = passes.adjoint(["x"]), passes.tangent(["p"])
    w, dx, dp = rng.normal(size=N), rng.normal(size=N), rng.normal(size=1)
    back = runner(reverse.program, "python")
    memory = back.memory({reverse.vectors["x"]: w, "p": START["p"]})
    slopes = back.run(memory, 3, 1, run(passes, reverse, START, STEPS)[1][::-1]).rows[::-1]
    bars = {name: back.read(memory, register) for name, register in reverse.vectors.items()}
    on = runner(forward.program, "python")
    memory = on.memory({forward.vectors["x"]: dx, forward.vectors["p"]: dp, "p": START["p"]})
    ends = on.run(memory, 3, 1, run(passes, forward, START, STEPS)[1]).rows[-1]
    assert w @ ends == approx(bars["x"] @ dx + bars["p"] @ dp, rel=LONG_SUM)

    def end(**shift: Array) -> float:
        start = {name: value + 1e-6 * shift.get(name, 0.0) for name, value in START.items()}
        return float(w @ run(passes, reverse, start, STEPS + 1e-6 * shift.get("h", 0.0))[0])

    dh = rng.normal(size=(3, 1))
    for name, change, slope in (("x", dx, bars["x"]), ("p", dp, bars["p"]), ("h", dh, slopes)):
        difference = (end(**{name: change}) - end(**{name: -change})) / 2e-6
        assert float(np.sum(slope * change)) == approx(difference, rel=CONDITIONED, abs=CONDITIONED)


def test_numbers_that_a_map_shares_have_no_derivatives() -> None:
    x, a = cg.variables("x a")
    step = [Map(cg.Graph([a, x], {"y": a * x}), ("x",), ("x",), shared=("a",))]
    passes = Linearization(
        step,
        {"x": 2, "a": 1},
        fed=(),
        inputs=("a",),
        varied=(),
        fixed=(),
        carried=("x",),
        renamed={},
        products=Products({}),
    )
    for derived in (lambda: passes.adjoint(["x"]), lambda: passes.tangent(["a"])):
        with pytest.raises(TypeError, match="a Map with shared registers, a, has no derivatives here"):
            derived()


def test_a_statement_that_a_step_cannot_have_is_refused() -> None:
    x = cg.variable("x")
    step = [If("x", (Map(cg.Graph([x], {"x": 2.0 * x}), ("x",), ("x",)),))]
    with pytest.raises(TypeError, match="a step cannot have a statement of the type If"):
        Linearization(
            step, {"x": 1}, fed=(), inputs=(), varied=(), fixed=(), carried=("x",), renamed={}, products=Products({})
        )
