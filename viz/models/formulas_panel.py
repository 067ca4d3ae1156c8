"""The physics of a model as formulas beside its graph, and what the torque by definition has too much."""

from __future__ import annotations

from dataclasses import replace

from dynamics.scenes import Scene

from ..pages.html import Panel
from .equations import model_equations
from .equations_text import equations_html

LINES = 12  # of each block, at most
STYLE = """
#formulas { padding: 4px 14px; border-top: 1px solid var(--edge); max-height: 46vh; overflow-y: auto; flex: none; }
#formulas h3 { font-size: 1rem; margin: 10px 0 2px; } #formulas p { font-size: 15px; max-width: 75em; }
#formulas math { font-size: 1.05rem; }
#formulas .spurious { border-left: 6px solid var(--wrong); padding-left: 10px; margin: 6px 0; }
#formulas .spurious math, #formulas .spurious h3 { color: color-mix(in srgb, var(--wrong) 78%, var(--text)); }
body:not(:has(#about.flawed)) #formulas > .spurious { display: none; }
@media print { #formulas { max-height: none; overflow: visible; } }
"""
# The formulas are those of the page's model: another record, of a typed system, has its own.
RUN = """
const formulasOf = inspector.record();
inspector.onState(() => { byId("formulas").hidden = inspector.record() !== formulasOf; });
byId("formulas").querySelector("details").ontoggle = () => dispatchEvent(new Event("resize")); // of the picture's room
"""


def formulas_panel(scene: Scene, *, momenta: bool = False) -> Panel:
    """The panel of a scene.  momenta: Hamilton's equations in place of the torque.

    What the torque by definition has too much stands apart, in the color of what is wrong, where the page shows that.
    """
    compare = () if momenta or scene.ode is not None else ("by_definition", "kinetic_only")
    equations = model_equations(scene, momenta=momenta, compare=compare)
    first = next((block for block in equations.blocks if block.wrong), None)
    others = [block for block in equations.blocks if block is not first]
    apart = equations_html(replace(equations, blocks=[first], indices={}), LINES) if first else ""
    whole = equations_html(replace(equations, blocks=others), LINES)
    body = f"<details><summary>Formulas</summary>{whole}</details>"
    return Panel(end=f'<section id="formulas" aria-label="formulas">{apart}{body}</section>', style=STYLE, run=RUN)
