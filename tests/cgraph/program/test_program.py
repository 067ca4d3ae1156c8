"""Programs: machine code and Python do the same, and what they do is right."""

import gc
import itertools
import math
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import cgraph as cg
from cgraph.extend import Call, Factor, If, Map, Program, Solve, Sum, While, runner
from tests.each_row import each_row
from tests.repeated import repeated
from tests.strategies import examples
from tests.tolerances import LONG_SUM


def spring() -> cg.Graph:
    x, v, h = cg.variables("x v h")
    return cg.Graph([x, v, h], {"x_next": x + h * v, "v_next": v - h * (x + h * v)})


def test_a_loop_is_the_graph_again_and_again(backend: str) -> None:
    graph = spring()
    state = {"x": 1.0, "v": 0.0, "h": 0.01}
    rows = []
    for _ in range(30):
        after = graph.evaluate(state)
        state |= {"x": after["x_next"], "v": after["v_next"]}
        rows.append([state["x"], state["v"]])
    run = repeated(graph, {"x": "x_next", "v": "v_next"}, backend, fma=False)
    assert run([1.0, 0.0, 0.01], 30).tolist() == rows
    assert run([1.0, 0.0, 0.01], 30, every=7).tolist() == rows[6::7]
    assert run([1.0, 0.0, 0.01], 0).shape == (0, 2)


def test_a_bound_run_is_the_run_on_the_same_memory(backend: str) -> None:
    x = cg.variable("x")
    program = Program({"x": 1}, [Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))], record=["x"])
    run = runner(program, backend)
    memory, rows = run.memory({"x": 8.0}), np.empty((2, 1))
    call = run.bind(memory, rows)
    call()
    assert rows.ravel().tolist() == [4.0, 2.0]
    call()
    assert rows.ravel().tolist() == [1.0, 0.5]
    run.write(memory, "x", 16.0)
    call()
    assert rows.ravel().tolist() == run.run(run.memory({"x": 16.0}), 2).rows.ravel().tolist() == [8.0, 4.0]


def test_a_bound_run_needs_memory_that_fits(backend: str) -> None:
    x = cg.variable("x")
    body = [Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))]
    run = runner(Program({"x": 1}, body, record=["x"]), backend)
    for rows in (np.empty((2, 2)), np.empty(2), np.empty((2, 1), np.float32), np.empty((4, 1))[::2]):
        with pytest.raises(cg.GraphError, match="rows must be"):
            run.bind(run.memory({}), rows)
    with pytest.raises(cg.GraphError, match="a memory must"):
        run.bind(np.empty(run.size + 1), np.empty((1, 1)))
    fed = runner(Program({"x": 1}, body, record=["x"], feed=["x"]), backend)
    with pytest.raises(cg.GraphError, match="takes no feed"):
        fed.bind(fed.memory({}), np.empty((1, 1)))


def test_registers_that_are_read_and_written(backend: str) -> None:
    a, b = cg.variables("a b")
    swap = cg.Graph([a, b], {"p": b + 0.0, "q": a + 0.0})
    program = Program({"x": 3, "y": 3}, [Map(swap, ("x", "y"), ("x", "y"))], record=["x", "y"])
    run = runner(program, backend)
    assert run.run(run.memory({"x": [1, 2, 3], "y": [4, 5, 6]}), 1).rows.tolist() == [[4, 5, 6, 1, 2, 3]]


@each_row(("count", "order"), itertools.product([1, 3, 8, 19], ["xh", "hx"]))
def test_registers_that_every_element_shares(backend: str, count: int, order: str) -> None:
    a, b, c, x, h = cg.variables("a b c x h")
    graph = cg.Graph([a, b, c, *cg.variables([*order])], {"u": (a + b * x) * h, "v": c - x})
    registers = {"ab": 2, "c": 1, "x": count, "h": 1, "u": count, "v": count}
    program = Program(registers, [Map(graph, tuple(order), ("u", "v"), shared=("ab", "c"))], record=["u", "v"])
    run, elements = runner(program, backend, fma=False), np.arange(count) + 0.5
    start = {"ab": [2.0, 3.0], "c": 7.0, "x": elements, "h": 0.25}
    expected = [*((2.0 + 3.0 * elements) * 0.25), *(7.0 - elements)]
    assert run.run(run.memory(start), 1).rows[0].tolist() == expected
    memories = run.memory({"ab": [[2.0, 2.0], [3.0, 0.0]], "c": 7.0, "x": np.tile(elements, (2, 1)).T, "h": 0.25}, 2)
    both = run.run(memories, 1).rows[0]
    assert both[:, 0].tolist() == expected
    assert both[:count, 1].tolist() == [0.5] * count


