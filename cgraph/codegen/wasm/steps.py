"""Steps of explicit Runge-Kutta methods in WebAssembly, as texts for `translate`."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from ..explicit_method import Tableau, weighted_sum


class Embedded(Tableau, Protocol):
    """Explicit method with weights of an error estimate."""

    @property
    def error(self) -> tuple[tuple[float, ...], ...]:
        """A row of weights of h slope_k in an estimate of the error, the last for the slope at the end of the step."""

    @property
    def estimate(self) -> int:
        """q, where the estimate falls as h^q."""


class Layout(NamedTuple):
    """Layout of memory: inputs and states, t among the inputs, and at which byte the work space begins."""

    inputs: int
    states: int
    time: int | None
    at: int

    def slope(self, k: int) -> int:
        """The first byte of slope k."""
        return self.at + 8 * (self.inputs + k * self.states)


def equal_steps(name: str, method: Tableau, layout: Layout) -> ast.FunctionDef:
    """The function of (x, h, n): n steps of h from the state at x, which is the first of the inputs there."""
    body = [*_stages(method, layout), *_states(layout, f"store(x + i, {_ahead(method.b, layout)})")]
    body.append("count = count + 1.0")
    lines = ["count = 0.0", *_copied(layout)]
    if layout.time is not None:
        lines.append(f"start = load(x, {8 * layout.time})")
        body.append(f"store(x, start + count * h, {8 * layout.time})")
    return _function("def steps(x: i32, h, n) -> None:", [*lines, "while count < n:", *_indented(body)], name)


def chosen_steps(name: str, method: Embedded, layout: Layout) -> ast.FunctionDef:
    """The function of (x, span, h, rtol, atol, most): over the span by steps that an estimate of the error chooses.

    The root mean square over the state of error / (atol + rtol |x|) is at most 1. The next step is the last one times
    0.9 error^(-1/q), a fifth of it at least and five times at most, with a root that is right to some percent: bits of
    a double are nearly its logarithm. Returns the step to go on with, and NaN where `most` trials were not enough.
    """
    stages, q = len(method.b), method.estimate
    size = f"(atol + rtol * max(abs(load(x + i)), abs(load(i, {layout.at}))))"
    root = f"double({0x3FF0000000000000 * (q + 1) // q} - bits(e) // {q})"
    moved = _states(layout, f"store(x + i, load(i, {layout.at}))")
    if layout.time is not None:
        moved += [f"store(x, load(x, {8 * layout.time}) + h, {8 * layout.time})"]
    body = [
        "count = count + 1.0",
        "wanted = h",
        "h = min(h, left)",
        *_copied(layout),
        *_stages(method, layout),
        *_states(layout, f"store(i, {_ahead(method.b, layout)}, {layout.at})"),
        *_clock(layout, 1.0),
        f"evaluate({layout.at}, {layout.slope(stages)})",
        "e = 0.0",
        *_states(layout, f"r = h * ({_weighted(method.error[0], layout)}) / {size}", "e = e + r * r"),
        f"e = sqrt(e / {float(layout.states)!r})",
        f"next = h * min(5.0, max(0.2, 0.9 * {root})) if e < 1e300 else 0.1 * h",
        "if e <= 1.0:",
        *_indented([*moved, "left = left - h", "next = next if h == wanted else max(next, wanted)"]),
        "h = next",
    ]
    lines = ["left = span", "count = 0.0", "while (left > 0.0) & (count < most):", *_indented(body)]
    head = "def steps(x: i32, span, h, rtol, atol, most):"
    return _function(head, [*lines, "return h if left <= 0.0 else sqrt(-1.0)"], name)


def _function(head: str, lines: Sequence[str], name: str) -> ast.FunctionDef:
    (function,) = ast.parse("\n".join([head, *_indented(lines)])).body
    assert isinstance(function, ast.FunctionDef)
    function.name = name
    return function


def _stages(method: Tableau, layout: Layout) -> list[str]:
    """All slopes of a step h from x, with the inputs of a stage in the work space."""
    lines = [f"evaluate(x, {layout.slope(0)})"]
    for k in range(1, len(method.b)):
        lines += _states(layout, f"store(i, {_ahead(method.a[k], layout)}, {layout.at})")
        lines += [*_clock(layout, method.c[k]), f"evaluate({layout.at}, {layout.slope(k)})"]
    return lines


def _clock(layout: Layout, c: float) -> list[str]:
    """The time of a stage."""
    at = None if layout.time is None else 8 * layout.time
    return [] if at is None else [f"store({layout.at + at}, load(x, {at}) + {float(c)!r} * h)"]


def _copied(layout: Layout) -> list[str]:
    """The inputs at x, into the work space."""
    return _loop(8 * layout.inputs, f"store(i, load(x + i), {layout.at})")


def _states(layout: Layout, *lines: str) -> list[str]:
    """The lines for each state, i its place."""
    return _loop(8 * layout.states, *lines)


def _loop(end: int, *lines: str) -> list[str]:
    """The lines for i = 0, 8, .. below `end`."""
    return ["i = address(0)", f"while i < {end}:", *_indented([*lines, "i = i + 8"])]


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _ahead(weights: Sequence[float], layout: Layout) -> str:
    """x + h * (sum of weight * slope)."""
    return f"load(x + i) + h * ({_weighted(weights, layout)})"


def _weighted(weights: Sequence[float], layout: Layout) -> str:
    """The sum of weight * slope."""
    return weighted_sum(weights, repr, lambda k: f"load(i, {layout.slope(k)})")
