"""The paper's figures and tables in one folder, with one page of all: the order of the parts."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cgraph.extend import Json

from ..graph_drawing.render import check_can_draw
from ..pages.document import Document, Paragraph, Section, check_folder, to_html
from ..plots import plot
from .by_depth import figure7
from .embedding import embedding
from .free_fall import figures4_and_5
from .one_joint import equations, figure, sizes
from .part import Part
from .scaling import scaling_of_counts
from .timing import figure6

QUICK_EVALUATIONS = 100  # of each formulation, for Figure 6
QUICK_ARMS = (1, 3)  # links, for the law of the embedding
QUICK_LINKS = (1, 3, 6, 10, 20)  # of the chains of the scaling


class Paper(NamedTuple):
    """files: {path: content}, the page last.  data: all figures as plain data."""

    files: dict[Path, str | bytes]
    data: Mapping[str, Json]


def paper(folder: Path, say: Callable[[str], None], *, quick: bool = False) -> Paper:
    """Every figure, table and the page, as they go into `folder`.

    say: called with a line before and after each part.  quick: times of fewer evaluations, and shorter chains.
    """
    check_can_draw()
    plot.check_can_plot()
    check_folder(folder)
    makers: dict[str, Callable[[], Part]] = {
        "Equation (3), read off the graphs term by term": equations,
        "Figure 1: by definition, with the Euler relation embedded": partial(figure, "fig1"),
        "Figure 2: kinetic energy only": partial(figure, "fig2"),
        "Figure 3: the chain rule": partial(figure, "fig3"),
        "Sizes of these graphs, and of those of the whole torque": sizes,
        "The law of the embedding: torque error against dt": partial(embedding, QUICK_ARMS) if quick else embedding,
        "Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo": figures4_and_5,
        "Figure 6 and Table 1: the time of one evaluation": partial(figure6, QUICK_EVALUATIONS) if quick else figure6,
        "Scaling: nodes, edges and time over the number of links": (
            partial(scaling_of_counts, QUICK_LINKS) if quick else scaling_of_counts
        ),
        "Figure 7: both forms of the equations of motion, by depth": partial(figure7, {}) if quick else figure7,
    }
    parts, files = [], dict[Path, str | bytes]()
    for number, (what, make) in enumerate(makers.items(), start=1):
        say(f"[{number}/{len(makers)}] {what} ...")
        part = make()
        made = part.files()
        files |= {folder / name: content for name, content in made.items()}
        say(f"[{number}/{len(makers)}] {', '.join(made)}: ready")
        parts.append(part)
    data = {part.name: part.data for part in parts}
    files[folder / "figures.json"] = json.dumps(data, indent=1, allow_nan=False) + "\n"
    files[folder / "index.html"] = _page(parts)
    return Paper(files, data)


def _page(parts: Sequence[Part]) -> str:
    introduction = Paragraph(
        "Lagrange's equation as a computational graph, after Kusaka and Tanaka, Robotics 2025, 14(9), 115. Three ways to write "
        "τ = d/dt ∂L/∂qd − ∂L/∂q: by definition with the Euler relation embedded (wrong), with the kinetic energy alone (right "
        "for one joint only), and by the chain rule (right). Every number on this page was measured when it was made."
    )
    sections = [Section(part.name, part.heading, part.blocks) for part in parts]
    return to_html(Document("The chain rule keeps q and qd apart", [introduction], sections))
