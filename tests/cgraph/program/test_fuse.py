"""Short statements as one call: the same bits; what is long, or called again and again, stays as it is."""

import numpy as np
import pytest

import cgraph as cg
from cgraph.codegen.schedule import STEPS
from cgraph.extend import Call, If, Map, Program, Sum, While, runner
from cgraph.program import fuse
from tests.ulps import same

pytest.importorskip("llvmlite")
pytestmark = pytest.mark.optimized


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
    body += [Sum(cg.Graph([x], {"square": x * x}), ("x",), ("energy",))]
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
    return sum(isinstance(each, Call | Map | Sum) for each in program.statements())


@pytest.mark.parametrize("copies", [0, 1000])
@pytest.mark.parametrize("fma", [False, True])
def test_a_fused_program_has_the_bits_of_its_statements(monkeypatch, fma, copies):
    monkeypatch.setattr(fuse, "COPIES", copies)
    program = Program(LENGTHS, oscillators(), record=["x", "at", "energy", "again"])
    flat = Program(LENGTHS, [*oscillators()[0].body[:-2]], record=["x", "at", "energy"])
    assert called(fuse.fused(program)) == (20 if copies == 0 else 4) < called(program)

    def results():
        run, many = (runner(each, "llvm", fma=fma) for each in (program, flat))
        starts = np.stack([many.memory(START) * scale for scale in np.linspace(0.5, 1.0, 11)], axis=1)
        return [run.run(run.memory(START), 20).rows, many.run(starts, 20).rows]

    fused = results()
    monkeypatch.setattr(fuse, "MOST_OPERATIONS", 0)
    assert called(fuse.fused(program)) == called(program)
    assert all(map(same, fused, results()))
    if not fma:
        slow = runner(program, "python", fma=False)
        assert same(slow.run(slow.memory(START), 20).rows, fused[0])


def test_a_graph_that_is_called_again_and_again_is_there_once_and_what_is_long_stays(monkeypatch):
    body = oscillators()[0].body
    program = Program(LENGTHS, body, record=["x"])
    monkeypatch.setattr(fuse, "COPIES", 0)
    rates = [each for each in body if isinstance(each, Call) and each.graph is body[0].graph]
    assert len(rates) == 4
    assert [each for each in fuse.fused(program).body if each in rates] == rates
    monkeypatch.setattr(fuse, "STRAIGHT", 0)
    assert [each for each in fuse.fused(program).body if isinstance(each, Map | Sum)] == [
        each for each in body if isinstance(each, Map | Sum)
    ]


def test_an_overwritten_product_keeps_its_rounding():
    """Fused, it does not go into the sum that follows, where it would not be rounded."""
    a, b = cg.variables("a b")
    product = Call(cg.Graph([a], {"p": a * a}), ("x",), ("p",))
    rest = Call(cg.Graph([a, b], {"r": a - b}), ("p", "y"), ("p",))
    program = Program({"x": 1, "y": 1, "p": 1}, [product, rest], record=["p"])
    assert len(fuse.fused(program).body) == 1
    run = runner(program, "llvm")
    x = 1.0 + 2.0**-30
    assert run.run(run.memory({"x": x, "y": x * x}), 1).rows.tolist() == [[0.0]]
    whole = Program(program.registers, [Call(cg.Graph([a, b], {"r": a * a - b}), ("x", "y"), ("p",))], record=["p"])
    run = runner(whole, "llvm")
    assert run.run(run.memory({"x": x, "y": x * x}), 1).rows[0, 0] in (0.0, 2.0**-60)  # with fused products


def test_a_call_may_write_what_it_reads():
    """Each number is read before any is written, of registers that swap and of one that is read twice."""
    a, b, c = cg.variables("a b c")
    swap = Call(cg.Graph([a, b, c], {"first": b, "second": a + c}), ("x", "y", "x"), ("x", "y"))
    run = runner(Program({"x": 1, "y": 1}, [swap], record=["x", "y"]), "llvm")
    assert run.run(run.memory({"x": 3.0, "y": 5.0}), 2).rows.tolist() == [[5.0, 6.0], [6.0, 10.0]]
    for constants in (10, 3 * STEPS):  # stored in functions of their own, and what x becomes behind them
        zeros = {f"z{k}": cg.constant(0.0) for k in range(constants)}
        square = Call(cg.Graph([a, b], {"next": a * b, **zeros}), ("x", "y"), ("x", "zeros"))
        run = runner(Program({"x": 1, "y": 1, "zeros": constants}, [square], record=["x"]), "llvm")
        assert run.run(run.memory({"x": 3.0, "y": 5.0}), 2).rows.tolist() == [[15.0], [75.0]]


@pytest.mark.parametrize("count", [3, 8, 13, 40])
def test_a_map_behind_a_call_reads_what_it_wrote(count, monkeypatch):
    """Whose numbers were written one by one, and whose vectors may end behind the last."""
    monkeypatch.setattr(fuse, "STRAIGHT", 0)
    monkeypatch.setattr(fuse, "MOST_OPERATIONS", 0)
    x, y = cg.variables([f"x{k}" for k in range(count)]), cg.variables("a b")
    turned = Call(cg.Graph(x, {f"{k}": 2.0 * node for k, node in enumerate(reversed(x))}), ("x",), ("y",))
    program = Program(
        {"x": count, "y": count, "z": count, "sum": 2},
        [
            turned,
            Map(cg.Graph(y, {"z": y[0] + y[1]}), ("x", "y"), ("z",)),
            Sum(cg.Graph(y, {"p": y[0] * y[1], "q": y[1]}), ("x", "z"), ("sum",)),
        ],
        record=["z", "sum"],
    )
    run, slow = runner(program, "llvm"), runner(program, "python")
    start = {"x": np.arange(count) + 1.0}
    assert same(run.run(run.memory(start), 1).rows, slow.run(slow.memory(start), 1).rows)


def test_an_overwritten_product_that_no_sum_takes_is_fused():
    """As where memories side by side choose between what was and what is."""
    a, b, c = cg.variables("a b c")
    product = Call(cg.Graph([a], {"p": a * a}), ("x",), ("p",))
    choice = Call(cg.Graph([a, b, c], {"p": cg.where(a, b, c)}), ("y", "p", "x"), ("p",))
    assert len(fuse.fused(Program({"x": 1, "y": 1, "p": 1}, [product, choice], record=["p"])).body) == 1
