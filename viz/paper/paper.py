"""The paper's figures and tables in one folder, with one page of all: the order of the parts."""

import json
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from types import MappingProxyType

from cgraph._shared import Json

from ..graph_drawing.render import check_can_draw
from ..pages import html
from ..pages.document import Document, Markup, Section, check_folder, to_html
from ..pages.html import asset
from ..plots import plot
from .by_depth import figure7
from .embedding import embedding
from .free_fall import figures4_and_5
from .one_joint import equations, figures_1_to_3
from .part import Part
from .reconfiguration import figure10
from .scaling import scaling_of_counts
from .timing import figure6
from .typeset import typeset

# {what a part is: (what makes it, its argument in a quick run if it has one)}: evaluations of each formulation,
# mechanisms beside those drawn, links of arms and chains.
PARTS: dict[str, tuple[Callable[..., Part], *tuple[object, ...]]] = {
    "Equation (3), read off the graphs term by term": (equations,),
    "Figures 1 to 3: by definition, kinetic only and by the chain rule, on one layout": (figures_1_to_3,),
    "Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo": (figures4_and_5,),
    "Figure 6 and Table 1: the time of one evaluation": (figure6, 100),
    "Figure 7: both forms of the equations of motion, by depth": (figure7, {}),
    "Figure 8: the law of the embedding, torque error against dt": (embedding, (1, 3)),
    "Figure 9: nodes, edges and time over the number of links": (scaling_of_counts, (1, 3, 6, 10, 20)),
    "Figure 10: the first torque after a change of structure": (figure10, (2, 3, 5)),
}


def paper(
    folder: Path,
    say: Callable[[str], None],
    *,
    quick: bool = False,
    beside: Mapping[str, tuple[str, Callable[[], str]]] = MappingProxyType({}),
) -> tuple[dict[Path, str | bytes], dict[str, Json]]:
    """{path: content} of every figure, table and, last, the page, as they go into `folder`; and all figures as data.

    say: called with a line before and after each part.  quick: times of fewer evaluations, and shorter chains.  beside:
    {file: words of the link to it, what makes it} of pages that stand beside this one.
    """
    check_can_draw()
    plot.check_can_plot()
    check_folder(folder)
    parts, files, total = [], dict[Path, str | bytes](), len(PARTS) + len(beside)
    for number, (what, (make, *few)) in enumerate(PARTS.items(), start=1):
        say(f"[{number}/{total}] {what} ...")
        part = make(*few) if quick else make()
        made = part.files()
        files |= {folder / name: content for name, content in made.items()}
        say(f"[{number}/{total}] {', '.join(made)}: ready")
        parts.append(part)
    for number, (name, (what, page)) in enumerate(beside.items(), start=len(PARTS) + 1):
        say(f"[{number}/{total}] {what} ...")
        files[folder / name] = page()
        say(f"[{number}/{total}] {name}: ready")
    data = {name: figures for part in parts for name, figures in part.data.items()}
    files[folder / "figures.json"] = json.dumps(data, indent=1, allow_nan=False) + "\n"
    files[folder / "index.html"] = page_of(parts, {name: what for name, (what, _) in beside.items()})
    return files, data


def page_of(parts: Sequence[Part], links: Mapping[str, str]) -> str:
    """The page of some parts.  links: {file: words} of pages beside it."""
    torque = typeset("τ = d/dt ∂L/∂ω − ∂L/∂θ")
    beside = " · ".join([f'<a href="{escape(name)}">{escape(what)}</a>' for name, what in links.items()])
    text = (
        "<p>A replication of T. Kusaka and T. Tanaka, “A Chain Rule-Based Generalized Framework for Efficient Dynamic Analysis of "
        "Complex Robotic Systems”, Robotics 2025, 14(9), 115, doi:10.3390/robotics14090115. Figures 1 to 6 and Table 1 are numbered as "
        "in the paper, and sections are the paper's; Figures 7 to 10 are not in it. Words, drawings and measurements are ours.</p>"
        f"<p>Lagrange's equation {torque} as a computational graph, in three ways: by definition, with the Euler relation "
        f"{typeset('θ = ω dt + θ_old')} in the graph (wrong); with the kinetic energy {typeset('K')} alone in the first term (right for "
        "one joint, not for three); and by the chain rule (right). Every number on this page was measured when it was made.</p>"
        f"<p>Letters are those of the paper's captions: {typeset('θ')} the angles, {typeset('ω')} their rates, {typeset('α')} the "
        f"accelerations, {typeset('τ')} the torques, {typeset('p = ∂L/∂ω')} the momenta, {typeset('dt')} the time step. In files, "
        "and in the library, θ, ω and α are q0, qd0 and qdd0, and so on.</p>"
        + f"<p>Beside this page: {beside}</p>"
        * bool(beside)
    )
    sections = [Section(part.name, part.heading, part.blocks) for part in parts]
    document = Document("The chain rule keeps θ and ω apart", [Markup(text, "")], sections)
    script = f'"use strict";\n{asset(html.__package__, "elements.js")}{"".join([part.script for part in parts])}{asset(__package__, "stage.js", "fall.js", "modules.js")}'
    data = {name: each for part in parts for name, each in part.moves.items()}
    return to_html(document, asset(__package__, "article.css"), script, data)
