"""The node-level interface: what a package that derives, transforms or runs graphs of its own is built on.

`cgraph` itself is for people who write equations. This module is for code that makes nodes in bulk: it says how
derived nodes are folded and shared, pushes and pulls derivatives node by node, solves on the graph, and repeats
graphs natively. `dynamics` and `viz` import from `cgraph` and from here, and from nowhere deeper. What is listed here
is kept stable.

**Build**: `Builder` folds and shares; `with building(Builder()):` sends every formula inside through it. `folded`
copies nodes through a builder, `topological` gives all nodes that some nodes reach, arguments first.
`with_reciprocals` leaves one division for a divisor.

**Differentiate**: `cotangents` pulls from outputs, `tangents` pushes from inputs, `hessian_nodes` gives the lower
triangle of second derivatives, all as nodes. `compressed_jacobian` gives the parts of a loop over colors of columns,
`jets` the Taylor coefficients of a solution.

**Solve**: `solve_nodes` is `cg.hessian_solve` on nodes, `solve_tangents` the same with the tangents of all that lies
between, `ldl_solve` the dense factorization; all raise `SingularError`. `ldl_elimination` does the same over any
numbers.

**Read**: `expand` and `format_polynomial` write a polynomial out, `Names` tells nodes in a person's words,
`Formulas` gives the equations of nodes in a `Notation`, `OPS` is
the table of operations, `register` adds a row to it, an `Op`, and `ADJOINT`, `PRIMAL`, `TANGENT` are the roles that a
label may have. `certain_digits` says what rounding leaves of the outputs at a point, `rounding_spread` how far it
moves them at sample points.

**Run**: a `Program` is graphs over registers of numbers (`Call`, `Map`, `Sum`, `Factor`, `Solve`, `If`, `While`), and
`runner` makes it machine code or Python. `program_jvp` and `program_vjp` are its derivatives, `many` is what memories
side by side run, and `register_statement` adds a kind of statement. `copied` and `added` are the plainest ones.

**At the edges**: `real_array`, `real_number`, `is_finite`, `check_name`, `require_graph`, `require_flag`,
`require_whole`, `require_choice`, `require_sequence`, `require_mapping` and `require_path` check what a caller passed,
`thread_count` reads `threads=`, `share` gives work to threads, `atomic_write` writes a file whole or not at all,
`write_files` several, and `check_writable` looks beforehand; `counted` is a number with its noun; `html_table`,
`html_lines` and `picture` are what a notebook shows of a result; `install` ends an error about a missing
package, `scipy_integrate` gives SciPy's module or raises it. `memo` and `kept_by_first` make a
function keep its results. `Array` is the type of an array of float64, `Json` of what JSON can hold.

    >>> import cgraph as cg
    >>> from cgraph.extend import Builder, building, cotangents
    >>> x, y = cg.variables("x y")
    >>> build = Builder()
    >>> with building(build):
    ...     area = x * y
    >>> dx, dy = cotangents({area: cg.constant(1.0)}, [x, y], build)
    >>> dx is y, dy is x
    (True, True)
"""

from .util.doors import doors

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from .autodiff.compressed_jacobian import CompressedJacobian, compressed_jacobian
    from .autodiff.hessian_solve import Order, solve_nodes, solve_tangents
    from .autodiff.jacobian import hessian_nodes
    from .autodiff.jets import Jets, NoSeriesError, jets
    from .autodiff.ldl_solve import ldl_elimination, ldl_solve
    from .autodiff.symmetric_elimination import SingularError
    from .core.builder import Builder, folded
    from .core.checks import check_name
    from .core.evaluation import Array
    from .core.forward import tangents
    from .core.label import ADJOINT, PRIMAL, TANGENT, UNLABELLED
    from .core.node import as_node
    from .core.reverse import cotangents
    from .core.scope import building
    from .core.traversal import topological
    from .explain.lint.cancellation import certain_digits
    from .explain.names import Names
    from .operations.operation import MathML, Op, columns
    from .operations.register import register
    from .operations.table import OPS
    from .program.derivatives.linearization import Linearization, Linearized
    from .program.derivatives.tape import Tape, run_passes
    from .program.derivatives.transforms import ProgramVjp, Pulled, program_jvp, program_vjp
    from .program.many import many
    from .program.program import Program
    from .program.runners.choose_runner import runner
    from .program.runners.runner import Record, Runner
    from .program.statement import STATEMENTS, Statement, StatementRow, register_statement, require_length
    from .program.statements.call import Call, Map, Sum, added, copied
    from .program.statements.control import FixedPoint, If, While
    from .program.statements.matrix import Factor, Solve
    from .program.statements.memory import Pop, Push, Take
    from .simplification.identities import shortened
    from .simplification.polynomial import Polynomial, expand, format_polynomial
    from .simplification.reciprocals import with_reciprocals
    from .simplification.rounding_growth import rounding_spread
    from .util.atomic_write import atomic_write, check_writable, write_files
    from .util.caches import kept_by_first, memo
    from .util.doors import doors
    from .util.extras import install
    from .util.html_text import html_lines, html_table, picture
    from .util.json_type import Json
    from .util.real_arrays import is_finite, real_array, real_number
    from .util.require import (
        require_choice,
        require_flag,
        require_graph,
        require_mapping,
        require_path,
        require_sequence,
        require_texts,
        require_whole,
    )
    from .util.scipy_modules import scipy_integrate
    from .util.threads import share, thread_count
    from .util.words import counted, nearest, or_nearest
    from .writing.formulas import Formulas, Notation

__all__ = [
    "ADJOINT",
    "OPS",
    "PRIMAL",
    "STATEMENTS",
    "TANGENT",
    "UNLABELLED",
    "Array",
    "Builder",
    "Call",
    "CompressedJacobian",
    "Factor",
    "FixedPoint",
    "Formulas",
    "If",
    "Jets",
    "Json",
    "Linearization",
    "Linearized",
    "Map",
    "MathML",
    "Names",
    "NoSeriesError",
    "Notation",
    "Op",
    "Order",
    "Polynomial",
    "Pop",
    "Program",
    "ProgramVjp",
    "Pulled",
    "Push",
    "Record",
    "Runner",
    "SingularError",
    "Solve",
    "Statement",
    "StatementRow",
    "Sum",
    "Take",
    "Tape",
    "While",
    "added",
    "as_node",
    "atomic_write",
    "building",
    "certain_digits",
    "check_name",
    "check_writable",
    "columns",
    "compressed_jacobian",
    "copied",
    "cotangents",
    "counted",
    "doors",
    "expand",
    "folded",
    "format_polynomial",
    "hessian_nodes",
    "html_lines",
    "html_table",
    "install",
    "is_finite",
    "jets",
    "kept_by_first",
    "ldl_elimination",
    "ldl_solve",
    "many",
    "memo",
    "nearest",
    "or_nearest",
    "picture",
    "program_jvp",
    "program_vjp",
    "real_array",
    "real_number",
    "register",
    "register_statement",
    "require_choice",
    "require_flag",
    "require_graph",
    "require_length",
    "require_mapping",
    "require_path",
    "require_sequence",
    "require_texts",
    "require_whole",
    "rounding_spread",
    "run_passes",
    "runner",
    "scipy_integrate",
    "share",
    "shortened",
    "solve_nodes",
    "solve_tangents",
    "tangents",
    "thread_count",
    "topological",
    "with_reciprocals",
    "write_files",
]

if not TYPE_CHECKING:  # a checker shall see a misspelt name
    __getattr__, __dir__ = doors(
        __name__, __file__, first="cgraph.operations", explained=("cotangents", "folded", "tangents", "topological")
    )
