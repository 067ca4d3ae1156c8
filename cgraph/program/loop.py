"""Loop: one graph repeated on its own carry, such as a step of a fixed-step integrator."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..core.evaluate import Array
from ..core.graph import Graph
from ..core.node import CONSTANT, Node, variable
from ..core.traversal import rebuild, topological
from ..errors import GraphError
from ..util.real_arrays import real_array
from .program import Call, Program
from .runner import runner


class Loop:
    """A graph that runs on its own results, see `loop`.

    graph: one pass.  carry: {input: the output that follows}.  before: what depends on inputs that hold their values
    alone, which is computed once before the first pass; None where there is nothing of the kind.
    """

    def __init__(self, graph: Graph, carry: Mapping[str, str], backend: str, *, fast: bool, fma: bool) -> None:
        for name in carry:
            graph.select_inputs(name)
        if missing := [name for name in carry.values() if name not in graph.outputs]:
            raise GraphError(f"the graph has no output {', '.join(missing)} (it has {', '.join(graph.outputs)})")
        if not carry:
            raise GraphError("a loop needs at least one input that an output follows, {input: output}")
        self.graph, self.carry = graph, dict(carry)
        self._moving = [graph.input_names.index(name) for name in carry]
        self._held = [k for k, name in enumerate(graph.input_names) if name not in carry]
        moving, held = ([graph.inputs[k] for k in chosen] for chosen in (self._moving, self._held))
        wanted = [graph.outputs[carry[name]] for name in carry]
        self.before, still = _still(wanted, held)
        new = rebuild(wanted, still, lambda n, args: Node(n.op, args, n.label, name=n.name))
        one_pass = Graph(
            [*moving, *held, *still.values()], dict(zip(carry, [new[node] for node in wanted], strict=True))
        )
        registers = {"carry": len(moving), "held": len(held), "still": len(still)}
        program = Program(registers, [Call(one_pass, ("carry", "held", "still"), ("carry",))], record=["carry"])
        self._runner = runner(program, backend, fast=fast, fma=fma)

    def __call__(self, x: ArrayLike, passes: int, every: int = 1) -> Array:
        """The carry after each `every`th pass, (passes // every, carried), from the inputs x (n_in,).

        Raises GraphError for another shape of x, or `passes` or `every` out of range.
        """
        return self._runner.run(self._memory(x, 1), passes, every).rows

    def batch(self, X: ArrayLike, passes: int, every: int = 1) -> Array:
        """As a call, for N starts X (n_in, N) side by side: (passes // every, carried, N)."""
        return self._runner.run_many(self._memory(X, 2), passes, every).rows

    def _memory(self, x: ArrayLike, dimensions: int) -> Array:
        given = real_array("x", x)
        count = len(self.graph.inputs)
        if given.ndim != dimensions or given.shape[0] != count:
            wanted = f"({count},)" if dimensions == 1 else f"({count}, N)"
            raise GraphError(f"x must have shape {wanted}, one row for each input, got {given.shape}")
        registers = {"carry": given[self._moving], "held": given[self._held]}
        if self.before is not None:
            values = self.before.evaluate(dict(zip(self.before.input_names, given[self._held], strict=True)))
            registers["still"] = np.array(list(values.values()))
        return self._runner.memory(registers, None if dimensions == 1 else given.shape[1])


def _still(outputs: Sequence[Node], held: Sequence[Node]) -> tuple[Graph | None, dict[Node, Node]]:
    """What the outputs need of operations on `held` alone: as a graph, and a variable to stand for each."""
    nodes = topological(outputs)
    constant = {node for node in nodes if node.op is CONSTANT}
    fixed = constant | set(held)
    for node in nodes:
        if node.args and fixed.issuperset(node.args):
            fixed.add(node)
    used = [arg for node in nodes if node not in fixed for arg in node.args] + list(outputs)
    taken = {node.name for node in nodes}
    names = (name for name in (f"still{k}" for k in itertools.count()) if name not in taken)
    found = [node for node in dict.fromkeys(used) if node in fixed and node.args]
    if not found:
        return None, {}
    return Graph(held, {f"{k}": node for k, node in enumerate(found)}), {node: variable(next(names)) for node in found}


def loop(
    graph: Graph, carry: Mapping[str, str], backend: str = "auto", *, fast: bool = False, fma: bool = True
) -> Loop:
    """A function that repeats the graph on its own carry without returning to Python.

    carry: {input: output}: after each pass the input takes the output's value; other inputs hold theirs.
    `loop(x, passes, every)` gives the carry after each `every`th pass. backend: "llvm", "python" or "auto" (machine
    code where llvmlite is installed); fast, fma: see `compile`.

    Raises GraphError for an input or output that the graph does not have.

    >>> x, v, h = cg.variables("x v h")
    >>> spring = cg.Graph([x, v, h], {"x_next": x + h * v, "v_next": v - h * (x + h * v)})
    >>> turns = cg.loop(spring, {"x": "x_next", "v": "v_next"})([1.0, 0.0, 1e-3], passes=6283, every=100)
    """
    return Loop(graph, carry, backend, fast=fast, fma=fma)
