"""viz: pictures and pages of computational graphs."""

from cgraph._shared import doors

TYPE_CHECKING = False  # as a checker knows it; typing takes longer to load than all that awaits Ctrl-C

if TYPE_CHECKING:
    from cgraph import __version__ as __version__

    from .graph_drawing.dot import to_dot as to_dot
    from .graph_drawing.render import render_png as render_png, render_svg as render_svg
    from .inspector.page import page as page
    from .lessons.lesson import lesson as lesson
    from .models.drawing import draw as draw
    from .models.driven_motion import driven as driven
    from .models.film import animate as animate
    from .models.inspection_page import inspect as inspect
    from .models.live_motion import live as live
    from .models.typed_text import typed_text as typed_text
    from .typed.text_page import typed_page as typed_page

if not TYPE_CHECKING:  # the command line has to await Ctrl-C before it loads anything
    __getattr__, __dir__ = doors(__name__, __file__)
