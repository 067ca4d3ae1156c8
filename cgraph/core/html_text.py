"""HTML that a notebook shows of results: tables, and text in its lines; colors are the notebook's."""

from __future__ import annotations

from collections.abc import Sequence

LEFT, RIGHT = "text-align:left", "text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap"


def html_table(header: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "", texts: int = 1) -> str:
    """A table of texts as HTML, in which what the texts hold is shown as it is, never run.

    header: names of the columns; of empty ones no line is drawn.  texts: so many of the first columns are words, read
    from the left; the others are numbers.
    """

    def line(cells: Sequence[str], kind: str) -> str:
        styles = [LEFT if i < texts else RIGHT for i in range(len(cells))]
        inside = [f'<{kind} style="{styles[i]}">{_escape(cell)}</{kind}>' for i, cell in enumerate(cells)]
        return f"<tr>{''.join(inside)}</tr>"

    above = f'<caption style="{LEFT}">{_escape(title)}</caption>' if title else ""
    head = f"<thead>{line(header, 'th')}</thead>" if any(header) else ""
    body = "".join([line(row, "td") for row in rows])
    return f'<div style="overflow-x:auto"><table>{above}{head}<tbody>{body}</tbody></table></div>'


def html_lines(text: str) -> str:
    """Text in its lines, in letters of equal width, as HTML."""
    return f"<pre>{_escape(text)}</pre>"


def html_text(text: str) -> str:
    """A paragraph of text as HTML."""
    return f"<p>{_escape(text)}</p>"


def render_html(kind: str, what: object) -> str | None:
    """The HTML that a drawing package makes of something (entry point `kind` of the group `cgraph.renderers`), if any.

    None where no package is installed that draws it, or where it cannot: the notebook shows text then.
    """
    from importlib.metadata import entry_points  # takes as long to load as all of the core

    for renderer in entry_points(group="cgraph.renderers", name=kind):
        try:
            return str(renderer.load()(what))
        except (ImportError, RuntimeError):
            return None
    return None


def _escape(text: str) -> str:
    from html import escape  # loaded with the first result that a notebook shows

    return escape(text)