def test_sum_adds_from_the_first_to_the_last(backend: str) -> None:
    a, s = cg.variables("a s")
    program = Program({"a": 4, "s": 1, "o": 1}, [Sum(cg.Graph([a, s], {"o": a * s}), ("a", "s"), ("o",))], record=["o"])
    values = [1e16, 1.0, -1e16, 3.0]
    run = runner(program, backend, fma=False)
    expected = (((0.0 + 1e16) + 1.0) - 1e16) + 3.0
    assert run.run(run.memory({"a": values, "s": 1.0}), 1).rows.tolist() == [[expected]]
    many = np.repeat(run.memory({"a": values, "s": 1.0})[:, None], 5, axis=1)
    assert run.run(many, 1).rows.ravel().tolist() == [expected] * 5


def test_while_and_if(backend: str) -> None:
    """The greatest common divisor by subtraction; a NaN ends a while."""
    a, b = cg.variables("a b")
    less = cg.Graph([a, b], {"on": cg.not_equal(a, b), "first": cg.less(b, a)})
    subtract = cg.Graph([a, b], {"d": a - b})
    body = (
        If("first", (Call(subtract, ("a", "b"), ("a",)),), (Call(subtract, ("b", "a"), ("b",)),)),
        Call(less, ("a", "b"), ("on", "first")),
    )
    program = Program(
        {"a": 1, "b": 1, "on": 1, "first": 1},
        [Call(less, ("a", "b"), ("on", "first")), While("on", body)],
        record=["a"],
    )
    run = runner(program, backend)
    for x, y in ((84, 36), (7, 13), (5, 5), (1, 9)):
        assert run.run(run.memory({"a": x, "b": y}), 1).rows.tolist() == [[math.gcd(x, y)]]
    program = Program({"a": 1}, [While("a", (Call(cg.Graph([a], {"o": a + 1.0}), ("a",), ("a",)),))], record=["a"])
    run = runner(program, backend)
    assert math.isnan(run.run(run.memory({"a": math.nan}), 1).rows[0, 0])


def test_record_if_and_stop(backend: str) -> None:
    k = cg.variable("k")
    count = cg.Graph([k], {"k": k + 1.0, "even": cg.equal(0.0, cg.sin(k + 1.0 - k - 1.0)), "done": (k + 1.0) >= 5.0})
    registers = {"k": 1, "even": 1, "done": 1}
    body = [Call(count, ("k",), ("k", "even", "done"))]
    run = runner(Program(registers, body, record=["k"], record_if="even", stop="done"), backend)
    memory = run.memory({})
    rows, passes = run.run(memory, 100)
    assert (rows.ravel().tolist(), passes) == ([1.0, 2.0, 3.0, 4.0, 5.0], 5)
    assert run.read(memory, "k").tolist() == [5.0]
    never = runner(Program(registers, body, record=["k"], record_if="done"), backend)
    assert never.run(never.memory({}), 6).rows.ravel().tolist() == [5.0, 6.0]


def test_products_of_an_exact_call_are_rounded_by_themselves(backend: str) -> None:
    """What cancels is 0, also where the graph is called in both ways, and in a branch that seldom runs."""
    nodes = cg.variables("a b c d")
    graph = cg.Graph(nodes, {"e": nodes[0] * nodes[1] - nodes[2] * nodes[3]})
    joined, exact = Call(graph, ("x",), ("fused",)), Call(graph, ("x",), ("exact",), exact=True)
    registers, record = {"x": 4, "fused": 1, "exact": 1, "again": 1}, ["fused", "exact", "again"]
    seldom = If("fused", (Call(graph, ("x",), ("again",), exact=True),), (exact,), seldom=True)
    run = runner(Program(registers, [exact, joined, seldom], record), backend)
    x = [0.1, 0.3, 0.3, 0.1]
    fused, alone, again = run.run(run.memory({"x": x, "again": 7.0}), 1).rows[0].tolist()
    assert alone == 0.0
    assert abs(fused) < 1e-16
    assert again == (0.0 if fused > 0.0 else 7.0)


