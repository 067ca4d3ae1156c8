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
side by side run, `register_statement` adds a kind of statement, and `effects` says what statements read and write.
`copied` and `added` are the plainest ones. A `LaneCode` runs many memories, each to its own stop.

**At the edges**: `real_array`, `real_number`, `is_finite`, `check_name`, `require_graph`, `require_flag`,
`require_whole`, `require_choice`, `require_sequence`, `require_mapping` and `require_path` check what a caller passed,
`thread_count` reads `threads=`, `share` gives work to threads, `atomic_write` writes a file whole or not at all,
`write_files` several, and `check_writable` looks beforehand; `counted` is a number with its noun; `html_table`,
`html_lines` and `picture` are what a notebook shows of a result; `install` ends an error about a missing
package, `scipy_module` gives a module of SciPy or raises it. `memo` and `kept_by_first` make a
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

from .util.doors import doors as doors

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from .autodiff.compressed_jacobian import (
        CompressedJacobian as CompressedJacobian,
        compressed_jacobian as compressed_jacobian,
    )
    from .autodiff.hessian_solve import Order as Order, solve_nodes as solve_nodes, solve_tangents as solve_tangents
    from .autodiff.jacobian import hessian_nodes as hessian_nodes
    from .autodiff.jets import (
        Jets as Jets,
        NoSeriesError as NoSeriesError,
        convolution as convolution,
        jets as jets,
        straight as straight,
    )
    from .autodiff.ldl_solve import ldl_elimination as ldl_elimination, ldl_solve as ldl_solve
    from .autodiff.symmetric_elimination import SingularError as SingularError
    from .core.builder import Builder as Builder, folded as folded
    from .core.checks import check_name as check_name
    from .core.evaluation import Array as Array
    from .core.forward import tangents as tangents
    from .core.label import ADJOINT as ADJOINT, PRIMAL as PRIMAL, TANGENT as TANGENT, UNLABELLED as UNLABELLED
    from .core.node import as_node as as_node
    from .core.reverse import cotangents as cotangents
    from .core.scope import building as building
    from .core.traversal import topological as topological
    from .explain.lint.cancellation import certain_digits as certain_digits
    from .explain.names import Names as Names
    from .operations.operation import MathML as MathML, Op as Op, columns as columns
    from .operations.register import register as register
    from .operations.table import OPS as OPS
    from .program.derivatives.linearization import Linearization as Linearization, Linearized as Linearized
    from .program.derivatives.tape import Tape as Tape, run_passes as run_passes
    from .program.derivatives.transforms import (
        ProgramVjp as ProgramVjp,
        Pulled as Pulled,
        program_jvp as program_jvp,
        program_vjp as program_vjp,
    )
    from .program.many import many as many
    from .program.program import Program as Program
    from .program.runners.batch_code import LaneCode as LaneCode
    from .program.runners.choose_runner import runner as runner
    from .program.runners.runner import Record as Record, Runner as Runner
    from .program.statement import (
        STATEMENTS as STATEMENTS,
        Statement as Statement,
        StatementRow as StatementRow,
        effects as effects,
        register_statement as register_statement,
        require_length as require_length,
    )
    from .program.statements.call import Call as Call, Map as Map, Sum as Sum, added as added, copied as copied
    from .program.statements.control import FixedPoint as FixedPoint, If as If, While as While
    from .program.statements.matrix import Factor as Factor, Solve as Solve
    from .program.statements.memory import Pop as Pop, Push as Push, Take as Take
    from .simplification.identities import shortened as shortened
    from .simplification.polynomial import (
        Polynomial as Polynomial,
        expand as expand,
        format_polynomial as format_polynomial,
    )
    from .simplification.reciprocals import with_reciprocals as with_reciprocals
    from .simplification.rounding_growth import rounding_spread as rounding_spread
    from .util.atomic_write import (
        atomic_write as atomic_write,
        check_writable as check_writable,
        write_files as write_files,
    )
    from .util.caches import kept_by_first as kept_by_first, memo as memo
    from .util.doors import doors as doors
    from .util.extras import install as install, scipy_module as scipy_module
    from .util.html_text import html_lines as html_lines, html_table as html_table, picture as picture
    from .util.json_type import Json as Json
    from .util.real_arrays import is_finite as is_finite, real_array as real_array, real_number as real_number
    from .util.require import (
        require_choice as require_choice,
        require_flag as require_flag,
        require_graph as require_graph,
        require_mapping as require_mapping,
        require_path as require_path,
        require_sequence as require_sequence,
        require_texts as require_texts,
        require_whole as require_whole,
    )
    from .util.threads import share as share, thread_count as thread_count
    from .util.words import counted as counted, nearest as nearest, or_nearest as or_nearest
    from .writing.formulas import Formulas as Formulas, Notation as Notation


if not TYPE_CHECKING:  # a checker shall see a misspelt name
    __getattr__, __dir__ = doors(
        __name__, __file__, first="cgraph.operations", explained=("cotangents", "folded", "tangents", "topological")
    )
