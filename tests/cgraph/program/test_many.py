"""`many`: memories side by side take the course of each of them, to the bit."""

import numpy as np
import pytest

import cgraph as cg
from cgraph._shared import Along, Array, Passes, adjoint
from cgraph.extend import Call, Factor, If, Program, Solve, While, many, program_jvp, runner
from cgraph.program.many import many_keeping, outliving
from tests.cgraph.program.test_program_derivatives import LENGTHS, PASSES, START, RandomProgram, seeds

COUNT = 11  # more than one vector, and not a whole number of them
EDGES = {3: np.inf, 5: np.nan, 8: 0.0}  # {memory: what one of its numbers is}
X, N = cg.variables("x n")
LESS = Call(cg.Graph([N], {"n": N - 1.0}), ("n",), ("n",))
HALVE = Call(cg.Graph([X], {"x": 0.5 * X}), ("x",), ("x",))


def side_by_side(program: Program, values: dict[str, Array], feed: Array, backend: str, passes: int = PASSES) -> Array:
    """The rows, which one by one are the same to the bit, as is what registers hold at the end."""
    ready = runner(program, backend, fma=False)
    memories = ready.memory(values, COUNT)
    together = memories.copy()
    rows = ready.run(together, passes, 1, feed).rows
    for k in range(COUNT):
        alone = memories[:, k].copy()
        own = ready.run(alone, passes, 1, feed[:, :, k]).rows
        assert np.array_equal(own, rows[:, :, k], equal_nan=True)
        for name in program.registers:
            assert np.array_equal(ready.read(alone, name), ready.read(together, name)[:, k], equal_nan=True), name
    return rows


@pytest.mark.parametrize("seed", seeds(400))
def test_random_programs_in_lanes_run_each_to_its_own_stop(seed: int) -> None:
    """The memories, passes and rows of lanes, in which others follow those that stop, are those of runs alone."""
    pytest.importorskip("llvmlite")
    s, n, count, clock = cg.variables("s n passed clock")
    ends = {
        "passed": count + 1.0,
        "wish": s - 0.1,
        "over": count + 1.0 >= n,
        "clock": clock + 0.3 + 0.1 * cg.sin(count),
    }
    end = Call(cg.Graph([s, n, count, clock], ends), ("s", "n", "passed", "clock"), ("passed", "wish", "over", "clock"))
    random, rng = RandomProgram(seed, whole=True).program, np.random.default_rng(seed)
    lengths = {**random.registers, "n": 1, "clock": 1, "wish": 1, "over": 1, "passed": 1}
    record = [*random.record, "clock"]
    program = Program(lengths, [*random.body, end], record, record_if="wish", stop="over")
    ready, total = runner(program), 29
    code = ready.lane_code("clock", ["x", "y", "z", "s", "passed"])
    assert code is not None
    values = {name: rng.uniform(-2.0, 2.0, (LENGTHS[name], total)) for name in START}
    values |= {"passed": np.zeros((1, total)), "n": rng.integers(1, 15, (1, total)) * 1.0}
    for lane, edge in EDGES.items():
        values["x"][seed % 3, lane] = edge
    start, marks = ready.memory(values, total).T.copy(), np.array([0.2, 0.5, 1.1, 1.2, 1.9, 2.0])
    memories = np.zeros((total, code.size))
    for name, place in code.numbers.items():
        memories[:, place] = ready.read(start.T, name).T
    passes, rows = np.zeros((total, 2), np.int64), np.full((total, len(marks), program.width), -7.0)
    for most in (4, 3, 50):  # a run may be interrupted
        which = np.flatnonzero(passes[:, 0] < values["n"][0])[::-1].copy()
        code(memories, which, passes, most, rows, marks)
    for k in range(total):
        alone, mark = start[k].copy(), 0
        found, done = ready.run(alone, 100)
        assert done == passes[k, 0]
        for name, place in code.numbers.items():
            assert np.array_equal(memories[k, place], ready.read(alone, name), equal_nan=True), name
        for row in found:
            if mark < len(marks) and row[-1] >= marks[mark]:
                assert np.array_equal(rows[k, mark], row, equal_nan=True)
                rows[k, mark], mark = -7.0, int(np.searchsorted(marks, row[-1], side="right"))
        assert passes[k, 1] == mark
        assert (rows[k] == -7.0).all()


def test_registers_that_nothing_reads_later_are_not_put_back() -> None:
    a, b = cg.variables("a b")
    halve, sums = cg.Graph([a], {"b": 0.5 * a}), cg.Graph([a, b], {"a": a + b})
    inside = (Call(halve, ("a",), ("b",)), Call(sums, ("a", "b"), ("a",)))
    program = Program({"a": 1, "b": 1, "test": 1}, [If("test", inside)], record=["a"])
    assert outliving(program) == ["a", "test"]
    assert "b before:1" in many(program).registers
    assert "b before:1" not in many_keeping(program, []).registers
    assert "b before:1" in many_keeping(program, ["b"]).registers


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("seed", seeds(600))
def test_random_programs_and_their_derivatives_are_the_same_side_by_side(seed: int) -> None:
    rng, backend = np.random.default_rng(seed), "python" if seed % 3 else "auto"
    values = {name: rng.uniform(-2.0, 2.0, (LENGTHS[name], COUNT)) for name in START}
    for lane, edge in EDGES.items():
        values["x"][seed % 3, lane] = edge
    feed = rng.uniform(-1.0, 1.0, (PASSES, 1, COUNT))
    side_by_side(RandomProgram(seed, whole=True).program, values, feed, backend)
    program = RandomProgram(seed).program
    side_by_side(program, values, feed, backend)

    moved = program_jvp(program, [*START, "f"], constant=["turns"])
    dots = {dot: rng.normal(size=(LENGTHS[name], COUNT)) for name, dot in moved.vectors.items()}
    side_by_side(moved.program, values | dots, feed, backend)

    ends = ["x", "y", "z", "s"]
    passes = Passes(program, ends, [*START, "f"], constant=["turns"])
    along = Along(passes, adjoint(passes, ends), ends, "python")
    starts = {passes.handed.get(name, name): value for name, value in values.items()}
    tape = side_by_side(along.forward.program, starts, feed, backend)
    back = along.derivative.program
    seeds = {along.linear.vectors[name]: rng.normal(size=(LENGTHS[name], COUNT)) for name in ends}
    known = {name: value for name, value in values.items() if name in back.registers}
    side_by_side(back, known | seeds, tape[::-1, : back.feed_width], backend)


