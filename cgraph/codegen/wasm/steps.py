"""Steps of explicit Runge-Kutta methods in WebAssembly, as texts for `translate`."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Protocol


class Tableau(Protocol):
    """The numbers of an explicit Runge-Kutta method, as `dynamics.integrators.Tableau` has them."""

    @property
    def c(self) -> tuple[float, ...]:
        """Times of the stages, the first 0."""

    @property
    def a(self) -> tuple[tuple[float, ...], ...]:
        """Row k the weights of the slopes before stage k."""

    @property
    def b(self) -> tuple[float, ...]:
        """Weights of the slopes in the step."""


def work(inputs: int, states: int, stages: int) -> int:
    """Bytes that the steps need: the inputs of a stage, and the slopes."""
    return 8 * (inputs + stages * states)


def steps(name: str, method: Tableau, inputs: int, states: int, time: int | None, at: int) -> ast.FunctionDef:
    """The function of (x, h, n): n steps of h from the state at x, which is the first of the inputs there.

    time: the place of t among the inputs.  at: the place of the work space in memory.
    """
    slopes = [at + 8 * (inputs + k * states) for k in range(len(method.b))]
    lines = [
        *_loop(8 * inputs, f"store(i, load(x + i), {at})"),
        *([] if time is None else [f"start = load(x, {8 * time})"]),
    ]
    body = ["evaluate(x, " + f"{slopes[0]})"]
    for k in range(1, len(slopes)):
        body += _loop(8 * states, f"store(i, load(x + i) + h * ({_weighted(method.a[k], slopes)}), {at})")
        if time is not None:
            body.append(f"store({at + 8 * time}, load(x, {8 * time}) + {float(method.c[k])!r} * h)")
        body.append(f"evaluate({at}, {slopes[k]})")
    body += _loop(8 * states, f"store(x + i, load(x + i) + h * ({_weighted(method.b, slopes)}))")
    body.append("count = count + 1.0")
    if time is not None:
        body.append(f"store(x, start + count * h, {8 * time})")
    lines += ["count = 0.0", "while count < n:", *[f"    {line}" for line in body]]
    (function,) = ast.parse("\n    ".join(["def steps(x: i32, h, n) -> None:", *lines])).body
    assert isinstance(function, ast.FunctionDef)
    function.name = name
    return function


def _loop(end: int, line: str) -> list[str]:
    """The line for i = 0, 8, .. below `end`."""
    return ["i = address(0)", f"while i < {end}:", f"    {line}", "    i = i + 8"]


def _weighted(weights: Sequence[float], slopes: Sequence[int]) -> str:
    """The sum of weight * slope, in the order of `dynamics`, without those of weight 0."""
    used = [(float(weight), at) for weight, at in zip(weights, slopes, strict=False) if weight]
    return " + ".join([f"load(i, {at})" if weight == 1.0 else f"{weight!r} * load(i, {at})" for weight, at in used])
