"""viz: pictures and pages of computational graphs."""

TYPE_CHECKING = False  # as a checker knows it; typing takes longer to load than all that awaits Ctrl-C

if TYPE_CHECKING:
    from cgraph import __version__ as __version__

    from .graph_drawing.dot import to_dot
    from .graph_drawing.render import graph_svg, render_png, render_svg
    from .inspector import page  # type: ignore[no-redef]  # the name of a module there, too
    from .lessons.lesson import lesson
    from .models.animate import animate
    from .models.inspect import inspect
    from .models.live import live_page
    from .models.typed_text import typed_text
    from .typed import typed_page

__all__ = [
    "animate",
    "graph_svg",
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

if not TYPE_CHECKING:  # loaded when asked for: the command line has to await Ctrl-C before it loads anything

    def __getattr__(name):
        from importlib import import_module

        homes = {"__version__": "cgraph", "to_dot": ".graph_drawing.dot", "page": ".inspector"}
        homes |= {name: f".models.{name}" for name in ("animate", "inspect", "typed_text")}
        homes |= {"lesson": ".lessons.lesson", "live_page": ".models.live", "typed_page": ".typed"}
        homes |= dict.fromkeys(["graph_svg", "render_png", "render_svg"], ".graph_drawing.render")
        if name not in homes:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(homes[name], __name__), name)

    def __dir__():
        return sorted({*globals(), *__all__})
