"""Worksheets of a lesson, to be printed: questions, graphs to mark, lines to fill; and the key to one."""

import re
from collections.abc import Sequence
from html import escape, unescape

from ..models.equations import model_equations
from ..models.equations_text import equations_latex
from ..pages import html
from ..pages.html import Page, asset
from .glossary import glossary
from .introduction import introduction
from .screen import Screen
from .subject import Subject

LINES = 40  # of LaTeX, of each formula
WIDEST = 112  # letters of a formula in a line of paper


def worksheet(subject: Subject, screens: Sequence[Screen], title: str, author: str, *, key: bool) -> Page:
    """The page of a worksheet, or of its key."""
    by = f'<p class="by">{escape(author)}</p>' if author else ""
    lines = "".join([f"<span>{label}</span>" for label in ("Name", "Class", "Date")])
    body = "\n".join([screen.paper_html(k, key=key) for k, screen in enumerate(screens, start=1)])
    if key:
        latex = escape(equations_latex(model_equations(subject.scene), LINES))
        text = f'{body}\n<section id="latex"><h2>Equations as LaTeX</h2>\n<pre>{latex}</pre></section>'
    else:
        text = f'<p class="fill">{lines}</p>\n<section id="start"><h2>Before you begin</h2>\n{introduction(subject)}</section>\n{body}'
    text = re.sub(r'<math display="block">(?=(.*?)</math>)', _fitted, text, flags=re.DOTALL)
    heading = f"Key: {title}" if key else title
    return html.compose(
        heading,
        f"<header><h1>{escape(heading)}</h1>{by}</header>\n<main>\n{text}\n{'' if key else glossary(text).replace('<details', '<details open', 1)}\n</main>",
        asset(__package__, "worksheet.css"),
    )


def _fitted(found: re.Match[str]) -> str:
    """A formula as small as its widest row needs: paper has no scroll bar."""
    letters = max([len(unescape(re.sub("<[^>]*>", "", row))) for row in found[1].split("</mtr>")])
    return found[0] if letters <= WIDEST else f'{found[0][:-1]} style="font-size: {WIDEST / letters:.2f}em">'
