"""Names of the library that commands use beyond the public ones, loaded when a command runs."""
# ruff: noqa: F401
# mypy: implicit-reexport

from cgraph.extend import doors

TYPE_CHECKING = False

if TYPE_CHECKING:
    from dynamics.experiments import pruning
    from dynamics.experiments.machine import machine
    from dynamics.experiments.speed import bench as speed
    from dynamics.experiments.speed.bench import tables
    from dynamics.experiments.speed.bench_figures import FIGURES
    from dynamics.experiments.stability import stability
    from dynamics.experiments.text_table import table
    from dynamics.experiments.work_precision import motions, named_tasks, work_precision
    from dynamics.experiments.work_precision.cold_start import STARTS
    from dynamics.experiments.work_precision.comparisons import COMPARISONS
    from dynamics.experiments.work_precision.measurement import PEERS, to_csv
    from dynamics.integrators import TABLEAUS
    from dynamics.io.load import compiled
    from dynamics.scenes.start import Start, moving_start, rest_text, with_start
    from dynamics.verification.certificate import certify

    from .. import theme
    from ..animation.canvas import KINDS, check_can_animate
    from ..graph_drawing.dot import to_dot
    from ..graph_drawing.render import check_can_draw, render_png, render_svg, tags_to_collapse
    from ..lessons.lesson import SCREENS, lesson
    from ..models.animate import animate, frames
    from ..models.driven_motion import driven
    from ..models.inspect import inspection_page
    from ..models.inspection import FRAMES, inspection
    from ..models.live import live_page
    from ..models.node_classes import form_classes, formulation_classes
    from ..models.remarks import constant_momentum, tree_alone
    from ..pages import pruning as pruning_page, stability as stability_page, work_precision as work_precision_page
    from ..pages.document import check_folder, document_files
    from ..pages.html import html_target
    from ..paper.both_forms import (
        HAMILTON,
        LAGRANGE,
        VELOCITIES_ALONE,
        both_forms,
        form_agreement,
        form_sizes,
    )
    from ..paper.paper import paper
    from ..plots.plot import check_can_plot
    from ..typed import typed_page

if not TYPE_CHECKING:
    __getattr__, __dir__ = doors(__name__, __file__)
