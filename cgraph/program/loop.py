"""Loop: one graph repeated on its own results, such as a step of a fixed-step integrator."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import GraphError
from ..core.evaluation import Array, real_array
from ..core.graph import Graph
from ..core.node import CONSTANT, Node, variable
from ..core.traversal import rebuild, topological
from ..util.require import require_graph, require_mapping, require_sequence
from .program import Program
from .runners.choose_runner import runner
from .statements.call import Call


class Loop:
    """A graph that is repeated on its own results; made by `loop`.

    Attributes
    ----------
    graph : Graph
        One pass.
    carry : dict of str to str
        {input: the output whose value it has in the next pass}.
    invariants : Graph or None
        The operations on constant inputs alone, which are computed once before the first pass.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> halve = cg.loop(cg.Graph([x], {"next": 0.5 * x}), {"x": "next"})
    >>> halve([8.0], passes=3).ravel().tolist()
    [4.0, 2.0, 1.0]
    """

    def __init__(self, graph: Graph, carry: Mapping[str, str], backend: str, *, fast: bool, fma: bool) -> None:
        inputs = require_mapping("carry", carry, "input: output")
        for name in require_sequence("carry", inputs, "inputs", (str, Node)):
            graph.select_inputs(name)
        if missing := [name for name in carry.values() if not isinstance(name, str) or name not in graph.outputs]:
            raise GraphError(
                f"the graph has no output {', '.join(map(str, missing))} (it has {', '.join(graph.outputs)})"
            )
        if not carry:
            raise GraphError("a loop needs at least one input that an output follows, {input: output}")
        self.graph, self.carry = graph, dict(carry)
        self._moving = [graph.input_names.index(name) for name in carry]
        self._held = [k for k, name in enumerate(graph.input_names) if name not in carry]
        moving, held = ([graph.inputs[k] for k in chosen] for chosen in (self._moving, self._held))
        wanted = [graph.outputs[carry[name]] for name in carry]
        self.invariants, stand_ins = _loop_invariants(wanted, held)
        self._fixed = [graph.input_names.index(name) for name in self.invariants.input_names] if self.invariants else []
        new = rebuild(wanted, stand_ins, lambda n, args: Node(n.op, args, n.label, name=n.name))
        one_pass = Graph(
            [*moving, *held, *stand_ins.values()], dict(zip(carry, [new[node] for node in wanted], strict=True))
        )
        registers = {"carry": len(moving), "held": len(held), "invariant": len(stand_ins)}
        program = Program(registers, [Call(one_pass, ("carry", "held", "invariant"), ("carry",))], record=["carry"])
        self._runner = runner(program, backend, fast=fast, fma=fma)
        self._runner.run(self._runner.memory({}), 0)  # makes the code that a call runs

    def __call__(self, x: ArrayLike, passes: int, every: int = 1) -> Array:
        """Run the passes from one start.

        Parameters
        ----------
        x : array_like, shape (n_in,)
            Values of the graph's inputs in the first pass.
        passes : int
            How many, at least 0.
        every : int
            Record the carried values after each `every`th pass.

        Returns
        -------
        ndarray, shape (passes // every, n_carry)
            The carried values, in the order of `carry`.

        Raises
        ------
        GraphError
            If x has another shape, or `passes` or `every` is out of range.
        """
        return self._runner.run(self._memory(x, 1), passes, every).rows

    def batch(self, X: ArrayLike, passes: int, every: int = 1) -> Array:
        """Run the passes from N starts at once: X (n_in, N) gives (passes // every, n_carry, N).

        The last axis counts the starts, as in `Compiled.batch`.
        """
        return self._runner.run(self._memory(X, 2), passes, every).rows

    def _memory(self, x: ArrayLike, dimensions: int) -> Array:
        values = real_array("x", x)
        count = len(self.graph.inputs)
        if values.ndim != dimensions or values.shape[0] != count:
            wanted = f"({count},)" if dimensions == 1 else f"({count}, N)"
            raise GraphError(f"x must have shape {wanted}, one row for each input, got {values.shape}")
        registers = {"carry": values[self._moving], "held": values[self._held]}
        if self.invariants is not None:
            fixed = values[self._fixed]
            held = dict(zip(self.invariants.input_names, fixed.tolist() if dimensions == 1 else fixed, strict=True))
            registers["invariant"] = np.array(list(self.invariants.evaluate(held).values()))
        return self._runner.memory(registers, None if dimensions == 1 else values.shape[1])


def _loop_invariants(outputs: Sequence[Node], held: Sequence[Node]) -> tuple[Graph | None, dict[Node, Node]]:
    """The operations on `held` alone that the outputs need: as a graph, and {operation: variable in its place}."""
    nodes = topological(outputs)
    constant = {node for node in nodes if node.op is CONSTANT}
    fixed = constant | set(held)
    for node in nodes:
        if node.args and fixed.issuperset(node.args):
            fixed.add(node)
    used = [arg for node in nodes if node not in fixed for arg in node.args] + list(outputs)
    taken = {node.name for node in nodes}
    names = (name for name in (f"invariant{k}" for k in itertools.count()) if name not in taken)
    invariants = [node for node in dict.fromkeys(used) if node in fixed and node.args]
    if not invariants:
        return None, {}
    reached = set(topological(invariants))
    graph = Graph([node for node in held if node in reached], {f"{k}": node for k, node in enumerate(invariants)})
    return graph, {node: variable(next(names)) for node in invariants}


def loop(
    graph: Graph, carry: Mapping[str, str], backend: str = "auto", *, fast: bool = False, fma: bool = True
) -> Loop:
    """A function that repeats a graph on its own results, without returning to Python in between.

    Parameters
    ----------
    graph : Graph
        One pass.
    carry : mapping of str to str
        {input: output}: after each pass the input takes the output's value. Other inputs keep theirs.
    backend : {"auto", "llvm", "python"}
        "llvm" is machine code (extra `native`); "auto" takes it where llvmlite is installed.
    fast, fma : bool
        Liberties with rounding, as in `compile`.

    Returns
    -------
    Loop
        `run(x, passes, every)` gives the carried values after each `every`th pass.

    Raises
    ------
    GraphError
        If the graph lacks an input or output of `carry`, or `carry` is empty.
    ValueError
        If the backend is unknown.
    ImportError
        If the backend is "llvm" and llvmlite is not installed.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, v, h = cg.variables("x v h")
    >>> spring = cg.Graph([x, v, h], {"x_next": x + h * v, "v_next": v - h * (x + h * v)})
    >>> run = cg.loop(spring, {"x": "x_next", "v": "v_next"})
    >>> run([1.0, 0.0, 0.5], passes=4, every=2).tolist()
    [[0.75, -0.875], [-0.203125, -0.9296875]]
    """
    require_graph("loop", graph)
    return Loop(graph, carry, backend, fast=fast, fma=fma)
