"""Loop: one graph repeated on its own results, such as a step of a fixed-step integrator."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ..autodiff.direction_split import direction_split
from ..core.checks import GraphError
from ..core.evaluation import Array, real_array
from ..core.graph import Graph
from ..core.node import Node
from ..core.traversal import topological
from ..util.require import require_graph, require_mapping, require_sequence
from .program import Program
from .runners.native_runner import runner
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
        The operations on constant inputs alone, which are computed once before the first pass; None without any.

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
        moving, held = ([graph.inputs[k] for k in places] for places in (self._moving, self._held))
        outputs = {name: graph.outputs[carry[name]] for name in carry}
        self._split = split = direction_split(Graph([*held, *moving], outputs), len(moving))
        program = Program(
            {"carry": len(moving), "held": len(split.primal.outputs)},
            [Call(split.linear, ("held", "carry"), ("carry",))],
            record=["carry"],
        )
        self._runner = runner(program, backend, fast=fast, fma=fma)
        self._runner.run(self._runner.memory({}), 0)  # makes the code that a call runs

    @property
    def invariants(self) -> Graph | None:
        """What is computed before the first pass."""
        outputs = {name: node for name, node in self._split.primal.outputs.items() if node.args}
        reached = set(topological(list(outputs.values())))
        return Graph([node for node in self._split.primal.inputs if node in reached], outputs) if outputs else None

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
        memory = self._runner.memory({"carry": values[self._moving]}, None if dimensions == 1 else values.shape[1])
        if self._held:
            held, register = values[self._held], self._runner.read(memory, "held")
            named = zip(self._split.primal.input_names, held.tolist() if dimensions == 1 else held, strict=True)
            for k, numbers in enumerate(self._split.primal.evaluate(dict(named)).values()):
                register[k] = numbers
        return memory


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
