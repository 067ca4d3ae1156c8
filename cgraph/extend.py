"""The node-level interface: for whoever adds an operation, a statement, a method, a joint, a back end or a transform.

`cgraph` itself is for people who write equations; this module is for code that makes nodes in bulk: how derived nodes
are folded and shared, derivatives node by node, solves on the graph, graphs repeated natively. What `__all__` lists is
kept stable.

**Build**: `Builder` folds and shares; `with building(Builder()):` sends every formula inside through it. `folded`
copies nodes through a builder, `topological` gives all nodes that some nodes reach, arguments first, `as_node` makes a
constant of a number. `with_reciprocals` leaves one division for a divisor.

**Differentiate**: `cotangents` pulls from outputs, `tangents` pushes from inputs, `hessian_nodes` gives the lower
triangle of second derivatives, all as nodes. `compressed_jacobian` gives the parts of a loop over colors of columns,
`jets` the Taylor coefficients of a solution and `straight` all of them as one graph; `NoSeriesError` says that an
operation has none.

**Bound**: `enclosure` gives bounds of the outputs over boxes of the inputs, as a graph.

**Solve**: `solve_nodes` is `cg.hessian_solve` on nodes; it raises `SingularError`.

**Read**: `Names` tells nodes in a person's words, `Formulas` gives the equations of nodes in a `Notation`.
`OPS` is the table of operations, `register` adds a row to it, an `Op`, whose formula may be a `MathML`; `ADJOINT`,
`PRIMAL`, `TANGENT` are the roles that a label may have. `certain_digits` says what rounding leaves of the outputs at a
point.

**Run**: a `Program` is graphs over registers of numbers (`Call`, `Map`, `Sum`, `Factor`, `Solve`, `If`, `While`,
`FixedPoint`, and `For` over rows of a table; `copied` and `added` are the plainest), and `runner` makes it a `Runner`,
machine code or Python. `program_jvp` and `program_vjp` are its derivatives, `many` is what memories side by side run.
`register_statement` adds a `StatementRow` for a `Statement` to `STATEMENTS`, with `require_length` for its check;
`effects` says what statements read and write.

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
    from .autodiff.compressed_jacobian import compressed_jacobian as compressed_jacobian
    from .autodiff.hessian_solve import solve_nodes as solve_nodes
    from .autodiff.jacobian import hessian_nodes as hessian_nodes
    from .autodiff.jets import NoSeriesError as NoSeriesError, jets as jets, straight as straight
    from .autodiff.symmetric_elimination import SingularError as SingularError
    from .core.builder import Builder as Builder, folded as folded
    from .core.forward import tangents as tangents
    from .core.label import ADJOINT as ADJOINT, PRIMAL as PRIMAL, TANGENT as TANGENT
    from .core.node import as_node as as_node
    from .core.reverse import cotangents as cotangents
    from .core.scope import building as building
    from .core.traversal import topological as topological
    from .explain.lint.cancellation import certain_digits as certain_digits
    from .explain.names import Names as Names
    from .operations.enclosure import enclosure as enclosure
    from .operations.operation import MathML as MathML, Op as Op
    from .operations.register import register as register
    from .operations.table import OPS as OPS
    from .program.derivatives.jvp import program_jvp as program_jvp
    from .program.derivatives.transpose import program_vjp as program_vjp
    from .program.many import many as many
    from .program.program import Program as Program
    from .program.runners.native_runner import runner as runner
    from .program.runners.runner import Runner as Runner
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
    from .program.statements.rows import For as For
    from .simplification.simplify import with_reciprocals as with_reciprocals
    from .writing.formulas import Formulas as Formulas, Notation as Notation


if not TYPE_CHECKING:  # a checker shall see a misspelt name
    __getattr__, __dir__ = doors(
        __name__, __file__, first="cgraph.operations", explained=("cotangents", "folded", "tangents", "topological")
    )
