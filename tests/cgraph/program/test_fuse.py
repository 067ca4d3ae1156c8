"""Short statements as one call: the same bits, and what is long or would be rounded otherwise stays as it is."""

import numpy as np
import pytest

import cgraph as cg
from cgraph.extend import Call, If, Map, Program, Sum, While, runner
from cgraph.program import fuse
from tests.ulps import same

pytest.importorskip("llvmlite")


def oscillators(weights=(0.5, 0.5, 1.0)):
    """Steps of RK4 of three coupled pendulums with friction, some of them taken twice, and their energy."""
    q, u = cg.variables(["q0", "q1", "q2"]), cg.variables(["u0", "u1", "u2"])
    pull = [-cg.sin(a) * cg.cos(a) - 0.1 * b * b for a, b in zip(q, u, strict=True)]
    slopes = [*u, pull[0] + q[1] - q[0], pull[1] + q[2] - 2.0 * q[1], pull[2] * pull[0]]
    rate = cg.Graph([*q, *u], {f"{k}": slope for k, slope in enumerate(slopes)})
    x, h, *k = cg.variables("x h k0 k1 k2 k3")
    body = [Call(rate, ("x",), ("k0",))]
    for stage, weight in enumerate(weights):
        move = cg.Graph([h, x, k[stage]], {"at": x + weight * h * k[stage]})
        body += [Map(move, ("x", f"k{stage}"), ("at",), shared=("h",)), Call(rate, ("at",), (f"k{stage + 1}",))]
    total = x + h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])
    body += [Map(cg.Graph([x, h, *k], {"x": total}), ("x", "h", "k0", "k1", "k2", "k3"), ("x",))]
    body += [Sum(cg.Graph([x], {"square": x * x}), ("x",), "energy")]
    again = Call(cg.Graph([x], {"again": 1.5 - x}), ("again",), ("again",))
    choice = If("energy", (Map(cg.Graph([x], {"x": x + 0.0}), ("x",), ("x",)),), (again,))
    return [
        While("again", (*body, again, Call(cg.Graph([x], {"less": x - 1.0}), ("again",), ("again",)))),
        choice,
        *body,
    ]


LENGTHS = {"x": 6, "at": 6, "k0": 6, "k1": 6, "k2": 6, "k3": 6, "h": 1, "energy": 1, "again": 1}
START = {"x": [0.3, -1.2, 2.0, 0.1, 0.2, -0.4], "h": 0.01, "again": 1.0}


def called(program):
    return sum(isinstance(each, Call | Map) for each in fuse.fused(program).statements())


@pytest.mark.parametrize("fma", [False, True])
def test_a_fused_program_has_the_bits_of_its_statements(monkeypatch, fma):
    program = Program(LENGTHS, oscillators(), record=["x", "at", "energy", "again"])
    flat = Program(LENGTHS, [*oscillators()[0].body[:-2]], record=["x", "at", "energy"])
    assert called(program) == 5 < sum(isinstance(each, Call | Map) for each in program.statements())

    def results():
        run, many = (runner(each, "llvm", fma=fma) for each in (program, flat))
        starts = np.stack([many.memory(START) * scale for scale in np.linspace(0.5, 1.0, 11)], axis=1)
        return [run.run(run.memory(START), 20).rows, many.run_many(starts, 20).rows]

    fused = results()
    monkeypatch.setattr(fuse, "MOST", 0)
    assert called(program) == sum(isinstance(each, Call | Map) for each in program.statements())
    assert all(map(same, fused, results()))
    if not fma:
        slow = runner(program, "python", fma=False)
        assert same(slow.run(slow.memory(START), 20).rows, fused[0])


def test_what_is_long_is_called(monkeypatch):
    body = oscillators()[0].body
    program = Program(LENGTHS, body, record=["x"])
    monkeypatch.setattr(fuse, "MOST", 50)
    assert fuse.fused(program).body[:8] == body[:8]


def test_an_overwritten_product_keeps_its_rounding():
    """Fused, it would go into the sum that follows and be rounded with it."""
    a, b = cg.variables("a b")
    product = Call(cg.Graph([a], {"p": a * a}), ("x",), ("p",))
    rest = Call(cg.Graph([a, b], {"r": a - b}), ("p", "y"), ("p",))
    program = Program({"x": 1, "y": 1, "p": 1}, [product, rest], record=["p"])
    assert fuse.fused(program).body == (product, rest)
    run = runner(program, "llvm")
    x = 1.0 + 2.0**-30
    assert run.run(run.memory({"x": x, "y": x * x}), 1).rows.tolist() == [[0.0]]


def test_an_overwritten_product_that_no_sum_takes_is_fused():
    """As where memories side by side choose between what was and what is."""
    a, b, c = cg.variables("a b c")
    product = Call(cg.Graph([a], {"p": a * a}), ("x",), ("p",))
    choice = Call(cg.Graph([a, b, c], {"p": cg.where(a, b, c)}), ("y", "p", "x"), ("p",))
    assert len(fuse.fused(Program({"x": 1, "y": 1, "p": 1}, [product, choice], record=["p"])).body) == 1