def test_a_run_goes_on_where_the_last_one_ended(backend: str) -> None:
    k = cg.variable("k")
    count = [Call(cg.Graph([k], {"k": k + 1.0, "done": (k + 1.0) >= 5.0}), ("k",), ("k", "done"))]
    run = runner(Program({"k": 1, "done": 1}, count, ["k"], stop="done"), backend)
    memory = run.memory({"k": 1.0})
    advance = run.bind(memory)
    for passes, end in ((2, 3.0), (100, 5.0)):
        advance(passes)
        assert run.read(memory, "k").tolist() == [end]
    graph = spring()
    program = Program({"c": 2, "h": 1}, [Call(graph, ("c", "h"), ("c",))], record=["c"])
    run = runner(program, backend)
    whole = run.run(run.memory({"c": [1.0, 0.0], "h": 0.1}), 9).rows
    memory = run.memory({"c": [1.0, 0.0], "h": 0.1})
    parts = [run.run(memory, k).rows for k in (2, 0, 3, 4)]
    assert np.concatenate(parts).tolist() == whole.tolist()


@settings(max_examples=examples(60), deadline=None)
@given(n=st.integers(1, 9), seed=st.integers(0, 10_000))
def test_factor_and_solve(n: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    a = generator.normal(size=(n, n)) * 10.0 ** generator.integers(-6, 7, size=(n, 1))
    x = generator.normal(size=n)
    program = Program({"a": n * n, "p": n, "b": n}, [Factor("a", "p"), Solve("a", "p", "b")], record=["b", "a", "p"])
    results = []
    for kind in ("python", "llvm")[: 1 + bool(find_spec("llvmlite"))]:
        run = runner(program, kind, fma=False)
        results.append(run.run(run.memory({"a": a.ravel(), "b": a @ x}), 1).rows)
        residual = a @ results[-1][0, :n] - a @ x
        assert np.all(np.abs(residual) <= LONG_SUM * (np.abs(a) @ np.abs(results[-1][0, :n])))
    for one, other in itertools.pairwise(results):
        assert one.tolist() == other.tolist()


def test_the_pivot_is_the_largest_and_a_singular_matrix_gives_no_number(backend: str) -> None:
    program = Program({"a": 4, "p": 2, "b": 2}, [Factor("a", "p"), Solve("a", "p", "b")], record=["b"])
    run = runner(program, backend)
    assert run.run(run.memory({"a": [0.0, 1.0, 1.0, 0.0], "b": [2.0, 3.0]}), 1).rows.tolist() == [[3.0, 2.0]]
    tiny = run.run(run.memory({"a": [1e-20, 1.0, 1.0, 1.0], "b": [1.0, 2.0]}), 1).rows
    assert tiny.tolist() == [[1.0, 1.0]]
    assert not np.isfinite(run.run(run.memory({"a": [1.0, 2.0, 2.0, 4.0], "b": [1.0, 1.0]}), 1).rows).all()


@each_row(
    ("asked", "wave", "count"),  # functions of the C library go element by element; 8 elements fill vectors
    itertools.product([0.0, 1.0, 2.0, 2.5, 99.0, math.nan], [False, True], [5, 8]),
)
def test_elements_have_several_numbers_in_a_register(backend: str, asked: float, wave: bool, count: int) -> None:
    k, a, b, c = cg.variables("k a b c")
    outputs = {"sum": k * (cg.sin(a) if wave else a) + b, "product": b * c, "difference": a - b}
    graph = cg.Graph([k, a, b, c], outputs)
    registers = {"k": 1, "pairs": 2 * count, "c": 1, "both": 2 * count, "differences": count, "asked": 1}
    several = Map(graph, ("pairs", "c"), ("both", "differences"), ("k",), ("asked",))
    ready = runner(Program(registers, [several], record=["both", "differences"]), backend, fma=False)
    first, second = np.arange(2.0 * count).reshape(2, count)
    memory = ready.memory({"k": 3.0, "pairs": [*first, *second], "c": 0.3, "asked": asked})
    waves = np.array([*map(math.sin, first)]) if wave else first
    wanted = np.stack([3.0 * waves + second, second * 0.3, first - second])
    many = ready.run(np.repeat(memory[:, None], 11, axis=1), 1).rows[0]
    for found in (ready.run(memory, 1).rows[0], *many.T):
        computed = int(min(count, max(1.0, asked)))
        assert found.reshape(3, count)[:, :computed].tolist() == wanted[:, :computed].tolist()


ONE = cg.Graph([cg.variable("a")], {"o": -cg.variable("a")})


@each_row(
    ("registers", "body", "message"),
    [
        ({"a": 2}, [Call(ONE, ("b",), ("a",))], "names register 'b', not among a"),
        ({"a": 2, "b": 1}, [Call(ONE, ("a",), ("b",))], "needs 1 inputs, the registers a hold 2"),
        ({"a": 1, "b": 2}, [Call(ONE, ("a",), ("b",))], "needs 1 outputs, the registers b hold 2"),
        ({"a": 2, "b": 3}, [Map(ONE, ("a",), ("b",))], "register 'a' needs length 3 or 1, got 2"),
        ({"a": 2, "b": 3}, [Map(ONE, ("a", "b"), ("b",))], "needs 1 registers, got 2: a, b"),
        ({"a": 2, "b": 3}, [Map(ONE, (), ("b",), shared=("a",))], "has 1 inputs, the shared registers hold 2"),
        ({"b": 3}, [Map(ONE, (), ("b",), shared=("a",))], "names register 'a', not among b"),
        ({"a": 2, "b": 3}, [Sum(ONE, ("a",), ("b",))], "needs 1 outputs, the registers b hold 3"),
        ({"a": 2}, [While("a", ())], "While needs register 'a' to have length 1, got 2"),
        ({"a": 2}, [If("a", ())], "If needs register 'a' to have length 1, got 2"),
        ({"a": 3, "p": 2}, [Factor("a", "p")], "Factor needs register 'a' to have length 4, got 3"),
        ({"a": 4, "p": 2, "b": 1}, [Solve("a", "p", "b")], "Solve needs register 'b' to have length 2, got 1"),
        ({"a": 4, "b": 2}, [Map(ONE, ("a",), ("b",))], "needs 1 registers, got 2: a"),
        ({"a": 2, "b": 2}, [Map(ONE, ("a",), ("b",), (), ("a",))], "needs register 'a' to have length 1, got 2"),
        ({"a": -1}, [], "register 'a' needs a length, an integer not negative, got -1"),
        ({"a": 1}, [While("a", (Call(ONE, ("z",), ("a",)),))], "names register 'z'"),
    ],
)
def test_a_program_that_does_not_fit_is_refused(registers, body, message) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(cg.GraphError, match=message):
        Program(registers, body, record=[])


def test_wrong_use_of_a_runner(backend: str) -> None:
    program = Program({"a": 1}, [While("a", (Call(ONE, ("a",), ("a",)),))], record=["a"])
    run = runner(program, backend)
    with pytest.raises(cg.GraphError, match="no register 'b'"):
        run.memory({"b": 1.0})
    with pytest.raises(cg.GraphError, match=r"register 'a' needs shape \(1,\), got \(2,\)"):
        run.memory({"a": [1.0, 2.0]})
    with pytest.raises(cg.GraphError, match=r"float64 in shape \(1,\), got float64 \(2,\)"):
        run.run(np.zeros(2), 1)


def test_code_in_a_cycle_of_garbage_is_let_go_in_order() -> None:
    """Python ends the objects of a cycle in any order; LLVM's context must outlive what was made in it."""
    pytest.importorskip("llvmlite")
    for _ in range(6):
        held: list[object] = [
            cg.compile(ONE, "llvm"),
            runner(Program({"x": 1}, [Call(ONE, ("x",), ("x",))], ["x"]), "llvm"),
        ]
        held.append(held)
        del held
        gc.collect()


def test_a_feed_is_read_before_every_pass(backend: str) -> None:
    x, u = cg.variables("x u")
    added = Call(cg.Graph([x, u, cg.variable("w")], {"x": x + u}), ("x", "u"), ("x",))
    sums = Program({"x": 1, "u": 2, "v": 2}, [added], record=["x", "v"], feed=["u", "v"])
    ready = runner(sums, backend)
    feed = np.arange(12.0).reshape(3, 4)
    assert ready.run(ready.memory({"x": 1.0}), 3, 1, feed).rows.tolist() == [[1, 2, 3], [5, 6, 7], [13, 10, 11]]
    assert ready.run(ready.memory({"x": 1.0}), 2, 2, feed[:2]).rows.tolist() == [[5, 6, 7]]
    wide = np.stack([feed, -feed], axis=1).reshape(3, 8)
    for view in (wide[::-1, :4], np.asfortranarray(feed)[::-1], wide.astype(np.float32)[::-1, :4]):
        assert ready.run(ready.memory({"x": 1.0}), 3, 1, view).rows[:, 0].tolist() == [9, 13, 13]
    many = np.stack([feed, 2.0 * feed], axis=2)
    memories = ready.memory({"x": np.array([[1.0, 0.0]])}, 2)
    assert ready.run(memories.copy(), 3, 1, many).rows[:, 0].tolist() == [[1, 0], [5, 8], [13, 24]]
    assert ready.run(memories.copy(), 2, 2, many[:2]).rows[:, 0].tolist() == [[5, 8]]
    assert ready.run(memories.copy(), 3, 1, feed[:, :, None]).rows[:, 0].tolist() == [[1, 0], [5, 4], [13, 12]]
    for wrong in (None, feed[:2], feed[:, :3]):
        with pytest.raises(cg.GraphError, match=r"needs a feed of shape \(3, 4\)"):
            ready.run(ready.memory({}), 3, 1, wrong)
    with pytest.raises(cg.GraphError, match="the feed writes register 'u' twice"):
        Program({"u": 1}, [], record=[], feed=["u", "u"])
    with pytest.raises(cg.GraphError, match="the feed names register 'w'"):
        Program({"u": 1}, [], record=[], feed=["w"])


def test_many_memories_record_what_a_pass_records_from_every_value(backend):
    a, b, y, s = cg.variables("a b y s")
    body = [
        Call(cg.Graph([a, b], {"u": cg.sin(a) * b, "v": a / b, "s": a + b}), ("x",), ("u", "s")),
        Map(cg.Graph([s, y], {"z": y * y + s}), ("u",), ("z",), shared=("s",)),
        Sum(cg.Graph([y], {"t": 2.0 * y}), ("z",), ("t",)),
    ]
    program = Program({"x": 2, "u": 2, "z": 2, "s": 1, "t": 1}, body, record=["z", "x", "t"])
    run, values = runner(program, backend), np.random.default_rng(0).normal(size=(131, 2))
    one, found = runner(program, "python"), run.run(run.memory({"x": values.T}, 131), 1).rows[0].T
    by_pass = np.empty((5, 131))
    run.columns("x")[1](values.T, by_pass)
    assert np.array_equal(found, by_pass.T)
    expected = [one.run(one.memory({"x": value}), 1).rows[0] for value in values]
    assert found == pytest.approx(np.array(expected), rel=1e-13)


def test_a_listing_tells_loops_branches_and_what_a_statement_reads_before_it_writes() -> None:
    a, b = cg.variables("a b")
    swap, long = cg.Graph([a, b], {"p": b, "q": a}), cg.Graph([a], {"o": sum([cg.sin(a * k) for k in range(1, 9)])})
    turn = (Call(swap, ("x", "y"), ("x", "y")), Call(ONE, ("n",), ("n",)))
    body = [While("n", (If("x", turn, (Map(long, ("v",), ("v",)),)),)), Factor("m", "v")]
    program = Program({"x": 1, "y": 1, "n": 1, "v": 2, "m": 4}, body, ["x"], record_if="y", stop="n")
    assert program.listing({"waves": long}).splitlines()[5:-2] == [
        "        if x > 0:",
        "            x, y = f1(x, y)  # 0 operations",
        "            n = -n",
        "        else:",
        "            v = waves(v) for each element  # 24 operations",
        "    m, v = Factor(m)",
    ]
