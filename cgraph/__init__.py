"""cgraph: computational graphs of equations, with forward and reverse automatic differentiation."""

from .util.doors import doors
from .util.version import __version__ as __version__

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from .autodiff.hessian_solve import hessian_solve as hessian_solve
    from .autodiff.jacobian import hessian as hessian, jacobian as jacobian
    from .autodiff.products import gradient as gradient, hvp as hvp, jvp as jvp, vjp as vjp
    from .autodiff.sparsity import sparsity as sparsity
    from .bridges.casadi import to_casadi as to_casadi
    from .bridges.jax import as_jax as as_jax, to_jax as to_jax
    from .bridges.scipy import to_scipy as to_scipy
    from .bridges.torch import to_torch as to_torch
    from .codegen.c.c_source import to_c as to_c
    from .codegen.disk_cache import clear_cache as clear_cache
    from .codegen.javascript import to_js as to_js
    from .core.checks import GraphError as GraphError
    from .core.graph import Counts as Counts, Edge as Edge, Graph as Graph, html as html
    from .core.node import Node as Node, constant as constant, variable as variable
    from .core.scope import tag as tag
    from .explain.compare import compare as compare
    from .explain.lint.lint import lint as lint
    from .explain.why import why as why, why_not as why_not
    from .explain.why_nan import why_nan as why_nan
    from .operations import abs as abs, round as round
    from .operations.interpolation import interp as interp
    from .operations.table import (
        acos as acos,
        asin as asin,
        atan as atan,
        atan2 as atan2,
        cbrt as cbrt,
        ceil as ceil,
        cos as cos,
        cosh as cosh,
        equal as equal,
        erf as erf,
        erfc as erfc,
        exp as exp,
        exp2 as exp2,
        expm1 as expm1,
        floor as floor,
        fmod as fmod,
        hypot as hypot,
        less as less,
        less_equal as less_equal,
        log as log,
        log1p as log1p,
        log2 as log2,
        log10 as log10,
        logistic as logistic,
        maximum as maximum,
        minimum as minimum,
        not_equal as not_equal,
        pow as pow,
        sign as sign,
        sin as sin,
        sinh as sinh,
        sqrt as sqrt,
        tan as tan,
        tanh as tanh,
        where as where,
    )
    from .program.functions.compiled import Compiled as Compiled, compile as compile
    from .simplification.simplify import simplify as simplify, specialize as specialize
    from .util.caches import clear_caches as clear_caches
    from .writing.latex import latex as latex
    from .writing.naming import variables as variables, with_name as with_name
    from .writing.networkx_queries import from_networkx as from_networkx, to_networkx as to_networkx
    from .writing.source_lines import recording_lines as recording_lines
    from .writing.structure_hash import structure_hash as structure_hash


if not TYPE_CHECKING:  # a checker shall see a misspelt name

    def _of_row(name):
        from .operations.operation import of_name

        return of_name(name)  # `cg.name` of a row that was added to the table

    __getattr__, __dir__ = doors(__name__, __file__, _of_row, first="cgraph.operations")
