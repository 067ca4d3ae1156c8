"""Derivatives of programs: laws on random programs with branches, solves and fixed points."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import cgraph as cg
from cgraph._shared import Along, Array, Passes, Tape, adjoint, run_passes, tangent
from cgraph.extend import (
    Call,
    Factor,
    FixedPoint,
    If,
    Map,
    Program,
    Solve,
    Statement,
    Sum,
    While,
    program_jvp,
    program_vjp,
    runner,
)
from cgraph.program.statements.matrix import Scatter
from tests.each_row import each_row
from tests.slow import slow
from tests.tolerances import CONDITIONED, EQUATIONS, LONG_SUM

N = 3
LENGTHS = {"x": N, "y": N, "z": N, "s": 1, "p": 2, "f": 1, "A": N * N, "pivots": N, "n": 1, "left": 1, "v": N}
LENGTHS |= {"turns": 1, "test": 1}
LENGTHS |= {"pairs": 2 * N, "singles": N, "results": N}  # two numbers an element, or one
LENGTHS["new pairs"] = LENGTHS["pairs"]
VECTORS, NUMBERS = ("x", "y", "z"), ("s", "f")


class RandomProgram:
    """Statements of every kind over vectors x, y, z, a number s, parameters p and a fed number f.

    whole: with those that have no derivatives, too.
    """

    def __init__(self, seed: int, *, whole: bool = False) -> None:
        self.rng = np.random.default_rng(seed)
        self.kinds: list[Callable[[int], list[Statement]]] = [
            self.call, self.map, self.shared, self.total, self.totals, self.solve, self.branch, self.fixed_point,
            self.several, *([self.loop, self.scatter] if whole else []),
        ]  # fmt: skip
        body = [each for _ in range(self.rng.integers(3, 6)) for each in self.any(0)]
        self.program = Program(LENGTHS, body, record=["x", "y", "z", "s"], feed=["f"])

    def any(self, depth: int) -> list[Statement]:
        kinds = self.kinds if depth < 2 else self.kinds[:6]
        return kinds[self.rng.integers(len(kinds))](depth)

    def vector(self) -> str:
        return str(self.rng.choice(VECTORS))

    def formula(self, nodes: list[cg.Node]) -> cg.Node:
        """Bounded, smooth, and of all the nodes."""
        c = self.rng.uniform(0.3, 0.9, len(nodes) + 1)
        total = sum([float(a) * node for a, node in zip(c, nodes, strict=False)], cg.constant(0.0))
        return [cg.sin(total + float(c[-1])), total / cg.sqrt(1.0 + total * total), 0.5 * cg.cos(total) * nodes[0]][
            self.rng.integers(3)
        ]

    def call(self, depth: int) -> list[Statement]:
        a, b, target = self.vector(), self.vector(), self.vector()
        nodes = cg.variables([f"i{k}" for k in range(2 * N + 3)])
        outputs = {f"o{k}": self.formula([nodes[k], nodes[-1 - k], nodes[N]]) for k in range(N)}
        return [Call(cg.Graph(nodes, outputs), (a, b, "p", "f"), (target,))]

    def map(self, depth: int) -> list[Statement]:
        u, v, s = cg.variables("u v s")
        one, two = self.rng.choice(VECTORS, 2, replace=False)
        graph = cg.Graph([u, v, s], {"a": self.formula([u, v, s]), "b": self.formula([v, u])})
        return [Map(graph, (self.vector(), self.vector(), "s"), (str(one), str(two)))]

    def shared(self, depth: int) -> list[Statement]:
        p, q, s, u = cg.variables("p q s u")
        graph = cg.Graph([p, q, s, u], {"a": self.formula([u, p, s]) * q})
        return [Map(graph, (self.vector(),), (self.vector(),), shared=("p", "s"))]

    def total(self, depth: int) -> list[Statement]:
        u, v = cg.variables("u v")
        return [Sum(cg.Graph([u, v], {"a": 0.5 * self.formula([u, v])}), (self.vector(), "f"), ("s",))]

    def totals(self, depth: int) -> list[Statement]:
        p, q, u = cg.variables("p q u")
        outputs = {f"{k}": self.formula([u, p, q]) for k in range(N)}
        return [Sum(cg.Graph([p, q, u], outputs), (self.vector(),), (self.vector(),), shared=("p",))]

    def solve(self, depth: int) -> list[Statement]:
        nodes = cg.variables([f"i{k}" for k in range(N + 2)])
        rows = {
            f"{i}{j}": 3.0 * (i == (j + 1) % N) + 0.3 * self.formula([nodes[i], nodes[-1]])
            for i in range(N)
            for j in range(N)
        }
        matrix = Call(cg.Graph(nodes, rows), (self.vector(), "p"), ("A",))
        more = [Solve("A", "pivots", self.vector(), bool(self.rng.integers(2))) for _ in range(2)]
        return [matrix, Factor("A", "pivots"), *more]

    def scatter(self, depth: int) -> list[Statement]:
        places = self.rng.integers(0, N, 2)
        return [
            Scatter(self.vector(), self.vector(), tuple(self.rng.integers(0, N, 2).tolist()), tuple(places.tolist()))
        ]

    def several(self, depth: int) -> list[Statement]:
        """Several numbers of an element in a register, those moved there before, or that are there from before."""
        p, q, s, a, b, c = nodes = cg.variables("p q s a b c")
        graph = cg.Graph(nodes, {"pair0": self.formula([a, p, c]), "pair1": 0.5 * c, "one": self.formula([b, q, s])})
        fill = moved(self.vector(), "pairs", [k % N for k in range(LENGTHS["pairs"])])
        outputs: tuple[str, ...] = ("new pairs", "results")
        if self.rng.integers(2):
            graph = cg.Graph(nodes, {"one": self.formula([*nodes]), "new0": q * a, "new1": cg.constant(0.5)})
            outputs = ("results", "new pairs")
        table = self.rng.integers(0, N, N).tolist()
        keep = moved("new pairs", "singles", table)
        taken = moved(str(self.rng.choice(["results", "new pairs"])), self.vector(), table)
        total = Sum(cg.Graph(nodes[3:], {"t": b * self.formula([a, c])}), ("new pairs", "results"), ("s",))
        return [fill, Map(graph, ("pairs", "singles"), outputs, ("p", "s")), keep, taken, total]

    def loop(self, depth: int) -> list[Statement]:
        n, s = cg.variables("n s")
        name = f"left{depth}"
        LENGTHS.setdefault(name, 1)
        begin = Call(cg.Graph([s], {"n": 1.5 + cg.floor(2.0 * cg.abs(s))}), ("s",), (name,))
        body = [each for _ in range(2) for each in self.any(depth + 1)]
        count = Call(cg.Graph([n], {"n": n - 1.0}), (name,), (name,))
        return [begin, While(name, (*body, count))]

    def branch(self, depth: int) -> list[Statement]:
        s = cg.variable("s")
        ways = [tuple(each for _ in range(self.rng.integers(0, 3)) for each in self.any(depth + 1)) for _ in range(2)]
        x = cg.variables("x0 x1 x2")
        name = f"test{depth}"
        LENGTHS.setdefault(name, 1)
        return [Call(cg.Graph([*x, s], {"t": x[0] - x[1] + s}), (self.vector(), "s"), (name,)), If(name, *ways)]

    def fixed_point(self, depth: int) -> list[Statement]:
        v, y, turns, p, q = cg.variables("v y turns p q")
        turn = Map(cg.Graph([p, q, v, y], {"v": 0.4 * cg.sin(v) * p + y}), ("v", self.vector()), ("v",), shared=("p",))
        count = Call(cg.Graph([turns], {"t": turns - 1.0}), ("turns",), ("turns",))
        begin = Call(cg.Graph([], {"t": 80.0}), (), ("turns",))
        same = cg.variable("a")
        return [
            begin,
            FixedPoint("turns", (turn, count)),
            Map(cg.Graph([same], {"a": 1.0 * same}), ("v",), (self.vector(),)),
        ]


def moved(source: str, target: str, table: list[int]) -> Call:
    """target[i] = source[table[i]]."""
    numbers = cg.variables([f"i{k}" for k in range(LENGTHS[source])])
    return Call(cg.Graph(numbers, {f"{i}": numbers[k] for i, k in enumerate(table)}), (source,), (target,))


def complex_run(program: Program, state: dict[str, Array], feed: Array) -> dict[str, Array]:
    """The passes over complex numbers, written for this test: what decides looks at real parts."""
    state = {name: np.zeros(length, complex) for name, length in program.registers.items()} | {
        name: np.array(value, complex) for name, value in state.items()
    }

    def graph_at(graph: cg.Graph, x: Array) -> Array:
        values = dict(zip(graph.inputs, x, strict=True))
        for node in graph.nodes:
            if node.args:
                of = [values[arg] for arg in node.args]
                real = node.op.name in ("floor", "abs", "less")
                values[node] = node.op.array(*[value.real if real else value for value in of])
            elif node not in values:
                values[node] = complex(node.value)
        return np.array([values[node] for node in graph.outputs.values()], complex)

    def spread(values: Array, names: tuple[str, ...]) -> None:
        for name in names:
            length = len(state[name])
            state[name], values = values[:length], values[length:]

    def joined(names: tuple[str, ...]) -> Array:
        return np.concatenate([np.empty(0, complex), *[state[name] for name in names]])

    def run(statements: tuple[Statement, ...]) -> None:
        for each in statements:
            match each:
                case Call():
                    spread(graph_at(each.graph, joined(each.inputs)), each.outputs)
                case Map() | Sum():
                    shared, given = joined(each.shared), [state[name] for name in each.inputs]
                    inputs = [row for one in given for row in np.resize(one, (max(1, len(one) // N), N))]
                    rows = np.array(
                        [graph_at(each.graph, np.concatenate([shared, row])) for row in zip(*inputs, strict=True)]
                    )
                    if isinstance(each, Sum):
                        spread(rows.sum(axis=0), each.outputs)
                    else:
                        spread(rows.T.ravel(), each.outputs)
                case If():
                    run(each.body if state[each.register][0].real > 0.0 else each.otherwise)
                case While() | FixedPoint():
                    while state[each.register][0].real > 0.0:
                        run(each.body)
                case Factor():
                    pass  # numpy solves with the matrix itself
                case Solve():
                    matrix = state[each.matrix].reshape(N, N)
                    state[each.vector] = np.linalg.solve(matrix.T if each.transposed else matrix, state[each.vector])

    for row in feed:
        state["f"] = row.copy()
        run(tuple(program.body))
    return state


PASSES, START = 2, ("x", "y", "z", "s", "p")
SEEDS = (0, 1, 5, 7, 9, 16, 17, 18, 22, 24, 26)  # programs that together have every statement, in bodies, too


def seeds(many: int) -> list[Any]:
    """Those, and so many with the slow tests."""
    return [*SEEDS, *slow(*[seed for seed in range(many) if seed not in SEEDS])]


def case(seed: int) -> tuple[Program, dict[str, Array], Array, dict[str, Array], Array, dict[str, Array]]:
    """A program, where it starts, its feed, directions of both, and weights of what it ends with."""
    program, rng = RandomProgram(seed).program, np.random.default_rng(1000 + seed)
    start = {name: rng.uniform(0.3, 0.9, LENGTHS[name]) for name in START}
    along = {name: rng.normal(size=LENGTHS[name]) for name in START}
    weights = {name: rng.normal(size=LENGTHS[name]) for name in ("x", "y", "z", "s")}
    return program, start, rng.uniform(0.3, 0.9, (PASSES, 1)), along, rng.normal(size=(PASSES, 1)), weights


@pytest.mark.parametrize("seed", seeds(1500))
def test_derivatives_are_those_of_the_numbers(seed: int) -> None:
    """J x_dot beside a complex step, along a tape, too, and w . J x_dot = J^T w . x_dot."""
    program, start, feed, along, feed_along, weights = case(seed)
    ends = complex_run(
        program, {name: start[name] + 1e-200j * along[name] for name in START}, feed + 1e-200j * feed_along
    )
    wanted = np.concatenate([ends[name].imag / 1e-200 for name in weights])
    values = np.concatenate([ends[name].real for name in weights])

    backend = "python" if seed % 8 else "auto"
    moved = program_jvp(program, [*START, "f"], constant=["turns"])
    forward = runner(moved.program, backend)
    known = {**start, **{moved.vectors[name]: along[name] for name in START if name in moved.vectors}}
    memory = forward.memory(known)
    dots = []
    for k in range(PASSES):
        forward.write(memory, moved.vectors["f"], feed_along[k])
        dots.append(forward.run(memory, 1, 1, feed[k : k + 1]).rows[0])
    size = len(values)
    names = [name for name in weights if name in moved.vectors]
    assert dots[-1][:size] == pytest.approx(values, rel=CONDITIONED, abs=LONG_SUM)
    tangents = dict.fromkeys(weights, 0.0) | dict(
        zip(names, np.split(dots[-1][size:], np.cumsum([LENGTHS[name] for name in names])[:-1]), strict=True)
    )
    got = np.concatenate([np.broadcast_to(tangents[name], LENGTHS[name]) for name in weights])
    scale = 1.0 + np.abs(wanted).max()
    assert got / scale == pytest.approx(wanted / scale, abs=EQUATIONS)

    passes = Passes(program, list(weights), [*START, "f"], constant=["turns"])
    ready = Along(passes, adjoint(passes, list(weights)), list(weights), backend)
    tape = Tape(ready, start, lambda first, last: feed[first:last, :, None], checkpoints=seed % 2)
    tape.run(0, PASSES)
    bars, rows, unsolved = tape.cotangents(weights)
    assert not unsolved
    pulled = program_vjp(program, list(weights), [*START, "f"], constant=["turns"], backend=backend)
    ends, again = pulled(start, PASSES, weights, feed)
    assert all([ends[name].tolist() == tape.value(name)[:, 0].tolist() for name in weights])
    bars = {name: bar[:, 0] for name, bar in bars.items()} | {"f": rows[:, :, 0]}
    assert {name: bar.tolist() for name, bar in bars.items()} == {name: bar.tolist() for name, bar in again.items()}
    left = sum(float(weights[name] @ np.broadcast_to(tangents[name], LENGTHS[name])) for name in weights)
    right = sum(float(bars[name] @ along[name]) for name in START if name in bars)
    right += float(np.sum(bars["f"] * feed_along))
    assert left / scale == pytest.approx(right / scale, abs=EQUATIONS)

    ready = Along(passes, tangent(passes, names), [], "python")
    tape = Tape(ready, start, lambda first, last: feed[first:last, :, None])
    tape.run(0, PASSES)
    memory = tape.derivative_memory(along, 1)
    for k in range(PASSES):
        ready.derivative.write(memory, ready.linear.vectors["f"], feed_along[k][:, None])
        ((_, _, rows),) = tape.records(backwards=False)
        dots = run_passes(ready.derivative, memory, 1, 1, rows[k : k + 1])[0, :, 0]
    assert dots / scale == pytest.approx(np.concatenate([tangents[name] for name in names]) / scale, abs=EQUATIONS)


def test_a_loop_has_no_derivatives_and_says_so() -> None:
    n = cg.variable("n")
    less = Call(cg.Graph([n], {"n": n - 1.0}), ("n",), ("n",))
    program = Program({"n": 1}, [If("n", (While("n", (less,)),))], record=["n"])
    for derivative in (program_jvp, program_vjp):
        with pytest.raises(TypeError, match="of loops only a FixedPoint has them"):
            derivative(program, ["n"])


def test_an_iteration_has_the_slope_of_its_equations_from_wherever_it_begins() -> None:
    """v = cos(a v): v' = -v sin(a v) / (1 + a sin(a v))."""
    v, a, left = cg.variables("v a left")
    turn = Call(cg.Graph([v, a, left], {"v": cg.cos(a * v), "left": left - 1.0}), ("v", "a", "left"), ("v", "left"))
    program = Program({"v": 1, "a": 1, "left": 1}, [FixedPoint("left", (turn,))], record=["v"])
    for start in (0.1, 0.9):
        values = {"v": start, "a": 0.7, "left": 200.0}
        ends, bars = program_vjp(program, ["v"], ["a"], constant=["left"])(values, 1, {"v": 1.0})
        end = float(ends["v"][0])
        slope = -end * np.sin(0.7 * end) / (1.0 + 0.7 * np.sin(0.7 * end))
        assert bars["a"] == pytest.approx([slope], rel=EQUATIONS)


