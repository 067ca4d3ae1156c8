"""cgraph: computational graphs of equations, with forward and reverse automatic differentiation."""

from .util.doors import doors
from .util.version import __version__ as __version__

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from .autodiff.hessian_solve import hessian_solve
    from .autodiff.jacobian import hessian, jacobian
    from .autodiff.products import gradient, jvp, vjp
    from .autodiff.sparsity import sparsity
    from .codegen.c.c_source import CSource, to_c
    from .codegen.disk_cache import clear_cache
    from .codegen.wasm.to_wasm import to_wasm
    from .core.checks import GraphError
    from .core.graph import Edge, Graph
    from .core.node import Node, constant, variable
    from .core.scope import tag
    from .explain.compare import Comparison, compare
    from .explain.lint.lint import Lint, lint
    from .explain.why import Why, why
    from .explain.why_not import WhyNot, why_not
    from .operations.table import (
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
    from .program.functions.compile import compile
    from .program.functions.compiled import Compiled
    from .program.loop import Loop, loop
    from .simplification.balanced_sums import balanced_sums
    from .simplification.double_double import double_double
    from .simplification.simplify import simplify, specialize
    from .util.caches import clear_caches
    from .writing.counts import Counts
    from .writing.latex import latex
    from .writing.naming import variables, with_name
    from .writing.source_lines import recording_lines
    from .writing.structure_hash import structure_hash

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
    "clear_caches",
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

if not TYPE_CHECKING:  # a checker shall see a misspelt name

    def _of_row(name):
        from .operations.functions import of_name

        return of_name(name)  # `cg.name` of a row that was added to the table

    __getattr__, __dir__ = doors(__name__, __file__, _of_row, first="cgraph.operations")
