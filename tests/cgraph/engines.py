"""Engines: those that are installed, the numbers at which they are looked at, and the bits of evaluation."""

import itertools
import math
import random
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import cgraph as cg
from cgraph.core.node import apply
from cgraph.extend import Op

LLVM = pytest.param("llvm", marks=pytest.mark.skipif(find_spec("llvmlite") is None, reason="the native extra has it"))
ENGINES = ("python", "numpy", LLVM)
RUNNERS = ("python", LLVM)  # of programs
SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -3.0, 5e-324, -2.5e-310, 1e300, -1e300, 800.0, math.inf, -math.inf, math.nan)


def graph_of(op: Op) -> cg.Graph:
    inputs = cg.variables(["a", "b", "c"][: op.arity])
    return cg.Graph(inputs, {"y": apply(op, *inputs)})


def odd_graphs() -> dict[str, cg.Graph]:
    """Inputs that nothing uses, outputs that are one node, constants of every kind; nothing but an input; no inputs."""
    x, y, z = cg.variables("x y z")
    u, nan = x * y, cg.constant(math.inf) - cg.constant(math.inf)
    outputs = {"u": u, "again": u, "x": x, "twice": x, "inf": -math.inf, "zero": -0.0, "nan": nan, "sum": x - nan}
    outputs |= {"large": x * 1e308, "signed": x * -0.0, "small": x + 5e-324, "cube": (-x) ** 3.0, "part": -0.1 * x}
    outputs |= {f"n{k}": each for k, each in enumerate((0.0, 1.0, 0.1, 5e-324, 1e300, -2.5, 1e16, 2.0**127))}
    none = cg.Graph([], {"c": 1.5, "sine": cg.sin(cg.constant(0.3)), "nan": cg.log(cg.constant(-1.0))})
    return {"several": cg.Graph([z, y, x], outputs), "unused": cg.Graph([x, y], {"c": 3.0}), "none": none}


ODD_POINTS = {
    "several": ((3.0, 0.5, 7.0), (1.0, 3.0, 0.0), (-2.0, 3.0, -0.0), (9.0, math.nan, 2.5)),
    "unused": ((math.nan, 10.0),),
    "none": ((),),
}


def points_of(op: Op, count: int) -> list[tuple[float, ...]]:
    """Samples, so many points of the domain, and every combination of IEEE specials."""
    source = random.Random(op.name)
    drawn = [tuple(source.uniform(*interval) for interval in op.domain) for _ in range(count)]
    return [*op.samples, *drawn, *itertools.product(SPECIAL, repeat=op.arity)]


def evaluated(graph: cg.Graph, points: Sequence[Sequence[float]] | np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Rows of outputs at rows of inputs, on floats."""
    rows = [graph.evaluate(dict(zip(graph.input_names, map(float, point), strict=True))).values() for point in points]
    return np.array([[float(value) for value in row] for row in rows]).reshape(len(points), -1)
