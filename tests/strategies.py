"""Hypothesis strategies: random expression graphs over every operation of the table, with values that stay finite."""

import math
from functools import cache
from typing import Any, NamedTuple

from hypothesis import settings, strategies as st

import cgraph as cg
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from tests import high_precision


def examples(count: int) -> int:
    """How many examples the profile tries of a property that deserves `count`: all in "full", a quarter by default."""
    return max(1, count * settings().max_examples // 100)


class Case(NamedTuple):
    """A graph and a point at which every node of it is finite."""

    graph: cg.Graph
    values: dict[str, float]


def numbers(low: float = -2.0, high: float = 2.0) -> st.SearchStrategy[float]:
    """Quarters, and floats of many digits; none so small that its square would underflow."""
    quarters = st.integers(math.ceil(low * 4), math.floor(high * 4)).map(lambda n: n / 4)
    return quarters | st.floats(low, high).map(lambda x: x if abs(x) > 1e-6 else 0.0)


NUMBERS = numbers()  # once: hypothesis looks through every strategy that is made
CONSTANTS = st.sampled_from((0.0, -0.0, 1.0, -1.0, 2.0, 0.5, -2.0, 3.0)) | numbers(-3.0, 3.0)
TAGS = st.sampled_from(("", "", "link 1", "link 2", "kinetic"))
INDEX = st.integers(0, 3) | st.integers(0, 99)  # counted from the newest, so that most of the graph is reached
CONSTANT_LISTS = st.lists(CONSTANTS, max_size=3)
STEP = st.tuples(st.sampled_from(tuple(OPS)), INDEX, INDEX, INDEX, TAGS)


@cache
def steps(size: int) -> st.SearchStrategy[list[Any]]:
    """That many steps, each an operation, three arguments and a tag."""
    return st.lists(STEP, min_size=size, max_size=size)


@st.composite
def cases(draw: st.DrawFn, max_operations: int = 20, max_outputs: int = 3) -> Case:
    """A random graph of 1 to 3 inputs, with sharing, constants and tags, and a point for it.

    An argument outside the operation's domain is first squeezed into it: middle + half width * sin(argument).
    """
    names = "xyz"[: draw(st.integers(1, 3))]
    values = {name: draw(NUMBERS) for name in names}
    pool = [(cg.variable(name), value) for name, value in values.items()]
    pool += [(cg.constant(c), c) for c in draw(CONSTANT_LISTS)]
    for name, i, j, k, tag in draw(steps(draw(st.integers(1, max_operations)))):
        chosen = [pool[-1 - each % len(pool)] for each in (i, j, k)]
        with cg.tag(*([tag] if tag else [])):
            if name == "where":
                chosen[0] = _node("less", chosen[0], chosen[1])
            arguments = [_into(*each, *domain) for each, domain in zip(chosen, OPS[name].domain, strict=False)]
            pool.append(_node(name, *arguments))
    last = pool[-draw(st.integers(1, max_outputs)) :]
    return Case(cg.Graph(cg.variables(list(names)), {f"f{i}": node for i, (node, _) in enumerate(last)}), values)


def _node(name: str, *arguments: tuple[Any, float]) -> tuple[cg.Node, float]:
    value = high_precision.OPERATIONS[name](*(high_precision.mpf(value) for _, value in arguments))
    return apply(OPS[name], *(node for node, _ in arguments)), float(value)


def _into(node: cg.Node, value: float, low: float, high: float) -> tuple[cg.Node, float]:
    if low <= value <= high:
        return node, value
    middle, half = (low + high) / 2, (high - low) / 2
    return middle + half * cg.sin(node), middle + half * math.sin(value)
