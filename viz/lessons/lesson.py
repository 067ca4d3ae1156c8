"""Lessons on a system: screens of one subject on a page that loads nothing; a worksheet to be printed, and its key."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from html import escape, unescape
from typing import NamedTuple

from cgraph import Graph
from cgraph._shared import require_choice, require_kind, write_files
from dynamics.scenes.scenes import names
from dynamics.systems.model import Model

from ..graph_drawing.render import check_can_draw
from ..models.equations import model_equations
from ..models.equations_text import equations_latex
from ..pages import html
from ..pages.html import Page, asset, html_target
from .glossary import glossary
from .introduction import MINUTES, introduction
from .screen import Screen
from .screens.check import check
from .screens.closed_loop import closed_loop
from .screens.elimination import elimination
from .screens.energy_and_step import energy_and_step
from .screens.euler_edge import euler_edge
from .screens.sweeps import backward_sweep, formula_graph, forward_sweep
from .screens.torque_parts import torque_parts
from .screens.wrong_way import wrong_way
from .subject import Subject, subject_of


class Lesson(NamedTuple):
    """A subject: what it is called, how long it takes a student, and its screens."""

    title: str
    minutes: int
    screens: tuple[Callable[[Subject], Screen], ...]


LESSONS = {
    "euler": Lesson(
        "Why a derivative “by definition” is wrong",
        MINUTES + 25,
        (formula_graph, backward_sweep, euler_edge, wrong_way, check),
    ),
    "sweeps": Lesson("The chain rule in sweeps", MINUTES + 14, (formula_graph, backward_sweep, forward_sweep)),
    "torque": Lesson("The parts of a torque or force", MINUTES + 3, (torque_parts,)),
    "elimination": Lesson("Accelerations by elimination", MINUTES + 5, (elimination,)),
    "loops": Lesson("A constraint and its force", MINUTES + 5, (closed_loop,)),
    "energy": Lesson("Energy and the size of a step", MINUTES + 5, (energy_and_step,)),
}
LINES = 40  # of LaTeX, of each formula
WIDEST = 112  # letters of a formula in a line of paper
TRIALS = 20  # orders of the choices
FORMS = ("page", "worksheet", "key")


def lesson(
    model: Model,
    path: str | os.PathLike[str] | None = None,
    *,
    subject: str = "euler",
    form: str = "page",
    title: str = "",
    author: str = "",
) -> Page:
    """A lesson on a system: questions to predict, reveal and try, on one page that loads nothing.

    Every number is computed for this system in a moment in which it moves, and the right answers are measured on it.

    Parameters
    ----------
    model : Model
        A System, a Mechanism or a Scene.
    path : str or path, optional
        The file to write the page to, .html.
    subject : str
        "euler", why the derivative by definition is wrong, 28 minutes; "sweeps", the chain rule in sweeps; "torque", the
        parts of a torque; "elimination", accelerations from the last joint to the first; "loops", a constraint and its
        multiplier; "energy", the error of a step.
    form : str
        "page", for the screen; "worksheet", to be printed, with graphs to mark and lines to fill; "key", the answers to
        both, with the marked graphs, and the equations as LaTeX.
    title, author : str
        What stands at the top; without a title that of the subject.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    TypeError
        For what is no model, for a system of first order, which has no Lagrangian, and for a title that is no text.
    ValueError
        For an unknown subject or form, and a path that does not end in .html.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> page = viz.lesson(dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 4.5 * q[0] ** 2, ["x"]))
    >>> page.count('class="predict"')
    5
    """
    target = html_target("the lesson's file", path)
    chosen = LESSONS[require_choice("subject", subject, LESSONS)]
    require_choice("form", form, FORMS)
    for what, given in (("title", title), ("author", author)):
        require_kind(what, given, str, "text")
    if isinstance(model, Graph):
        raise TypeError("a lesson is about a System, a Mechanism or a Scene; viz.page(graph) is the page of a cg.Graph")
    check_can_draw(png=False)
    on = subject_of(model)
    screens = arranged([screen(on) for screen in chosen.screens], f"{subject} {on.scene.name} {' '.join(on.joints)}")
    heading = f"{'Key: ' * (form == 'key')}{title or chosen.title}"
    by = f'<p class="by">{escape(author)}</p>' if author else ""
    head = f"<header><h1>{escape(heading)}</h1>{by}</header>"
    if form == "page":
        text = page(on, screens, heading, head, subject)
    else:
        text = worksheet(on, screens, heading, head, key=form == "key")
    if target is not None:
        write_files({target: text})
    return text


def arranged(screens: Sequence[Screen], seed: str) -> list[Screen]:
    """The screens, each with its choices in another order than others have, so that no letter is always right."""
    for trial in range(TRIALS):
        made = [screen.arranged(f"{seed} {trial}") for screen in screens]
        if len({screen.answer for screen in made}) > len(made) // 2:
            break
    return made


def page(subject: Subject, screens: Sequence[Screen], title: str, head: str, chosen: str) -> Page:
    """The page of the screens of a lesson, of its name in `LESSONS`, between the introduction and the end."""
    data = {
        "answers": [screen.answer for screen in screens],
        "plays": [{key: each for key, each in (screen.play or {}).items() if key != "modules"} for screen in screens],
        "values": subject.values,  # of inputs, where a play has no others
    }
    modules = ", ".join([str((screen.play or {}).get("modules", "{}")) for screen in screens])
    body = "\n".join([screen.to_html(k) for k, screen in enumerate(screens, start=1)])
    start = (
        f'<section class="screen" id="start">\n<h2>Before you begin <small>{MINUTES} minutes</small></h2>\n'
        f"<p>About {LESSONS[chosen].minutes} minutes, for those who know derivatives. On every screen predict first, then reveal. Keys: A to "
        "F choose, the arrows turn the pages, Tab and Enter do all else. The address of the page holds your guesses: "
        "bookmark it to keep them. A term with dots below is explained where you press it, and in the glossary at the end. “The paper” is "
        "T. Kusaka and T. Tanaka, Robotics 2025, 14(9), 115.</p>\n"
        f"{introduction(subject)}\n</section>"
    )
    text = f"{start}\n{body}\n{_end(subject, chosen)}"
    return html.compose(
        title,
        f'{head}\n<nav aria-label="Screens"></nav>\n<main>\n{text}\n{glossary(text)}\n</main>',
        asset(__package__, "lesson.css"),
        f'"use strict";\nconst MODULES = [{modules}];\n{scripts()}\n{asset(__package__, "app.js")}',
        {"data": data},
    )


def scripts() -> str:
    """Scripts of the plays, and of what they need."""
    return "\n".join([asset(html.__package__, "elements.js", "tables.js"), asset(__package__, "plays.js")])


def _end(subject: Subject, chosen: str) -> str:
    """The last part: what was seen, and the lessons that may follow."""
    name = subject.scene.name if subject.scene.name in names() else "SCENE"
    rows = "".join(
        [
            f"<li><b>{each.title}</b>, {each.minutes} minutes: <code>cgraph lesson {name} --subject {key} --out "
            f"{key}.html</code></li>"
            for key, each in LESSONS.items()
            if key != chosen
        ]
    )
    short = (
        "a partial derivative holds every other input, but with the Euler relation in the graph q is no input any more: "
        "it hangs on q̇, and ∂L/∂q comes into dp/dt at every dt."
        if subject.verdict.differs
        else "for this system the derivative by definition happens to be right."
    )
    seen = f"<p>In short: {short} {subject.verdict_text}</p>\n" if chosen == "euler" else ""
    return (
        f'<section class="screen" id="end">\n<h2>The end</h2>\n{seen}<p class="score"></p>\n'
        f"<h3>Next lessons</h3>\n<ul>{rows}</ul>\n</section>"
    )


def worksheet(subject: Subject, screens: Sequence[Screen], title: str, head: str, *, key: bool) -> Page:
    """The page of a worksheet, or of its key."""
    lines = "".join([f"<span>{label}</span>" for label in ("Name", "Class", "Date")])
    body = "\n".join([screen.paper_html(k, key=key) for k, screen in enumerate(screens, start=1)])
    if key:
        latex = escape(equations_latex(model_equations(subject.scene), LINES))
        text = f'{body}\n<section id="latex"><h2>Equations as LaTeX</h2>\n<pre>{latex}</pre></section>'
    else:
        text = f'<p class="fill">{lines}</p>\n<section id="start"><h2>Before you begin</h2>\n{introduction(subject)}</section>\n{body}'
    text = re.sub(r'<math display="block">(?=(.*?)</math>)', _fitted, text, flags=re.DOTALL)
    return html.compose(
        title,
        f"{head}\n<main>\n{text}\n{'' if key else glossary(text).replace('<details', '<details open', 1)}\n</main>",
        asset(__package__, "worksheet.css"),
    )


def _fitted(found: re.Match[str]) -> str:
    """A formula as small as its widest row needs: paper has no scroll bar."""
    letters = max([len(unescape(re.sub("<[^>]*>", "", row))) for row in found[1].split("</mtr>")])
    return found[0] if letters <= WIDEST else f'{found[0][:-1]} style="font-size: {WIDEST / letters:.2f}em">'