def test_a_lane_that_is_done_keeps_its_bits_while_others_go_on(backend: str) -> None:
    """x halved n times; where n is not positive, infinite or NaN, x stays, and so does its sign."""
    program = Program({"x": 1, "n": 1}, [While("n", (HALVE, LESS))], record=["x"])
    n = np.array([[0.0, 1.0, 2.0, 1060.0, -3.0, np.nan, 7.0, 0.5, -0.0, 3.0, -np.inf]])
    rows = side_by_side(program, {"x": np.full((1, COUNT), -1.0), "n": n}, np.empty((1, 0, COUNT)), backend, 1)
    assert rows[0, 0].tolist() == [-1.0, -0.5, -0.25, -(0.5**1060), -1.0, -1.0, -(0.5**7), -0.5, -1.0, -0.125, -1.0]


def test_a_loop_that_one_lane_never_enters_does_not_run_on_for_it(backend: str) -> None:
    """Of x <= 0 the loop inside would have no end: x doubled until it is above 1."""
    short = Call(cg.Graph([X], {"n": 1.0 - X}), ("x",), ("n",))
    double = Call(cg.Graph([X], {"x": 2.0 * X}), ("x",), ("x",))
    program = Program({"x": 1, "n": 1}, [If("x", (short, While("n", (double, short))))], record=["x"])
    x = np.linspace(-1.0, 1.0, COUNT)[None]
    rows = side_by_side(program, {"x": x}, np.empty((1, 0, COUNT)), backend, 1)
    assert (rows[0, 0, x[0] <= 0.0] == x[0, x[0] <= 0.0]).all()
    assert (rows[0, 0, x[0] > 0.0] >= 1.0).all()


@pytest.mark.parametrize("transposed", [False, True])
def test_every_lane_has_pivots_of_its_own(backend: str, transposed: bool) -> None:
    rng, n = np.random.default_rng(1), 5
    registers = {"A": n * n, "p": n, "b": n, "test": 1}
    solve = Factor("A", "p"), Solve("A", "p", "b", transposed)
    matrices = np.stack([rng.permutation(np.eye(n)) + 0.2 * rng.normal(size=(n, n)) for _ in range(COUNT)], axis=2)
    matrices[2, 2, 4] = np.nan
    matrices[:, :, 6] = 0.0
    b = rng.normal(size=(n, COUNT))
    test = (np.arange(COUNT)[None] % 4 > 0) * 1.0
    for body in (solve, (If("test", solve),), (If("test", solve[:1]), solve[1])):
        values = {"A": matrices.reshape(n * n, COUNT), "b": b, "test": test, "p": np.full((n, COUNT), 3.0)}
        program = Program(registers, body, record=["b"])
        rows = side_by_side(program, values, np.empty((1, 0, COUNT)), backend, 1)
    program = Program(registers, [If("test", solve)], record=["b"])
    rows = side_by_side(program, {**values, "p": np.full((n, COUNT), np.nan)}, np.empty((1, 0, COUNT)), backend, 1)
    for k in (1, 2, 3, 5, 7):
        matrix = matrices[:, :, k].T if transposed else matrices[:, :, k]
        assert rows[0, :, k] == pytest.approx(np.linalg.solve(matrix, b[:, k]), rel=1e-12)
    assert rows[0, :, 0].tolist() == b[:, 0].tolist()


def test_what_runs_one_memory_at_a_time_is_told(backend: str) -> None:
    for control in ({"stop": "n"}, {"record_if": "n"}):
        run = runner(Program({"n": 1}, [LESS], record=["n"], **control), backend)  # type: ignore[arg-type]
        with pytest.raises(cg.GraphError, match=f"programs with {next(iter(control))} run one memory at a time, not"):
            run.run(np.zeros((1, 3)), 1)


def test_a_program_that_takes_one_course_is_as_it_was() -> None:
    straight = Program({"n": 1}, [LESS], record=["n"])
    assert many(straight) is straight
    twice = many(many(Program({"n": 1, "x": 1}, [While("n", (HALVE, LESS))], record=["x"])))
    values = {"n": np.arange(COUNT)[None] * 1.0, "x": np.ones((1, COUNT))}
    rows = side_by_side(twice, values, np.empty((1, 0, COUNT)), "python", 1)
    assert rows[0, 0].tolist() == [0.5**k for k in range(COUNT)]
