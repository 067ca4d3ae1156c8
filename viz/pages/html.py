"""Pages: one HTML file from its parts, with its policy; and the files that are parts."""

import base64
import hashlib
import json
import os
import re
from collections.abc import Mapping
from html import escape, unescape
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from cgraph._shared import Json, check_writable, require_path

from .. import theme
from .mathml import STYLE as MATHML

FRAME_HEIGHT = 760  # pixels in a notebook
_COMMENT = re.compile(r"^ *(?://[^\n]*|/\*\*.*?\*/)\n", re.MULTILINE | re.DOTALL)  # that begins a line

SHADOWS = (  # at the edges beyond which there is more to scroll to
    "background: linear-gradient(to right, var(--back) 40%, transparent) left / 2.2rem 100% no-repeat local, "
    "linear-gradient(to left, var(--back) 40%, transparent) right / 2.2rem 100% no-repeat local, "
    "linear-gradient(to right, rgb(128 128 128 / 0.5), transparent) left / 0.7rem 100% no-repeat scroll, "
    "linear-gradient(to left, rgb(128 128 128 / 0.5), transparent) right / 0.7rem 100% no-repeat scroll;"
)
STYLE = f"""
:root {{ color-scheme: light dark; --text: {theme.TEXT}; --back: #FFFFFF; --soft: #F4F4F2; --line: #D8D8D4; }}
@media (prefers-color-scheme: dark) {{ :root {{ --text: #E8E8E4; --back: #17181A; --soft: #232529; --line: #3A3D42; }} }}
body {{ margin: 0 auto; padding: 1.5rem; max-width: 64rem; color: var(--text); background: var(--back);
  font: 17px/1.55 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }}
h1 {{ font-size: 1.7rem; line-height: 1.25; }} h2 {{ margin-top: 2.6rem; border-top: 1px solid var(--line); padding-top: 1.2rem; }}
nav a {{ margin-right: 1rem; display: inline-block; }} a {{ color: inherit; }}
figure {{ margin: 1.2rem 0; }} figcaption {{ font-size: 0.95rem; margin-top: 0.5rem; }}
figure {{ overflow-x: auto; }} figcaption {{ position: sticky; left: 0; }}
figure img {{ display: block; max-width: 100%; height: auto; margin: 0 auto; background: #FFFFFF; border-radius: 4px; }}
figure img.drawing, figure img.plot {{ background: none; }}
figure img.plot {{ width: 100%; min-width: 40rem; }} /* its letters stay legible: a narrow screen scrolls */
.scroll {{ overflow-x: auto; {SHADOWS} }}
@media (max-width: 43rem) {{ figure.wide figcaption::before {{ content: "The figure is wider than the page: scroll it sideways. "; opacity: 0.8; }} }}
table {{ border-collapse: collapse; margin: 1rem 0; font-size: 0.95rem; font-variant-numeric: tabular-nums; }}
th, td {{ padding: 0.35rem 0.5rem; border-bottom: 1px solid var(--line); text-align: right; }}
td + td {{ white-space: nowrap; }} td:first-child {{ min-width: 7rem; }}
th {{ vertical-align: bottom; }}
th:first-child, td:first-child {{ text-align: left; }} thead :is(th, td) {{ border-bottom: 2px solid var(--text); }}
caption {{ text-align: left; font-weight: 600; padding-bottom: 0.4rem; }}
summary {{ cursor: pointer; font-weight: 600; }} details caption {{ display: none; }}
pre {{ background: var(--soft); padding: 0.8rem 1rem; overflow-x: auto; border-radius: 4px; }}
.point, .warning {{ background: var(--soft); border-left: 5px solid {theme.BLUE}; padding: 0.6rem 1rem; }}
.warning {{ border-left-color: {theme.SPURIOUS}; }}
@media print {{ :root {{ color-scheme: light; --text: {theme.TEXT}; --back: #FFFFFF; --soft: #F4F4F2; --line: #D8D8D4; }}
  body {{ max-width: none; padding: 0; }} nav {{ display: none; }} .scroll, figure {{ overflow: visible; background: none; }}
  h2, caption, summary {{ break-after: avoid; }} figure, tr, pre, .point, .warning {{ break-inside: avoid; }}
  p, li {{ orphans: 3; widows: 3; }} thead {{ display: table-header-group; }} figure img.plot {{ min-width: 0; }} }}
"""


def html_target(what: str, path: str | os.PathLike[str] | None) -> Path | None:
    """The path that a page is to be written to, if there is one, looked at before the work.

    Raises TypeError for what is no path, ValueError for one that does not end in .html, OSError for one that cannot be
    written.
    """
    if path is None:
        return None
    target = require_path(what, path)
    if target.suffix != ".html":
        raise ValueError(f"{what} must end in .html, got {os.fspath(target)!r:.80}")
    check_writable(target)
    return target


class Page(str):
    """The HTML text of a page; a notebook shows it in a frame."""

    __slots__ = ()

    def __repr__(self) -> str:
        title = unescape(self.partition("<title>")[2].partition("</title>")[0])
        return f"<Page {title!r:.60} of {len(self)} characters>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self)}" sandbox="allow-scripts" title="cgraph page" '
            f'style="width:100%;height:{FRAME_HEIGHT}px;border:0"></iframe>'
        )


class Panel(NamedTuple):
    """A part that another module adds: markup beside the picture or at the end, style, scripts before and after start.

    first: JavaScript for the record that the page shows first, where its own data are none.  run: JavaScript that
    begins the panel; `inspector` is what app.js lends to other scripts.  data: as `compose` takes them.
    """

    body: str = ""
    style: str = ""
    script: str = ""
    first: str = ""
    run: str = ""
    end: str = ""
    data: Mapping[str, Json] = MappingProxyType({})


def compose(title: str, body: str, style: str, script: str = "", data: Mapping[str, object] | None = None) -> Page:
    """Page of one file, which fetches nothing and whose policy lets its own script and style alone run.

    body: HTML.  data: {id of an element: what scripts read there as JSON}. A page without a script may have styles
    at its elements.
    """
    style += MATHML if 'class="aligned"' in body else ""
    run = f"script-src {_digest(script)}; style-src {_digest(style)}" if script else "style-src 'unsafe-inline'"
    policy = f"default-src 'none'; {run}; img-src data:; base-uri 'none'; form-action 'none'"
    # "<" in the data could end the element that holds it
    texts = {
        name: json.dumps(each, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
        for name, each in (data or {}).items()
    }
    held = "".join([f'<script id="{name}" type="application/json">{text}</script>\n' for name, text in texts.items()])
    return Page(
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f"<style>{style}</style>\n</head>\n<body>\n{body}\n{held}"
        f"{script and f'<script>{script}</script>'}\n</body>\n</html>\n"
    )


def asset(package: str | None, *names: str) -> str:
    """The texts of files beside the modules of a package, such as scripts and styles; of scripts without comments."""
    assert package is not None
    texts = [files(package).joinpath(name).read_text(encoding="utf-8") for name in names]
    return "\n".join(
        [_COMMENT.sub("", text) if name.endswith(".js") else text for name, text in zip(names, texts, strict=True)]
    )


def _digest(text: str) -> str:
    """The name of an inline script or style in a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
