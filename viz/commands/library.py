"""Names of the library that commands use beyond the public ones, loaded when a command runs."""
# ruff: noqa: F401
# mypy: implicit-reexport

from cgraph._shared import doors

TYPE_CHECKING = False

if TYPE_CHECKING:
    from cgraph.extend import Names, cotangents
    from dynamics.equations.formulations.formulation_sizes import INERTIAL_TERM, blamed
    from dynamics.equations.formulations.lagrange_terms import after_step, before_step
    from dynamics.experiments.stability import stability
    from dynamics.experiments.text_table import table
    from dynamics.experiments.work_precision import named_tasks, work_precision
    from dynamics.experiments.work_precision.work_precision import to_csv
    from dynamics.integrators import TABLEAUS
    from dynamics.integrators.rate_in_modes import SWITCHED
    from dynamics.integrators.surfaces import surfaces
    from dynamics.io.load import compiled
    from dynamics.multibody.bodies.joint_coordinates import display_units
    from dynamics.multibody.changes.pruning import PruneResult
    from dynamics.scenes.start import Start, moving_start, rest_text, with_start
    from dynamics.simulation.run_options import Steps
    from dynamics.verification.certificate import certify
    from dynamics.verification.limits_left import limits_left

    from .. import theme
    from ..graph_drawing.dot import to_dot
    from ..graph_drawing.render import check_can_draw, render_png, render_svg, tags_to_collapse
    from ..lessons.lesson import LESSONS, lesson
    from ..models.causes import CauseInAll, Causes, CauseTable, Slopes
    from ..models.drawing import judged_drawing
    from ..models.driven_motion import driven
    from ..models.equations import model_equations
    from ..models.equations_text import equations_latex, equations_text
    from ..models.film import animate, frames, require_film
    from ..models.inspection import FRAMES, inspection
    from ..models.inspection_page import first_view, inspection_page
    from ..models.live_motion import live
    from ..models.node_classes import form_classes, formulation_classes
    from ..models.remarks import tree_alone
    from ..models.typed_text import typed_text
    from ..pages import pruning_page, stability_page, work_precision_page
    from ..pages.document import check_folder, document_files
    from ..pages.html import html_target
    from ..paper.both_forms import HAMILTON, LAGRANGE, VELOCITIES_ALONE, both_forms, form_agreement, form_sizes
    from ..paper.paper import paper
    from ..plots.plot import check_can_plot
    from ..typed.text_page import typed_page

if not TYPE_CHECKING:
    __getattr__, __dir__ = doors(__name__, __file__)
