"""The panel of a live motion, for any page, and a page of it alone: nothing loaded, no script but its own."""

from __future__ import annotations

import base64
import hashlib
import json
from html import escape
from importlib.resources import files
from typing import NamedTuple

from .. import theme
from .content import Live

SCRIPTS = ("machine.js", "run.js", "course.js", "live.js")
EVALUATION = "'wasm-unsafe-eval'"  # in the policy: WebAssembly may be compiled, text may not
_POLICY = (
    "default-src 'none'; script-src {script} {wasm}; style-src {style}; img-src data:; base-uri 'none'; "
    "form-action 'none'"
)


class Panel(NamedTuple):
    """What a page takes to have the panel: elements, its data as JSON, a script and a style; all colors are variables.

    The page's style has --text, --back, --soft and --edge, its policy the script's digest and `EVALUATION`.
    """

    html: str
    data: str
    script: str
    style: str

    def folded(self) -> str:
        """Elements for the end of a page: the panel, closed at first, and its data."""
        return (
            f'<details id="live"><summary>Live: computed as you watch</summary>\n{self.html}</details>\n'
            f'<script id="live-data" type="application/json">{self.data}</script>\n'
        )


def panel(live: Live) -> Panel:
    """The panel."""
    # "<" in the data could end the element that holds it
    data = json.dumps(live.to_dict(), separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace(
        "<", "\\u003c"
    )
    colors = {"kinetic": theme.BLUE, "potential": theme.ORANGE, "right": theme.GREEN, "wrong": theme.SPURIOUS}
    variables = ":root{" + "".join(f"--live-{name}:{color};" for name, color in colors.items()) + "}\n"
    dark = f"@media (prefers-color-scheme: dark){{:root{{--live-kinetic:{theme.SKY_BLUE};}}}}\n"
    return Panel(
        _asset("live.html"), data, f"{{\n{scripts()}\nstartLive();\n}}", f"{variables}{dark}{_asset('live.css')}"
    )


def scripts() -> str:
    """The panel's JavaScript; in a block of its own it shares no name with a page's."""
    return "\n".join([_asset(name) for name in SCRIPTS])


class LivePage(str):
    """The HTML text of a page; a notebook shows it in a frame."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self)}" sandbox="allow-scripts" title="cgraph live motion" '
            f'style="width:100%;height:760px;border:0"></iframe>'
        )


def page_text(live: Live, *, title: str = "A motion, live", about: str = "") -> LivePage:
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
    LivePage
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
    script = f'"use strict";\n{shown.script}'
    style = f"{_asset('alone.css')}{shown.style}"
    policy = _POLICY.format(script=digest(script), style=digest(style), wasm=EVALUATION)
    words = f"<p>{escape(about)}</p>\n" if about else ""
    return LivePage(
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<style>{style}</style>\n</head>\n<body>\n<main>\n<h1>{escape(title)}</h1>\n{words}{shown.html}</main>\n"
        f'<script id="live-data" type="application/json">{shown.data}</script>\n<script>{script}</script>\n'
        "</body>\n</html>\n"
    )


def digest(text: str) -> str:
    """How a content security policy names an inline script or style."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
