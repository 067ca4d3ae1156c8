"""A graph repeated on its own results: a program of one call."""

from collections.abc import Callable, Mapping

import numpy as np

from cgraph import Graph
from cgraph._shared import Array
from cgraph.extend import Call, Program, runner


def repeated(
    graph: Graph, carry: Mapping[str, str], backend: str = "auto", *, fma: bool = True
) -> Callable[..., Array]:
    """A function of x (n,), or (n, N), passes, every: the rows of what is carried, {input: the output it becomes}."""
    held = [name for name in graph.input_names if name not in carry]
    inputs = dict(zip(graph.input_names, graph.inputs, strict=True))
    step = Graph([inputs[name] for name in (*carry, *held)], {name: graph.outputs[carry[name]] for name in carry})
    body = [Call(step, ("carried", "held"), ("carried",))]
    ready = runner(Program({"carried": len(carry), "held": len(held)}, body, ["carried"]), backend, fma=fma)

    def run(x: Array, passes: int, every: int = 1) -> Array:
        values = np.asarray(x, dtype=float)
        places = {"carried": [*map(graph.input_names.index, carry)], "held": [*map(graph.input_names.index, held)]}
        memory = ready.memory({name: values[at] for name, at in places.items()}, *values.shape[1:])
        return ready.run(memory, passes, every).rows

    return run
