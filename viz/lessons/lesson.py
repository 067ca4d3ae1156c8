"""The lesson on a system: six screens on one page that loads nothing, with answers for the teacher."""

from __future__ import annotations

import os
from collections.abc import Sequence
from html import escape

from cgraph import Graph
from cgraph.extend import write_files
from dynamics import inverse_dynamics
from dynamics.systems.model import Model

from ..graph_drawing.render import check_can_draw
from ..pages import html
from ..pages.html import Page, asset, html_target
from ..pages.operations import values
from .closed_loop import closed_loop
from .elimination import elimination
from .energy_and_step import energy_and_step
from .euler_edge import euler_edge
from .subject import Screen, Subject, formula, lagrangian_graph, subject_of
from .sweeps import sweeps
from .torque_parts import torque_parts

SCREENS = (euler_edge, sweeps, torque_parts, elimination, closed_loop, energy_and_step)


def lesson(model: Model, path: str | os.PathLike[str] | None = None) -> Page:
    """A lesson on a system: six questions to predict, reveal and play with, on one page that loads nothing.

    The screens: a time step in the graph, the chain rule by sweeps, the parts of a torque, elimination from tip to
    base, a loop and its multiplier, energy and step size. All numbers and answers are computed for this system.

    Parameters
    ----------
    model : Model
        A System, a Mechanism or a Scene.
    path : str or path, optional
        The file to write the page to, .html.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame. Printed, it ends with the answers for the teacher.

    Raises
    ------
    TypeError
        For what is no model, and for a system of first order, which has no Lagrangian.
    ValueError
        For a path that does not end in .html.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> page = viz.lesson(dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 4.5 * q[0] ** 2, ["x"]))
    >>> page.count('class="screen"')
    6
    """
    target = html_target("the lesson's file", path)
    check_can_draw(png=False)
    subject = subject_of(model)
    text = page(subject, [screen(subject) for screen in SCREENS])
    if target is not None:
        write_files({target: text})
    return text


def page(subject: Subject, screens: Sequence[Screen]) -> Page:
    """The page of some screens."""
    title = f"A lesson on {subject.scene.name.replace('_', ' ')}"
    data = {
        "answers": [screen.answer for screen in screens],
        "plays": [screen.play for screen in screens],
        "values": subject.values,  # of inputs, where a play has no others
    }
    body = "\n".join([screen.to_html(k) for k, screen in enumerate(screens, start=1)])
    return html.compose(
        title,
        f'<h1>{escape(title)}</h1>\n<nav aria-label="Screens"></nav>\n<main>\n{body}\n{_teacher(subject, screens)}\n</main>',
        asset(__package__, "lesson.css"),
        f'"use strict";\n{scripts()}\n{asset(__package__, "app.js")}',
        {"data": data},
    )


def scripts() -> str:
    """Scripts of the plays, and of what they need."""
    return "\n".join(
        [values(), asset(html.__package__, "elements.js", "tables.js", "graph.js"), asset(__package__, "plays.js")]
    )


def _teacher(subject: Subject, screens: Sequence[Screen]) -> str:
    """The answers, how it runs, and the equations as LaTeX."""
    answers = "".join([screen.answer_html(k) for k, screen in enumerate(screens, start=1)])
    minutes = sum(screen.minutes for screen in screens)
    graphs: dict[str, Graph] = {
        "The Lagrangian": lagrangian_graph(subject.system),
        "The torque": inverse_dynamics(subject.system, "chain_rule"),
    }
    equations = "".join([f"<p>{name}</p>{formula(graph, subject.scene_names)}" for name, graph in graphs.items()])
    return (
        '<details class="teacher"><summary>For the teacher: answers, and equations as LaTeX</summary>\n'
        f"<ul>{answers}</ul>\n<p>About {minutes} minutes: predict alone, tell a neighbor, reveal, explain in one sentence, "
        "then play. Letters choose, arrows turn the pages, Tab and Enter do all else. The address keeps the guesses: a "
        "bookmark is a score. Printed, every screen has a page for the pupils, and this is the last.</p>\n"
        f"{equations}\n</details>"
    )
