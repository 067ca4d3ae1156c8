"""The page that a Lagrangian is typed into, and the same box for any other page of the inspector."""

from __future__ import annotations

import json
from string import Template

from .. import theme
from ..inspector.page import compose
from ..pages.html import Page, Panel, asset

FILES = "expressions statements system nodes folding derivatives equations verdict motion record interface".split()


def engine() -> str:
    """The script that reads a text and derives its equations, in a scope that shares no names with other scripts.

    It needs the constants of `operations` and graph.js, and makes one, TYPED.
    """
    letters = json.dumps(theme.LETTERS, separators=(",", ":"), ensure_ascii=False)
    scripts = asset(__package__, *[f"{name}.js" for name in FILES])
    return f"const TYPED = (() => {{\nconst LETTERS = {letters};\n{scripts}\n}})();\n"


def typed_page(text: str | None = None) -> Page:
    """The page that a Lagrangian is typed into: its equations, checked, counted, drawn and moving, offline.

    The text is read by a parser, never run; what it cannot read it says in one sentence with the place. The equations
    are derived in the page, from the operation table of this library: inverse dynamics by definition with Euler's step
    embedded, with the kinetic energy alone, and by the chain rule, as `dynamics.inverse_dynamics` has them by these
    names, node for node. Torques and accelerations are those of a `dynamics.System` to 1e-12. The text is kept in the
    fragment of the page's address.

    Parameters
    ----------
    text : str, optional
        What the box holds at first, such as that of `typed_text`. By default a double pendulum.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    TypeError
        If the text is none.

    Examples
    --------
    >>> page = typed_page("L = 1/2*m*x'^2 - 1/2*k*x^2, m = 1, k = 4, x(0) = 1")
    >>> "1/2*m*x'^2" in page
    True
    """
    if text is not None and not isinstance(text, str):
        raise TypeError(f"a Lagrangian is typed as text, got {type(text).__name__}: {text!r:.60}")
    held = 'TYPED.EXAMPLES.get("double pendulum")' if text is None else _literal(text)
    first = f"typedRecord(linkedText() ?? {held}).record ?? typedRecord({held}).record"
    return compose("Your own Lagrangian", None, (), [_panel(first, f"{held}, true", "")])


def box(text: str = "") -> Panel:
    """The box for a page that shows something else first: closed, with a button that opens it, and this text in it."""
    return _panel("", f"{_literal(text)}, false", " hidden")


def _panel(first: str, held: str, hidden: str) -> Panel:
    return Panel(
        body=Template(asset(__package__, "box.html")).substitute(hidden=hidden),
        style=asset(__package__, "box.css"),
        script=f"{engine()}{asset(__package__, 'box.js')}",
        first=first,
        run=f"startTyped(inspector, {held});",
    )


def _literal(text: str) -> str:
    """The text as JavaScript has it; "<" could end the script."""
    return json.dumps(text).replace("<", "\\u003c")
