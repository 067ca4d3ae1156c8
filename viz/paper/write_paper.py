"""The paper's figures and tables in one folder, with one page of all: the order of the parts."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from cgraph.extend import atomic_write

from ..graph_drawing.render import check_can_draw
from ..pages import html
from ..pages.write_document import check_writable
from ..plots import plot
from .embedding import embedding
from .free_fall import figures4_and_5
from .one_joint import equations, figure1, figure2, figure3
from .part import Part
from .scaling import scaling_of_counts
from .timing import figure6

QUICK_EVALUATIONS = 100  # of each formulation, for Figure 6
QUICK_LINKS = (1, 2, 3, 6, 10, 20)  # of the chains of the last part


def write_paper(folder: Path, say: Callable[[str], None], *, quick: bool = False) -> dict[str, Any]:
    """Write every figure, table and the page into `folder`, made if it is missing; returns all figures as plain data.

    say: called with a line before and after each part.  quick: times of fewer evaluations, and shorter chains.
    Files are written one by one, each whole or not at all.
    """
    check_can_draw()
    plot.check_can_plot()
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    makers = {
        "Equation (3), read off the graphs term by term": equations,
        "Figure 1: by definition, with the Euler relation embedded": figure1,
        "Figure 2: kinetic energy only": figure2,
        "Figure 3: the chain rule": figure3,
        "The law of the embedding: torque error against dt": embedding,
        "Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo": figures4_and_5,
        "Figure 6 and Table 1: the time of one evaluation": partial(figure6, QUICK_EVALUATIONS) if quick else figure6,
        "Scaling: nodes, edges and time over the number of links": (
            partial(scaling_of_counts, QUICK_LINKS) if quick else scaling_of_counts
        ),
    }
    parts = []
    for number, (what, make) in enumerate(makers.items(), start=1):
        say(f"[{number}/{len(makers)}] {what} ...")
        part = make()
        for name, content in part.files.items():
            atomic_write(folder / name, content)
        say(f"      {', '.join(part.files)}")
        parts.append(part)
    data = {part.name: part.data for part in parts}
    atomic_write(folder / "figures.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
    atomic_write(folder / "index.html", _page(parts))
    say(f"All of it on one page: {folder / 'index.html'}")
    return data


def _page(parts: Sequence[Part]) -> str:
    introduction = html.paragraph(
        "Lagrange's equation as a computational graph, after Kusaka and Tanaka, Robotics 2025, 14(9), 115. Three ways to write "
        "τ = d/dt ∂L/∂qd − ∂L/∂q: by definition with the Euler relation embedded (wrong), with the kinetic energy alone (right "
        "for one joint only), and by the chain rule (right). Every number on this page was measured when it was made."
    )
    return html.page(
        "The chain rule keeps q and qd apart", introduction, [(part.name, part.heading, part.section) for part in parts]
    )
