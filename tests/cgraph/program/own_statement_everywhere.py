"""What programs do with the statement `Turn` of docs/extending.md; run by `test_own_statement.py`, where it is known.

z -> f z, and u -> f* u where Re z > 0, n times; complex numbers in Python say what is right.
"""

from typing import Any

import numpy as np
import pytest

import cgraph as cg
from cgraph._shared import Array
from cgraph.extend import STATEMENTS, Call, If, Program, While, program_jvp, program_vjp, runner
from tests.cgraph.engines import RUNNERS
from tests.tolerances import SHORT_SUM

COUNT, PASSES, LENGTHS = 11, 4, {"f": 2, "z": 2, "u": 2, "n": 1, "c": 1}
(Turn,) = [kind for kind in STATEMENTS if kind.__name__ == "Turn"]
START: dict[str, Array] = {
    name: np.random.default_rng(5).normal(size=(LENGTHS[name], COUNT)) for name in ("f", "z", "u")
} | {"n": np.arange(COUNT)[None] % 5 * 1.0}


def program(loop: type[If | While] = If) -> Program:
    """In a loop once, or in a branch as many times as a pass is run."""
    a, b, n = cg.variables("a b n")
    less = Call(cg.Graph([n], {"n": n - 1.0}), ("n",), ("n",))
    real = Call(cg.Graph([a, b], {"c": a}), ("z",), ("c",))
    turns: Any = (real, If("c", (Turn("f", "u", back=True),)), Turn("f", "z"), less)
    return Program(LENGTHS, [loop("n", turns)], record=["z", "u"])


def expected(f: complex, z: complex, u: complex, n: float) -> tuple[complex, complex, list[bool]]:
    ways = []
    for _ in range(int(n)):
        ways.append(z.real > 0.0)
        u, z = (f.conjugate() * u if ways[-1] else u), f * z
    return z, u, ways


def numbers(k: int) -> tuple[complex, complex, complex, float]:
    f, z, u = (complex(*START[name][:, k]) for name in ("f", "z", "u"))
    return f, z, u, float(START["n"][0, k])


def pairs(*values: complex) -> list[float]:
    return [part for value in values for part in (value.real, value.imag)]


def one(values: dict[str, Array], k: int) -> dict[str, Array]:
    return {name: value[:, k] for name, value in values.items()}


@pytest.mark.parametrize("backend", RUNNERS)
def test_its_numbers_alone_and_side_by_side(backend: str) -> None:
    ready = runner(program(While), backend, fma=False)
    together = ready.run(ready.memory(START, COUNT), 1).rows[0]
    for k in range(COUNT):
        alone = ready.run(ready.memory(one(START, k)), 1).rows[0]
        assert alone == pytest.approx(pairs(*expected(*numbers(k))[:2]), rel=SHORT_SUM, abs=SHORT_SUM)
        assert alone.tolist() == together[:, k].tolist()


@pytest.mark.parametrize("backend", RUNNERS)
def test_its_tangents(backend: str) -> None:
    """z_n = f^n z, u_n = f*^m u: their tangents by the product rule."""
    moved, rng = program_jvp(program(), ["f"], constant=["n", "c"]), np.random.default_rng(6)
    dots = {name: rng.normal(size=(2, COUNT)) for name in ("f", "z", "u")}
    ready = runner(moved.program, backend, fma=False)
    values = START | {moved.vectors[name]: dot for name, dot in dots.items()}
    together = ready.run(ready.memory(values, COUNT), PASSES).rows[-1]
    for k in range(COUNT):
        row = ready.run(ready.memory(one(values, k)), PASSES).rows[-1]
        assert row.tolist() == together[:, k].tolist()
        f, z, u, n = numbers(k)
        *ends, ways = expected(f, z, u, n)
        f_dot, z_dot, u_dot = (complex(*dots[name][:, k]) for name in ("f", "z", "u"))
        g, m = f.conjugate(), sum(ways)
        wanted = n * f ** (n - 1) * f_dot * z + f**n * z_dot, m * g ** (m - 1) * f_dot.conjugate() * u + g**m * u_dot
        assert row == pytest.approx(pairs(*ends, *wanted), rel=1e3 * SHORT_SUM, abs=1e3 * SHORT_SUM)


@pytest.mark.parametrize("backend", RUNNERS)
def test_its_cotangents_are_the_transpose(backend: str) -> None:
    """<w, J v> = <J^T w, v>."""
    moved, rng = program_jvp(program(), ["f"], constant=["n", "c"]), np.random.default_rng(7)
    pull = program_vjp(program(), ["z", "u"], ["f"], constant=["n", "c"], backend=backend)
    forward = runner(moved.program, backend)
    for k in range(COUNT):
        along, weights = ({name: rng.normal(size=2) for name in names} for names in (("f", "z", "u"), ("z", "u")))
        memory = forward.memory(one(START, k) | {moved.vectors[name]: dot for name, dot in along.items()})
        pushed = forward.run(memory, PASSES).rows[-1, 4:]
        _, bars = pull(one(START, k), PASSES, weights)
        left = float(np.concatenate(list(weights.values())) @ pushed)
        right = sum(float(bars[name] @ dot) for name, dot in along.items())
        assert left == pytest.approx(right, rel=1e3 * SHORT_SUM, abs=1e3 * SHORT_SUM)


def test_registers_that_do_not_fit_are_told() -> None:
    turn: Any = Turn("f", "n")
    with pytest.raises(cg.GraphError, match="Turn needs register 'n' to have length 2, got 1"):
        Program(LENGTHS, [turn], record=[])
