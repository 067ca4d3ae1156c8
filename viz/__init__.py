"""viz: pictures and pages of computational graphs."""

from cgraph.extend import doors

TYPE_CHECKING = False  # as a checker knows it; typing takes longer to load than all that awaits Ctrl-C

if TYPE_CHECKING:
    from cgraph import __version__ as __version__

    from .graph_drawing.dot import to_dot
    from .graph_drawing.render import render_png, render_svg
    from .inspector.page import page
    from .lessons.lesson import lesson
    from .models.animate import animate
    from .models.driven_motion import driven
    from .models.inspect import inspect
    from .models.live import live_page
    from .models.typed_text import typed_text
    from .typed.page import typed_page

__all__ = [
    "animate",
    "driven",
    "inspect",
    "lesson",
    "live_page",
    "page",
    "render_png",
    "render_svg",
    "to_dot",
    "typed_page",
    "typed_text",
]

if not TYPE_CHECKING:  # the command line has to await Ctrl-C before it loads anything
    __getattr__, __dir__ = doors(__name__, __file__)
