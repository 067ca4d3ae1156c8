"""Worksheets of a lesson, to be printed: questions, graphs to mark, lines to fill; and the key to one."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from dynamics import inverse_dynamics

from ..pages import html
from ..pages.html import Page, asset
from .glossary import glossary
from .introduction import introduction
from .screen import Screen
from .subject import Subject, lagrangian_graph


def worksheet(subject: Subject, screens: Sequence[Screen], title: str, author: str, *, key: bool) -> Page:
    """The page of a worksheet, or of its key."""
    by = f'<p class="by">{escape(author)}</p>' if author else ""
    lines = "".join([f"<span>{label}</span>" for label in ("Name", "Class", "Date")])
    body = "\n".join([screen.paper_html(k, key=key) for k, screen in enumerate(screens, start=1)])
    text = (
        f"{body}\n{_latex(subject)}"
        if key
        else f'<p class="fill">{lines}</p>\n<section id="start"><h2>Before you begin</h2>\n{introduction(subject)}</section>\n{body}'
    )
    heading = f"Key: {title}" if key else title
    return html.compose(
        heading,
        f"<header><h1>{escape(heading)}</h1>{by}</header>\n<main>\n{text}\n{'' if key else glossary(text).replace('<details', '<details open', 1)}\n</main>",
        asset(__package__, "worksheet.css"),
    )


def _latex(subject: Subject) -> str:
    """The Lagrangian and tau, to be copied."""
    graphs = {
        "The Lagrangian": lagrangian_graph(subject.system),
        f"The {subject.force}, by the chain rule": inverse_dynamics(subject.system, "chain_rule"),
    }
    rows = [
        f"<p>{name}</p><pre>{escape(graph.latex(names=subject.scene_names, lines=12))}</pre>"
        for name, graph in graphs.items()
    ]
    return f'<section id="latex"><h2>Equations as LaTeX</h2>\n{"".join(rows)}</section>'
