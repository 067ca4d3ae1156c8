"""Rows of tables: laws on drawn trees, whose structure is numbers in registers, of each memory or shared by all."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import cgraph as cg
from cgraph.extend import Call, For, If, Map, Program, copied, program_jvp, program_vjp, runner
from tests.tolerances import EQUATIONS, LONG_SUM

ROOM, TABLES = 8, ("kind", "count", "own", "parent", "other", "one")
LENGTHS = dict.fromkeys(TABLES, ROOM) | {"count": 1, "v": 2 * ROOM, "p": ROOM, "w": 2 * ROOM, "e": 1}
OF = ("v", "w", "e")
A, B, C, D, P = cg.variables("a b c d p")
TURN = cg.Graph([A, B, C, D, P], {"x": cg.sin(A + C * P) + 0.5 * B, "y": 0.3 * A * D + P})
OUTWARD = For(  # in place, of three kinds, one of which adds, too, and one that reads a number twice
    (TURN, cg.Graph([C, D], {"x": 0.7 * C, "y": cg.cos(D), "e": C * D}), cg.Graph([A, P], {"x": A * P, "y": 1.0})),
    "kind", "count", ("own", "parent", "one"), ("p",), ("v", "e"), ((1, 0), (1, 1), (0, 2), (2, -1)),
    (((0, 2), (1, 2), (2, 1)), ((1, 2),), ((2, 1), (2, 1))), (((0, 2),),) * 3, ((), ((3, 1),), ()),
)  # fmt: skip
INWARD = For(
    (cg.Graph([A, B, C, D], {"x": A * C + D, "y": B + 0.1 * cg.sin(C)}),), "kind", "count", ("own", "parent"), ("v",),
    ("w",), ((1, 0), (0, 0), (1, 1)), (((0, 2), (1, 2)),), ((),), (((2, 2),),), backwards=True,
)  # fmt: skip
PAIRS = For(  # of bodies that may be the same
    (cg.Graph([A, B, C, D], {"e": A * D, "x": 0.2 * B * C, "y": A, "z": 0.1 * C, "u": B * D}),), "kind", "count",
    ("own", "other"), ("v",), ("e", "w"), ((0, 0), (0, 1), (1, -1), (2, 0), (2, 1)), (((0, 2), (1, 2)),), ((),),
    (((2, 1), (3, 2), (4, 2)),),
)  # fmt: skip
MIX = Map(cg.Graph([A, B], {"a": 0.5 * cg.sin(A) + 0.2 * B}), ("v", "w"), ("v",))
BODY = [MIX, OUTWARD, INWARD, If("count", (PAIRS, Call(cg.Graph([A], {"e": 0.9 * A}), ("e",), ("e",))))]
PROGRAM = Program(LENGTHS, BODY, record=OF)


def tree(seed: int) -> dict[str, Any]:
    """Tables of at most 7 bodies, each behind its parent, and of pairs of them; body 0 is the ground."""
    rng, rows = np.random.default_rng(seed), np.arange(ROOM) + 1
    places = {"parent": 2 * rng.integers(0, rows), "own": 2 * rows % (2 * ROOM), "one": rows % ROOM}
    n = int(rng.integers(3, ROOM)) if seed else 0
    return places | {"other": 2 * rng.integers(0, n + 1, 8), "kind": rng.integers(0, 3, ROOM), "count": n}


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_tangents_are_differences_and_cotangents_their_transpose(seed: int, shared: bool, backend: str) -> None:
    tables, rng, wrt, h = tree(seed), np.random.default_rng(seed), ["p"] * (seed % 2), 1e-5
    start, along, weights = ({name: rng.normal(size=LENGTHS[name]) for name in (*OF, "p")} for _ in range(3))
    along["p"] *= seed % 2  # else nothing moves some rows
    del weights["p"]
    program, given = (replace(PROGRAM, shared=tables), start) if shared else (PROGRAM, tables | start)
    moved, plain = program_jvp(program, wrt, constant=TABLES), runner(PROGRAM, "python")
    ready = runner(moved.program, backend)
    values = given | {moved.vectors[name]: along[name] for name in along if name in moved.vectors}
    many = {name: np.reshape(value, (-1, 1)) * np.ones(5) for name, value in values.items()}
    rows = ready.run(ready.memory(values), 3).rows
    assert ready.run(ready.memory(many, 5), 3).rows[:, :, 3] == pytest.approx(rows, rel=LONG_SUM, abs=LONG_SUM)
    there, ahead, behind = (
        plain.run(plain.memory(tables | {name: start[name] + step * along[name] for name in start}), 3).rows
        for step in (0.0, h, -h)
    )
    assert rows[:, : PROGRAM.width] == pytest.approx(there, rel=LONG_SUM, abs=LONG_SUM)
    assert rows[:, PROGRAM.width :] == pytest.approx((ahead - behind) / (2 * h), rel=1e-7, abs=1e-7)
    bars = program_vjp(program, OF, wrt, constant=TABLES, backend=backend)(given, 3, weights)[1]
    left = float(np.concatenate([*weights.values()]) @ rows[-1, PROGRAM.width :])
    right = sum([float(bar @ along[name]) for name, bar in bars.items()])
    assert left == pytest.approx(right, rel=EQUATIONS, abs=EQUATIONS)


def test_code_takes_the_numbers_that_shared_registers_have_today() -> None:
    body = [copied("x", "v"), copied(None, "w"), copied(None, "e"), *BODY]
    points = np.random.default_rng(5).normal(size=(16, 21))
    first, last = (Program(LENGTHS | {"x": 16}, body, ["w"], shared=tree(seed) | {"p": 0.3}) for seed in (1, 2))
    ready: Any = runner(first)
    assert ready.text("x") == runner(last).text("x")
    for numbers in (first.shared, last.shared):
        results = np.empty((2, *points.shape))
        for name, value in numbers.items():
            ready.shared[name][:] = value
        for k, each in enumerate((ready, runner(replace(first, shared=numbers), "python"))):
            each.columns("x")[1](points, results[k])
        assert results[0] == pytest.approx(results[1], rel=LONG_SUM, abs=LONG_SUM)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"count": 9}, "For has 9 rows by register 'count', and room for 8"),
        ({"kind": 3}, "For of 3 kinds is none of row 0"),
        ({"own": 15}, "reads 2 numbers that are not all in register 'v': row 0"),
        ({"own": 2}, "writes what another writes in register 'v': row 0"),
        ({"parent": [4, *[0] * 7]}, "reads what is not complete in register 'v': row 0"),
        ({"p": [1.0]}, "shared register 'p' needs shape"),
        ({"v": 0.0}, "register 'v' is written or fed"),
    ],
)
def test_rows_that_do_not_fit_are_told(change: dict[str, Any], said: str) -> None:
    with pytest.raises(cg.GraphError, match=said):
        replace(PROGRAM, shared=tree(3) | {"kind": 0, "count": 3, "parent": 0} | change)
