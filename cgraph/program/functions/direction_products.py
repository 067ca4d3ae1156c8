"""Products of a derivative with many directions at one point."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...core.evaluation import Array
from ...core.graph import Graph
from ...util.memory import aligned
from ...util.threads import write_batch
from ..fuse import applied
from ..program import Program
from ..runners.runner import Runner
from ..statements.call import Call
from .colored_matrix import Derivative, mend, product_statements

PANEL_NUMBERS = 2**22  # numbers in the rows of points and directions that are written at a time


class _Buffers(NamedTuple):
    """Buffers of one call at a time: memory of a point, directions and results in columns, how many, checks."""

    x: Any  # memory
    directions: Array
    results: Array
    asked: memoryview
    check: memoryview | None
    run: Callable[[], None]


class DirectionProducts:
    """Writer of products; any number of threads may call it at once.

    ready: makes a program ready to run.  block: directions at a time, in whole vectors.
    """

    def __init__(self, derivative: Derivative, ready: Callable[[Program], Runner], block: int) -> None:
        self._derivative, self._how = derivative, (ready, block)
        split = derivative.split
        sizes = {"x": len(split.primal.inputs), "p0": len(split.primal.outputs), "asked": 1}
        self._directions, self._results = (split.directions, block), (len(split.linear.outputs), block)
        checked = derivative.guarded is not None
        if checked:
            sizes["check0"] = block
        sizes |= {"s0": math.prod(self._directions), "y": math.prod(self._results)}
        body = product_statements(derivative, 0, "y", ("asked",), checked=checked)
        self._runner = ready(Program(sizes, body, ["y"]))
        self._free: list[_Buffers] = []  # pop and append are atomic

    def __call__(self, x: Array, directions: Array, result: Array) -> None:
        """The results, (k, results), along directions, (k, entries), at a point."""
        size = self._how[1]
        if len(directions) <= size:
            self._block(x, directions, result)
            return
        for start in range(0, len(directions), size):  # between blocks, Ctrl-C is heard
            self._block(x, directions[start : start + size], result[start : start + size])

    @cached_property
    def _beside(self) -> Runner:
        """Runner of a point and one direction, as one register, for many of these side by side."""
        (primal, linear), known = self._derivative.split, len(self._derivative.split.primal.outputs)
        inputs = [*primal.inputs, *linear.inputs[known:]]
        outputs = applied(linear, [*applied(primal, primal.inputs), *linear.inputs[known:]])
        whole = Graph(inputs, {f"{k}": node for k, node in enumerate(outputs)})
        registers = {"x": len(whole.inputs), "y": len(whole.outputs)}
        return self._how[0](Program(registers, [Call(whole, ("x",), ("y",))], ["y"]))

    def many(self, points: Array, directions: Array, results: Array, threads: int) -> None:
        """The results, (N, k, results), of N points, each along k directions of its own, (N, k, entries)."""
        count, n, width = directions.shape[1], points.shape[1], self._beside.program.registers["x"]
        size = max(1, PANEL_NUMBERS // (count * width))
        for start in range(0, len(points), size):
            here = slice(start, start + size)
            found = results[here].reshape(-1, results.shape[2])
            rows = np.empty((len(points[here]), count, width))
            rows[:, :, :n], rows[:, :, n:] = points[here, None], directions[here]
            write_batch(*self._beside._columns("x"), rows.reshape(-1, width).T, found.T, threads)
        if self._derivative.guarded is not None:
            mend(results, lambda at, found: self._guarded.many(points[at], directions[at], found, threads))

    def _block(self, x: Array, directions: Array, result: Array) -> None:
        try:
            buffers = self._free.pop()
        except IndexError:
            buffers = self._buffers()
        count = len(directions)
        buffers.x[:] = x
        buffers.directions[:, :count] = directions.T
        buffers.asked[0] = count
        buffers.run()
        result[...] = buffers.results[:, :count].T
        found = b"" if buffers.check is None else buffers.check[: 8 * count].tobytes()
        self._free.append(buffers)
        if found.count(0) < len(found):  # zeros, but NaN where a result is infinite or NaN
            self._guarded(x, directions, result)

    def _buffers(self) -> _Buffers:
        x, y = np.empty(self._runner.program.registers["x"]), aligned(math.prod(self._results))
        run, registers = self._runner._bind_pass(("x", x), ("y", y))
        s, check = registers["s0"].reshape(self._directions), registers.get("check0")
        found = None if check is None else check.data.cast("B")
        return _Buffers(x.data, s, y.reshape(self._results), registers["asked"].data, found, run)

    @cached_property
    def _guarded(self) -> DirectionProducts:
        """Products by the split in which zeros win, made at its first use."""
        return DirectionProducts(self._derivative.careful, *self._how)
