"""`to_jax` and `as_jax`: a graph as operations of JAX, and a compiled graph called from within JAX."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..autodiff.jacobian import jacobian
from ..core.evaluation import Array
from ..core.graph import Graph
from ..operations.operation import columns
from ..program.functions.compiled import Compiled
from ..util.extras import required
from ..util.require import require_graph
from .translation import Operations, derived, operations, require_compiled, require_inputs, translated, values_at

if TYPE_CHECKING:
    from jax import Array as JaxArray

Function = Callable[["JaxArray"], "JaxArray"]


def to_jax(graph: Graph) -> Function:
    """The graph as a function of JAX, an operation each: `jit`, `vmap`, `grad`, `jvp` go through it.

    It computes in the numbers of x, float32 unless JAX is told otherwise, `jax.config.update("jax_enable_x64", True)`.
    Derivatives are JAX's: an infinite slope of a branch that is not taken makes them NaN. Those of this library, in
    which it counts for nothing, are graphs as well: `to_jax(cg.gradient(graph))`.

    Parameters
    ----------
    graph : Graph
        What the function computes; inputs and outputs are in the order of the graph's.

    Returns
    -------
    callable
        (n_in,) -> (n_out,), and (..., n_in) -> (..., n_out).

    Raises
    ------
    TypeError
        For what is no Graph.
    GraphError
        For an operation of your own that says nothing of JAX; by the function, for x of another shape.
    ImportError
        Without JAX (extra `jax`).

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> area = cg.to_jax(cg.Graph([x, y], {"area": x * y}))
    >>> import jax
    >>> jax.jacobian(area)(jax.numpy.array([2.0, 3.0])).tolist()
    [[3.0, 2.0]]
    """
    require_graph("to_jax", graph)
    jax = required("jax", "to_jax needs JAX", "jax")
    jnp, function_of = jax.numpy, jax_operations(jax)
    for node in graph.nodes:
        if node.args:
            function_of(columns(node.op))  # an operation that JAX does not have is told now

    def function(x: JaxArray) -> JaxArray:
        x = jnp.asarray(x)
        if not jnp.issubdtype(x.dtype, jnp.floating):
            x = x.astype(float)
        require_inputs(x.shape, len(graph.inputs))
        env = {node: x[..., k] for k, node in enumerate(graph.inputs)}
        smallest = float(jnp.finfo(x.dtype).tiny)  # in place of constants that would be 0 in these numbers
        number = lambda value: float(np.copysign(max(abs(value), smallest), value)) if value else 0.0  # noqa: E731
        values = translated(graph.nodes, env, function_of, number)
        results = [jnp.asarray(values[node], x.dtype) for node in graph.outputs.values()]
        return jnp.stack([jnp.broadcast_to(each, x.shape[:-1]) for each in results], axis=-1)

    return function


def as_jax(fn: Compiled) -> Function:
    """The compiled graph as a function within JAX, which calls its machine code: nothing is traced or compiled anew.

    `jit`, `vmap` and further axes in front call it for all points at once. The derivatives, forward and reverse and of
    any order, are its Jacobian, `fn.jacobian`, and the compiled Jacobians of that. Threads of XLA take subnormal
    numbers for 0, so results differ there: log(1e-310) is -745, for -714.

    Parameters
    ----------
    fn : Compiled
        Of `cg.compile`; what JAX calls keeps it alive.

    Returns
    -------
    callable
        (n_in,) -> (n_out,), and (..., n_in) -> (..., n_out), in float64, on the CPU.

    Raises
    ------
    TypeError
        For what is no compiled graph; by the function, for numbers other than float64.
    GraphError
        By the function, for x of another shape.
    ImportError
        Without JAX (extra `jax`).

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> area = cg.as_jax(cg.compile(cg.Graph([x, y], {"area": x * y})))
    >>> import jax
    >>> jax.config.update("jax_enable_x64", True)
    >>> jax.jacobian(area)(jax.numpy.array([2.0, 3.0])).tolist()
    [[3.0, 2.0]]
    """
    require_compiled("as_jax", fn)
    jax = required("jax", "as_jax needs JAX", "jax")
    called = _Called(jax, fn, (fn.n_out,)).function

    def function(x: JaxArray) -> JaxArray:
        x = jax.numpy.asarray(x)
        if x.dtype != np.float64:
            raise TypeError(
                f"as_jax calls machine code for float64, got {x.dtype}: "
                'begin with jax.config.update("jax_enable_x64", True), and give floats'
            )
        require_inputs(x.shape, fn.n_in)
        return called(x)

    return function


class _Called:
    """A compiled graph within JAX: x, (..., n), to its outputs in some shape, or with `slopes` to their Jacobian."""

    def __init__(self, jax: ModuleType, fn: Compiled, outputs: tuple[int, ...], *, slopes: bool = False) -> None:
        self._jax, self._fn, self._slopes = jax, fn, slopes
        self._shape = (*outputs, fn.n_in) if slopes else outputs
        for shape in ((fn.n_in,), (1, fn.n_in)):  # makes all code now: threads of XLA flush subnormal numbers
            self._at(np.full(shape, np.nan))

    def _at(self, x: object) -> Array:
        points = np.asarray(x)
        if not self._slopes:
            return values_at(self._fn, points)
        found: Array = self._fn.jacobian(points.reshape(-1, self._fn.n_in))
        return found.reshape(*points.shape[:-1], *self._shape)

    @cached_property
    def slope(self) -> _Called:
        """The derivative, made when it is first traced."""
        fn = derived(self._fn, jacobian) if self._slopes else self._fn
        return _Called(self._jax, fn, self._shape, slopes=True)

    @cached_property
    def function(self) -> Function:
        """What JAX calls."""
        jax, alone = self._jax, [1] * len(self._shape)

        def call(x: JaxArray) -> JaxArray:
            result = jax.ShapeDtypeStruct((*x.shape[:-1], *self._shape), np.float64)
            return jax.pure_callback(self._at, result, x, vmap_method="broadcast_all")

        function: Any = jax.custom_jvp(call)

        @function.defjvp  # type: ignore[untyped-decorator]
        def along(primals: tuple[JaxArray], tangents: tuple[JaxArray]) -> tuple[JaxArray, JaxArray]:
            (x,), (x_dot,) = primals, tangents
            direction = x_dot.reshape(*x.shape[:-1], *alone, x.shape[-1])
            return function(x), (self.slope.function(x) * direction).sum(axis=-1)

        return function  # type: ignore[no-any-return]


def jax_operations(jax: ModuleType) -> Operations:
    """JAX's functions of our operations, where it has them under another name or in other words."""
    jnp = jax.numpy

    @jax.custom_jvp  # type: ignore[untyped-decorator]
    def zero_safe_mul(a: Any, b: Any) -> Any:
        return jnp.where((a == 0) | (b == 0), 0.0, a * b)

    @zero_safe_mul.defjvp  # type: ignore[untyped-decorator]
    def along(primals: tuple[Any, Any], tangents: tuple[Any, Any]) -> tuple[Any, Any]:
        (a, b), (a_dot, b_dot) = primals, tangents
        return zero_safe_mul(a, b), b * a_dot + a * b_dot

    table = {
        "equal": lambda a, b: (a == b) * 1.0,
        "less": lambda a, b: (a < b) * 1.0,
        "less_equal": lambda a, b: (a <= b) * 1.0,
        "not_equal": lambda a, b: (a != b) * 1.0,
        "where": lambda condition, a, b: jnp.where(condition != 0, a, b),
        "zero_safe_mul": zero_safe_mul,
    }
    return operations("JAX", (jnp, jax.scipy.special), table)
