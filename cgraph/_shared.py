"""What the three packages share beside `cgraph` and `cgraph.extend`: no promise is made for these names."""

from .util.doors import doors as doors

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from .autodiff.compressed_jacobian import CompressedJacobian as CompressedJacobian
    from .autodiff.hessian_solve import Order as Order, solve_tangents as solve_tangents
    from .autodiff.jets import Jets as Jets
    from .autodiff.symmetric_elimination import ldl_solve as ldl_solve
    from .bridges.translation import Operations as Operations, operations as operations
    from .codegen.disk_cache import cache_choice as cache_choice
    from .core.checks import check_name as check_name
    from .core.evaluation import (
        Array as Array,
        floats as floats,
        is_finite as is_finite,
        real_array as real_array,
        real_number as real_number,
    )
    from .core.html_text import html_lines as html_lines, html_table as html_table, render_html as render_html
    from .core.label import SMOOTH as SMOOTH, UNLABELLED as UNLABELLED
    from .core.scope import formulating as formulating, without_collection as without_collection
    from .core.traversal import descendants as descendants
    from .explain.lint.lint import Lint as Lint
    from .explain.why_nan import WhyNan as WhyNan
    from .operations.bounds import intervals as intervals
    from .operations.operation import columns as columns
    from .operations.records import HoldsNodes as HoldsNodes
    from .program.derivatives.jvp import Passes as Passes
    from .program.derivatives.transpose import (
        Along as Along,
        Tape as Tape,
        adjoint as adjoint,
        run_passes as run_passes,
        tangent as tangent,
    )
    from .program.runners.batch_code import LaneCode as LaneCode
    from .program.statement import with_names as with_names
    from .program.statements.rows import for_rows as for_rows
    from .simplification.canonical import (
        Polynomial as Polynomial,
        expand as expand,
        format_polynomial as format_polynomial,
    )
    from .simplification.identities import shortened as shortened
    from .simplification.reading_form import ink as ink, reading_form as reading_form
    from .simplification.rounding_growth import (
        error_bounds as error_bounds,
        rounding_noise as rounding_noise,
        rounding_spread as rounding_spread,
    )
    from .util.atomic_write import (
        atomic_write as atomic_write,
        check_writable as check_writable,
        write_files as write_files,
    )
    from .util.caches import kept_by_first as kept_by_first, memo as memo
    from .util.extras import install as install, required as required
    from .util.json_type import Json as Json
    from .util.require import (
        is_function as is_function,
        require_choice as require_choice,
        require_flag as require_flag,
        require_graph as require_graph,
        require_kind as require_kind,
        require_mapping as require_mapping,
        require_path as require_path,
        require_sequence as require_sequence,
        require_texts as require_texts,
        require_whole as require_whole,
    )
    from .util.threads import share as share, thread_count as thread_count, write_batch as write_batch
    from .util.words import counted as counted, entry as entry, nearest as nearest, or_nearest as or_nearest
    from .writing.formulas import Side as Side, entries_of as entries_of, fraction as fraction, statements as statements
    from .writing.latex import (
        LATEX as LATEX,
        formula_tree as formula_tree,
        latex_block as latex_block,
        number_text as number_text,
    )
    from .writing.naming import Remarks as Remarks, remarked as remarked, remarks_of as remarks_of
    from .writing.symbols import GREEK as GREEK, is_letter as is_letter, symbol as symbol


if not TYPE_CHECKING:  # a checker shall see a misspelt name
    __getattr__, __dir__ = doors(__name__, __file__, first="cgraph.operations")
