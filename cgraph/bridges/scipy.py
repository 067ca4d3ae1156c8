"""`to_scipy`: a compiled graph of one output as a LowLevelCallable of SciPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..core.checks import GraphError
from ..program.functions.compiled import Compiled
from ..util.extras import required
from .translation import require_compiled

if TYPE_CHECKING:
    from scipy import LowLevelCallable


def to_scipy(fn: Compiled) -> LowLevelCallable:
    """The compiled graph as a scipy.LowLevelCallable, which SciPy's integrals call without returning to Python.

    Its signature is `double (int n, double *x)`, the output at the n inputs: that of `scipy.integrate.quad`, `dblquad`,
    `tplquad` and `nquad`. Their variables are the first inputs, in the order in which they give them, and their `args`
    the last ones. The result is NaN where SciPy gives another number of values than there are inputs.

    Parameters
    ----------
    fn : Compiled
        Of `cg.compile`, with machine code, of one output. What is returned keeps it alive.

    Returns
    -------
    scipy.LowLevelCallable
        To be handed on in place of a function.

    Raises
    ------
    TypeError
        For what is no compiled graph.
    GraphError
        For several outputs.
    RuntimeError
        For generated Python, which has no address.
    ImportError
        Without SciPy (extra `scipy`).

    Examples
    --------
    >>> import cgraph as cg
    >>> from scipy.integrate import quad
    >>> x, a = cg.variables("x a")
    >>> power = cg.to_scipy(cg.compile(cg.Graph([x, a], {"y": x**a})))
    >>> round(quad(power, 0.0, 1.0, args=(3.0,))[0], 12)
    0.25
    """
    require_compiled("to_scipy", fn)
    if fn.n_out != 1:
        raise GraphError(f"to_scipy takes one output, got {fn.n_out}: {', '.join(fn.graph.outputs)}")
    callable_of: LowLevelCallable = required("scipy", "to_scipy needs SciPy", "scipy").LowLevelCallable
    return callable_of(fn._c_entry.integrand)
