"""The physics of a model as formulas beside its graph, and what the torque by definition has too much."""

import re
from dataclasses import replace

from cgraph import Node, variable
from dynamics.scenes import Scene

from ..pages.html import Panel
from ..pages.mathml import inline
from .equations import Block, Equations, model_equations
from .equations_text import equations_html

LINES = 12  # of each block, at most
BRIEF = 36  # letters of a formula in the heading
STYLE = """
#formulas:has(details[open]) { padding: 6px 14px; border-top: 1px solid var(--edge); flex: none; }
#formulas:has(details[open]) { max-height: 45vh; overflow-y: auto; }
#formulas h3 { font-size: 1rem; margin: 10px 0 2px; } #formulas p { font-size: 15px; max-width: 75em; }
#formulas math { font-size: 1.05rem; } #formulas summary math { padding: 0; margin-left: .8em; }
#formulas mfrac :is(msub, msup) > :last-child { math-depth: 1; }
#formulas .spurious { border-left: 6px solid var(--wrong); padding-left: 10px; margin: 6px 0; }
#formulas :is(.spurious math, .spurious h3, summary math) { color: color-mix(in srgb, var(--wrong) 78%, var(--text)); }
body:not(:has(#about.flawed)) #formulas :is(.first, summary math) { display: none; }
@media (min-width: 821px) { body:has(#formulas details[open]) main { min-height: 120vh; } }
@media print { #formulas { max-height: none; overflow: visible; } }
"""
# Closed, the panel is a line below the results; open, it is as wide as the page. It is of the page's model: a typed
# system has formulas of its own.
RUN = """
const PAPER = 640; // pixels of its width
const formulas = byId("formulas"), formulasOf = inspector.record(), wideFormulas = formulas.parentElement;
const placeFormulas = (open) => {
  if (open) wideFormulas.append(formulas); else byId("results").parentElement.after(formulas);
};
inspector.onState(() => { formulas.hidden = inspector.record() !== formulasOf; });
formulas.querySelector("details").ontoggle = ({ target }) => {
  placeFormulas(target.open);
  formulas.querySelector("summary").focus();
  dispatchEvent(new Event("resize")); // the picture has other room
};
placeFormulas(false);
// Paper has no scroll bar: what is wider than it is written smaller.
const writeFormulas = (widest) => {
  for (const each of formulas.querySelectorAll(".scroll > math")) {
    each.style.fontSize = "";
    const { width } = each.getBoundingClientRect();
    if (width > widest) each.style.fontSize = `${widest / width}em`;
  }
};
addEventListener("beforeprint", () => writeFormulas(PAPER));
addEventListener("afterprint", () => writeFormulas(Infinity));
"""


def formulas_panel(scene: Scene, *, momenta: bool = False) -> Panel:
    """The panel of a scene.  momenta: Hamilton's equations in place of the torque.

    What the torque by definition has too much stands first, in the color of what is wrong, and in short beside the
    heading, where the page shows a version that is wrong.
    """
    compare = () if momenta or scene.ode is not None else ("by_definition", "kinetic_only")
    equations = model_equations(scene, of="momenta" if momenta else "torque", compare=compare)
    first = next((block for block in equations.blocks if block.wrong), None)
    others = replace(equations, blocks=[each for each in equations.blocks if each is not first])
    head, inside = "", equations_html(others, LINES)
    if first is not None:
        head, alone = _in_short(first, equations), replace(equations, blocks=[first], indices={})
        inside = f'<div class="first">{equations_html(alone, LINES)}</div>{inside}'
    body = f"<details><summary>Formulas{head}</summary>{inside}</details>"
    return Panel(end=f'<section id="formulas" aria-label="formulas" hidden>{body}</section>', style=STYLE, run=RUN)


def _in_short(block: Block, equations: Equations) -> str:
    """The one statement of a block, if it is short, else what all of them are."""
    *lefts, right = block.statements[0]
    surplus, general = variable("tau_def") - variable("tau"), len(lefts) == 1
    if (general or len(block.statements) == 1) and isinstance(right, Node):
        whole = inline(block.statements[0], equations.names)
        if len(re.sub("<[^>]*>", "", whole)) <= BRIEF:
            return whole
    slopes = [each.args[0] / variable("∂q") for each in lefts[1:] if isinstance(each, Node)]
    return inline([surplus, *slopes], equations.names)
