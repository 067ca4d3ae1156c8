"""A lesson of ten minutes on Figures 1 to 3: predict, reveal, explain, on one self-contained page."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template

import numpy as np

from cgraph import Graph, Node

from .. import theme
from ..graph_drawing.dot import to_dot
from ..graph_drawing.render import render_svg
from .html import POLICY

_PAGE = Path(__file__).with_name("lesson.html")
_LETTER = 1.15  # height of a figure's letters, in those of the page


@dataclass(frozen=True)
class Lesson:
    """What the page shows, all of it measured on the graphs.

    by_definition, kinetic_only, chain_rule: graphs of the wheel's momentum and inertial torque.
    spurious: nodes of the first that are there by mistake.  equation: what its torque expands to.
    steps: (dt [s], torque that should be 0 [N m]).
    arm_error, arm_torque: of the kinetic-only arm, largest error and largest torque [N m] at the step arm_dt [s].
    """

    by_definition: Graph
    kinetic_only: Graph
    chain_rule: Graph
    spurious: Collection[Node]
    equation: str
    steps: Sequence[tuple[float, float]]
    arm_error: float
    arm_torque: float
    arm_dt: float


def page(lesson: Lesson) -> str:
    """The page as HTML. Raises RenderError where no Graphviz is to be had."""
    nodes = len(lesson.by_definition.nodes)
    return Template(_PAGE.read_text(encoding="utf-8")).substitute(
        text=theme.TEXT,
        policy=POLICY,
        figure1_plain=_figure("plain", lesson.by_definition, "Figure 1, as it would be drawn. Find the mistake."),
        figure1=_figure(
            "fig1",
            lesson.by_definition,
            f"Figure 1, by definition. Vermillion: {len(lesson.spurious)} of {nodes} nodes are there by mistake.",
            lesson.spurious,
        ),
        figure2=_figure(
            "fig2", lesson.kinetic_only, "Figure 2, kinetic energy only. The spring is out; dt is not.", legend=False
        ),
        figure3=_figure("fig3", lesson.chain_rule, "Figure 3, the chain rule, from the full Lagrangian.", legend=False),
        equation=_equation(lesson.equation),
        spurious=len(lesson.spurious),
        nodes=nodes,
        steps=_steps(lesson.steps),
        arm_error=f"{lesson.arm_error:.2f}",
        arm_torque=f"{lesson.arm_torque:.1f}",
        arm_dt=np.format_float_positional(lesson.arm_dt, trim="-"),
    )


def _figure(name: str, graph: Graph, caption: str, marked: Collection[Node] = (), *, legend: bool = True) -> str:
    """A drawing inside the page, its letters a little larger than the page's.

    Its ids begin with the figure's name, since a page may have each id once.
    """
    svg = render_svg(to_dot(graph, names=theme.ONE_JOINT, marked=marked, clusters=False, legend=legend))
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    about = f'<svg role="img" aria-label="{escape(caption)}"'
    svg = re.sub(
        r'<svg width="(\d+)pt" height="\d+pt"',
        lambda size: f'{about} style="width:{_LETTER * int(size[1]) / theme.FONT_SIZE:.1f}em"',
        svg,
        count=1,
    )
    return f"<figure>{svg}<figcaption>{escape(caption)}</figcaption></figure>"


def _equation(text: str) -> str:
    """An expanded formula such as `I qdd0 - k q0_old`, in the letters of the figures."""
    letters = {name: f"<i>{letter}</i>" for name, letter in (theme.ONE_JOINT | {"I": "I", "k": "k"}).items()}
    letters |= {
        name: f"{letter.removesuffix(' old</i>')}</i><sub>old</sub>"
        for name, letter in letters.items()
        if "old" in letter
    }
    letters["dt"] = "d<i>t</i>"
    words = re.sub(r"\w+", lambda word: letters.get(word[0], word[0]), escape(text).replace("*", " "))
    return words.replace("^2", "²").replace(" - ", " − ")


def _steps(steps: Sequence[tuple[float, float]]) -> str:
    rows = "\n".join(
        f"<tr><td>{np.format_float_positional(dt, trim='-')}</td><td>{torque:.7g}</td></tr>".replace("-", "−")
        for dt, torque in steps
    )
    return (
        "<table><thead><tr><th>d<i>t</i> [s]</th><th><i>τ</i> [N m], should be 0</th></tr></thead>"
        f"<tbody>\n{rows}\n</tbody></table>"
    )
