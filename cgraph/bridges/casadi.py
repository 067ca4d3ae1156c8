"""`to_casadi`: a graph as a function of CasADi."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..core.graph import Graph
from ..util.extras import required
from ..util.require import require_graph
from .translation import Operations, operations, translated

if TYPE_CHECKING:
    from casadi import Function

_LARGEST = 1.7976931348623157e308  # the largest number that is finite


def to_casadi(graph: Graph, name: str = "function") -> Function:
    """The graph as a casadi.Function of one vector x, the inputs, that gives one vector y, the outputs.

    Node for node, in scalars of CasADi (SX): derivatives, C code, maps and nonlinear programs are CasADi's from there
    on. Values are those of `evaluate` but for rounding of functions, and but for NaN in a minimum or maximum: CasADi's
    leaves it out. CasADi cancels in what it builds of the function, derivatives and calls with symbols, such as x - x.

    Parameters
    ----------
    graph : Graph
        What the function computes; inputs and outputs are in the order of the graph's.
    name : str
        Of the function: letters, digits and single underscores, a letter first.

    Returns
    -------
    casadi.Function
        (n_in,) -> (n_out,), its input called "x" and its output "y".

    Raises
    ------
    TypeError
        For what is no Graph.
    ValueError
        For a name that CasADi does not take.
    GraphError
        For an operation that CasADi does not have, `erfc`, or one of your own that says nothing of it.
    ImportError
        Without CasADi (extra `casadi`).

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> area = cg.Graph([x, y], {"area": x * y})
    >>> function = cg.to_casadi(area)
    >>> function([2.0, 3.0])
    DM(6)
    """
    require_graph("to_casadi", graph)
    ca = required("casadi", "to_casadi needs CasADi", "casadi")
    if not isinstance(name, str) or not ca.Function.check_name(name):
        raise ValueError(f"name must be letters, digits and single underscores, a letter first, got {name!r:.60}")
    x, simplifies = ca.SX.sym("x", len(graph.inputs)), ca.GlobalOptions.getSimplificationOnTheFly()
    env = dict(zip(graph.inputs, ca.vertsplit(x), strict=True))
    ca.GlobalOptions.setSimplificationOnTheFly(False)  # which takes x - x for 0 and (x + 1e16) - 1e16 for x
    try:
        values = translated(graph.nodes, env, casadi_operations(ca), ca.SX)
    finally:
        ca.GlobalOptions.setSimplificationOnTheFly(simplifies)
    y = ca.vertcat(*[values[node] for node in graph.outputs.values()])
    return ca.Function(name, [x], [y], ["x"], ["y"])


def casadi_operations(ca: ModuleType) -> Operations:
    """CasADi's functions of our operations, where it has them under another name or in other words."""

    def finite(a: Any) -> Any:
        return ca.fabs(a) <= _LARGEST

    def zero_safe_mul(a: Any, b: Any) -> Any:  # a * b, with its slopes, but where 0 meets what is not finite
        zero = ca.logic_or(ca.logic_and(a == 0, ca.logic_not(finite(b))), ca.logic_and(b == 0, ca.logic_not(finite(a))))
        return ca.if_else(zero, 0, a * b)

    def logistic(a: Any) -> Any:
        e = ca.exp(ca.if_else(a < 0, a, -a))  # at most 1; fabs has the slope 0 at 0
        return ca.if_else(a < 0, e, 1) / (1 + e)

    return operations(
        "CasADi",
        (ca,),
        {
            "abs": ca.fabs,
            "cbrt": lambda a: ca.sign(a) * ca.fabs(a) ** (1.0 / 3.0),
            "equal": lambda a, b: a == b,
            "exp2": lambda a: 2**a,
            "less": lambda a, b: a < b,
            "less_equal": lambda a, b: a <= b,
            "log2": lambda a: ca.log(a) / ca.log(2.0),
            "logistic": logistic,
            "maximum": ca.fmax,
            "minimum": ca.fmin,
            "not_equal": lambda a, b: a != b,
            "round": lambda a: a - ca.remainder(a, 1),  # the remainder from the next whole number, of two the even one
            "where": lambda condition, a, b: ca.if_else(condition != 0, a, b),
            "zero_safe_mul": zero_safe_mul,
        },
    )
