"""cgraph: computational graphs of equations, with forward and reverse automatic differentiation."""

from typing import TYPE_CHECKING

from .autodiff.forward import jvp
from .autodiff.hessian_solve import hessian_solve
from .autodiff.jacobian import hessian, jacobian
from .autodiff.reverse import gradient, vjp
from .autodiff.sparsity import sparsity
from .codegen import Compiled, clear_cache, compile
from .codegen.c import CSource, to_c
from .codegen.wasm import to_wasm
from .core.counts import Counts
from .core.edge import Edge
from .core.graph import Graph
from .core.latex import latex
from .core.naming import variables, with_name
from .core.node import Node, constant, variable
from .core.ops import (
    abs_ as abs,
    acos,
    asin,
    atan,
    atan2,
    cbrt,
    ceil,
    cos,
    cosh,
    equal,
    erf,
    erfc,
    exp,
    exp2,
    expm1,
    floor,
    fmod,
    hypot,
    less,
    less_equal,
    log,
    log1p,
    log2,
    log10,
    logistic,
    maximum,
    minimum,
    not_equal,
    pow,
    round_ as round,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from .core.scope import tag
from .core.source_lines import recording_lines
from .core.structure_hash import structure_hash
from .errors import GraphError
from .explain import Comparison, Lint, Why, WhyNot, compare, lint, why, why_not
from .program import Loop, loop
from .simplify.balanced_sums import balanced_sums
from .simplify.double_double import double_double
from .simplify.simplify import simplify, specialize
from .util.version import __version__ as __version__

__all__ = [
    "CSource",
    "Comparison",
    "Compiled",
    "Counts",
    "Edge",
    "Graph",
    "GraphError",
    "Lint",
    "Loop",
    "Node",
    "Why",
    "WhyNot",
    "abs",
    "acos",
    "asin",
    "atan",
    "atan2",
    "balanced_sums",
    "cbrt",
    "ceil",
    "clear_cache",
    "compare",
    "compile",
    "constant",
    "cos",
    "cosh",
    "double_double",
    "equal",
    "erf",
    "erfc",
    "exp",
    "exp2",
    "expm1",
    "floor",
    "fmod",
    "gradient",
    "hessian",
    "hessian_solve",
    "hypot",
    "jacobian",
    "jvp",
    "latex",
    "less",
    "less_equal",
    "lint",
    "log",
    "log1p",
    "log2",
    "log10",
    "logistic",
    "loop",
    "maximum",
    "minimum",
    "not_equal",
    "pow",
    "recording_lines",
    "round",
    "sign",
    "simplify",
    "sin",
    "sinh",
    "sparsity",
    "specialize",
    "sqrt",
    "structure_hash",
    "tag",
    "tan",
    "tanh",
    "to_c",
    "to_wasm",
    "variable",
    "variables",
    "vjp",
    "where",
    "why",
    "why_not",
    "with_name",
]

if not TYPE_CHECKING:  # `cg.name` of a row that was added; a checker shall see a misspelt name
    from .core.function_factory import of_name as __getattr__  # noqa: F401