X, P = cg.variables("x p")
SQUARE = cg.Graph([X, P], {"x": P * X * X})  # twice from 1.1 with 0.7: p^3 x^4, 4 p^3 x^3, 3 p^2 x^4
TWICE = (0.7**3 * 1.1**4, 4.0 * 0.7**3 * 1.1**3, 3.0 * 0.7**2 * 1.1**4)


@each_row(
    ("a", "b"),
    [("x", "p"), ("x", "x@2"), ("x@2", "p:dot"), ("x", "x:bar"), ("x", "x:dot"), ("x", "unsolved"), ("x", "unsolved@")],
)
def test_registers_may_have_any_name(a: str, b: str) -> None:
    program = Program({a: 1, b: 1}, [Call(SQUARE, (a, b), (a,))], record=[a])
    values, bars = program_vjp(program, [a, a], [b, b])({a: 1.1, b: 0.7}, 2, {a: 1.0})
    found = [*values[a], *bars[a], *bars[b]]
    assert found == pytest.approx(TWICE, rel=EQUATIONS)
    moved = program_jvp(program, [b, b])
    run = runner(moved.program, "python")
    rows = run.run(run.memory({a: 1.1, b: 0.7, moved.vectors[b]: 1.0}), 2).rows[-1]
    assert rows == pytest.approx([TWICE[0], TWICE[2]], rel=EQUATIONS)


