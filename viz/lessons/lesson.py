"""The lesson on a system: six screens on one page that loads nothing, with answers for the teacher."""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Sequence
from html import escape
from importlib.resources import files

from cgraph import Graph
from cgraph.extend import write_files
from dynamics import inverse_dynamics
from dynamics.systems.model import Model

from ..graph_drawing.render import check_can_draw
from ..inspector import Page
from ..inspector.operations import operations
from ..pages.html_target import html_target
from .closed_loop import closed_loop
from .elimination import elimination
from .energy_and_step import energy_and_step
from .euler_edge import euler_edge
from .screen import Screen
from .subject import Subject, formula, lagrangian_graph, subject_of
from .sweeps import sweeps
from .torque_parts import torque_parts

SCREENS = (euler_edge, sweeps, torque_parts, elimination, closed_loop, energy_and_step)
SCRIPTS = ("evaluate.js", "plays.js", "app.js")


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
    data = {"answers": [screen.answer for screen in screens], "plays": [screen.play for screen in screens]}
    # "<" in the data could end the element that holds it
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    script = "\n".join(['"use strict";', operations(), *[_asset(name) for name in SCRIPTS]])
    style = _asset("lesson.css")
    policy = (
        f"default-src 'none'; script-src {_digest(script)}; style-src {_digest(style)}; img-src data:; base-uri 'none'; "
        "form-action 'none'"
    )
    body = "\n".join([screen.to_html(k) for k, screen in enumerate(screens, start=1)])
    return Page(
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n<link rel="icon" href="data:,">\n'
        f'<style>{style}</style>\n</head>\n<body>\n<h1>{escape(title)}</h1>\n<nav aria-label="Screens"></nav>\n'
        f"<main>\n{body}\n{_teacher(subject, screens)}\n</main>\n"
        f'<script id="data" type="application/json">{text}</script>\n<script>{script}</script>\n</body>\n</html>\n'
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


def _asset(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
