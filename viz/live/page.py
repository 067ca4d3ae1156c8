"""The panel of a live motion, for any page, and a page of it alone: nothing loaded, no script but its own."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import TYPE_CHECKING, NamedTuple

from .. import theme
from ..pages import html
from ..pages.html import Page, asset
from .content import Live

if TYPE_CHECKING:
    from cgraph.extend import Json

SCRIPTS = ("machine.js", "run.js", "course.js", "live.js")
EVALUATION = "'wasm-unsafe-eval'"  # in the policy: WebAssembly may be compiled, text may not


class Panel(NamedTuple):
    """What a page takes to have the panel: elements, its data, a script and a style; all colors are variables.

    The page's style has --text, --back, --soft and --edge, its scripts elements.js and
    address.js, its policy `EVALUATION`.
    """

    html: str
    data: Mapping[str, Json]
    script: str
    style: str

    def folded(self) -> str:
        """Elements for the end of a page: the panel, closed at first."""
        return f'<details id="live"><summary>Live: computed as you watch</summary>\n{self.html}</details>'


def panel(live: Live) -> Panel:
    """The panel."""
    colors = {"kinetic": theme.BLUE, "potential": theme.ORANGE, "right": theme.GREEN, "wrong": theme.SPURIOUS}
    variables = ":root{" + "".join(f"--live-{name}:{color};" for name, color in colors.items()) + "}\n"
    dark = f"@media (prefers-color-scheme: dark){{:root{{--live-kinetic:{theme.SKY_BLUE};}}}}\n"
    script = f"{{\n{asset(__package__, *SCRIPTS)}\nstartLive();\n}}"  # in a block it shares no name with a page's
    style = f"{variables}{dark}{asset(__package__, 'live.css')}"
    return Panel(asset(__package__, "live.html"), {"live-data": live.to_dict()}, script, style)


def page_text(live: Live, *, title: str = "A motion, live", about: str = "") -> Page:
    """One page on which a motion is computed as it is watched, with sliders, meters of energy and error, and a link.

    The equations and the steps are a WebAssembly module in the page; nothing is loaded from anywhere, and the policy
    lets no script run but the page's own.

    Parameters
    ----------
    live : Live
        What moves.
    title : str
        Heading of the page.
    about : str
        What to see, a sentence or two.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    TypeError
        For what is no Live, or a title or about that is no text.
    """
    if not isinstance(live, Live):
        raise TypeError(f"page_text needs a Live, got {type(live).__name__}: {live!r:.60}")
    for what, text in (("title", title), ("about", about)):
        if not isinstance(text, str):
            raise TypeError(f"{what} of a page must be text, got {type(text).__name__}: {text!r:.60}")
    shown = panel(live)
    words = f"<p>{escape(about)}</p>\n" if about else ""
    body = f"<main>\n<h1>{escape(title)}</h1>\n{words}{shown.html}</main>"
    script = f'"use strict";\n{asset(html.__package__, "elements.js", "address.js")}\n{shown.script}'
    return html.compose(title, body, f"{asset(__package__, 'alone.css')}{shown.style}", script, shown.data, EVALUATION)
