"""cgraph: computational graphs of equations, with forward and reverse automatic differentiation."""

from .autodiff.forward import jvp
from .autodiff.hessian_solve import hessian_solve
from .autodiff.jacobian import hessian, jacobian
from .autodiff.reverse import gradient, vjp
from .codegen import Compiled, clear_cache, compile
from .codegen.c import CSource, to_c
from .core.counts import Counts
from .core.graph import Graph
from .core.label import tag
from .core.node import Edge, Node, constant, named, variable, variables
from .core.ops import (
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
from .core.source_lines import recording_lines
from .core.structure_hash import structure_hash
from .errors import GraphError
from .explain import Diff, Lint, Why, WhyNot, diff, lint, why, why_not
from .program import Loop, loop
from .simplify.double_double import double_double
from .simplify.simplify import simplify, specialize

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
    "to_c",
    "variable",
    "variables",
    "vjp",
    "where",
    "why",
    "why_not",
]