def test_what_needs_no_record_has_cotangents_too(backend: str) -> None:
    program = Program({"x": 1, "p": 1, "y": 1}, [Call(cg.Graph([X, P], {"y": P * X}), ("x", "p"), ("y",))], record=())
    pull = program_vjp(program, ["y"], ["x", "p"], backend=backend)
    _, bars = pull({"x": 2.0, "p": 3.0}, 1, {"y": 1.0})
    assert (bars["x"].tolist(), bars["p"].tolist()) == ([3.0], [2.0])


def test_a_register_that_is_fed_twice_in_wrt_has_its_rows() -> None:
    program = Program({"x": 1, "p": 1}, [Call(SQUARE, ("x", "p"), ("x",))], record=(), feed=["p"])
    rows = program_vjp(program, ["x"], ["p", "p"])({"x": 1.1}, 2, {"x": 1.0}, feed=[[0.7], [0.8]])[1]["p"]
    first = 0.7 * 1.1**2
    assert rows.ravel() == pytest.approx([2.0 * 0.8 * first * 1.1**2, first**2], rel=EQUATIONS)


@each_row(
    ("call", "said"),
    [
        (lambda: program_vjp(3, ["x"]), "program must be a Program, got int"),
        (lambda: program_jvp(Program({"x": 1}, [], record=["x"], stop="x")), "no stop"),
        (lambda: program_vjp(FED, ["y"]), "of names register 'y', not among x, p"),
        (lambda: program_vjp(FED, ["x", "p"]), "of names register 'p', which is fed"),
        (lambda: program_vjp(FED, ["x"], ["p"], constant=["p"]), "wrt names register 'p', which is constant"),
        (lambda: program_vjp(FED, ["x"], constant="p"), "constant must be a sequence of registers, got the text 'p'"),
        (lambda: program_vjp(FED, ["x"])({"x": 1.0}, 1, {"x": 1.0}, feed=[[1.0], [2.0]]), "a row for each of 1 passes"),
        (lambda: program_vjp(FED, ["x"])({"z": 1.0}, 1, {"x": 1.0}, feed=[[1.0]]), "values names register 'z'"),
        (lambda: program_vjp(FED, ["x"])({"x": 1.0}, 1, {"y": 1.0}, feed=[[1.0]]), "seeds names register 'y'"),
        (lambda: program_vjp(FED, ["x"])({"x": 1.0}, 1, {"x": None}, feed=[[1.0]]), r"seeds\['x'\]"),
    ],
)
def test_what_makes_no_sense_is_told(call: Callable[[], object], said: str) -> None:
    with pytest.raises((TypeError, cg.GraphError), match=said):
        call()


FED = Program({"x": 1, "p": 1}, [Call(SQUARE, ("x", "p"), ("x",))], record=(), feed=["p"])
