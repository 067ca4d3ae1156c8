"""cgraph: computational graphs of equations, with forward and reverse automatic differentiation."""

from .c import CSource
from .codegen import Compiled, clear_cache, compile
from .counts import Counts
from .double_double import double_double
from .errors import GraphError
from .explain import Diff, Lint, Why, WhyNot, diff, lint, why, why_not
from .forward import jvp
from .graph import Graph
from .hessian_solve import hessian_solve
from .jacobian import hessian, jacobian
from .label import tag
from .node import Edge, Node, constant, named, variable, variables
from .ops import (
    abs_ as abs,
    acos,
    asin,
    atan,
    atan2,
    cos,
    cosh,
    equal,
    exp,
    expm1,
    hypot,
    less,
    less_equal,
    log,
    log1p,
    maximum,
    minimum,
    not_equal,
    pow,
    sign,
    sin,
    sinh,
    sqrt,
    tan,
    tanh,
    where,
)
from .program import Loop, loop
from .reverse import gradient, vjp
from .simplify import simplify, specialize
from .source_lines import recording_lines
from .structure_hash import structure_hash

__all__ = [
    "CSource",
    "Compiled",
    "Counts",
    "Diff",
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
    "clear_cache",
    "compile",
    "constant",
    "cos",
    "cosh",
    "diff",
    "double_double",
    "equal",
    "exp",
    "expm1",
    "gradient",
    "hessian",
    "hessian_solve",
    "hypot",
    "jacobian",
    "jvp",
    "less",
    "less_equal",
    "lint",
    "log",
    "log1p",
    "loop",
    "maximum",
    "minimum",
    "named",
    "not_equal",
    "pow",
    "recording_lines",
    "sign",
    "simplify",
    "sin",
    "sinh",
    "specialize",
    "sqrt",
    "structure_hash",
    "tag",
    "tan",
    "tanh",
    "variable",
    "variables",
    "vjp",
    "where",
    "why",
    "why_not",
]
