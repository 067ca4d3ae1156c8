"""The law of the embedding: the error of the torque against the time step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynamics.experiments.paper_numbers import EmbeddingError, embedding_errors

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots.direct_labels import Line, PlotPanel, labeled
from .part import Part, plotted

LINKS = (1, 2, 3, 6)


def embedding(links: Sequence[int] = LINKS) -> Part:
    """The law of the embedding: torque error against dt.  links: of the arms."""
    laws = embedding_errors(links)
    header = ("formulation", "links", "slope", "largest entry of the limit [N m]", "error at dt = 1e-6 s [N m]")
    rows = [
        (
            TITLES[law.formulation],
            str(law.n),
            f"{law.slope:.3f}" if np.isfinite(law.slope) else "exact",
            f"{np.abs(law.limit).max():.4g}",
            f"{law.error[-1]:.4g}",
        )
        for law in laws
    ]
    caption = (
        "Left: the error does not vanish with dt. Right: the distance to τ + ∂L/∂q (by definition) and to τ + ∂K/∂q "
        "(kinetic only) vanishes with slope 1. Random states of planar arms."
    )
    blocks: list[Block] = [
        Paragraph(
            "A smaller time step does not help: by definition the whole term ∂L/∂q is lost, kinetic only the part ∂K/∂q.",
            point=True,
        ),
        plotted("law", labeled(_panels(laws), shared=False, room=0.5), caption),
        Table("The law of the embedding", header, rows, file="law"),
        Paragraph(
            "Kinetic only is exact for one joint, where K does not depend on q, and wrong for a real arm under this plain "
            "embedding. It is exact again if the momentum is taken before the relation is embedded. The paper calls its "
            "kinetic-only method accurate on three links; its program is not public, so which of the two it is is not known."
        ),
    ]
    data = {
        f"{law.formulation} n={law.n}": {
            "slope": law.slope if np.isfinite(law.slope) else None,
            "limit": float(np.abs(law.limit).max()),
        }
        for law in laws
    }
    return Part("law", "How wrong, and why dt does not help", blocks, data)


def _panels(laws: Sequence[EmbeddingError]) -> list[PlotPanel]:
    """The errors, and the distances from their limits beside a line of slope 1."""
    x = "dt [s] (smaller to the right)"
    panels = []
    for title, of in (("error of the torque", "error"), ("distance from its limit", "distance")):
        lines = [
            Line(f"{TITLES[law.formulation]}, n = {law.n}", law.dt.tolist(), getattr(law, of).tolist(),
                 COLORS[TITLES[law.formulation]], law.formulation == "kinetic_only")
            for law in laws
            if getattr(law, of).min() > 0.0
        ]  # fmt: skip
        panels.append(PlotPanel(title, x, "largest |Δτ| [N m]", lines))
    steps = laws[0].dt.tolist()
    top = 4.0 * max(max(line.y) for line in panels[1].lines)
    panels[1].lines.append(Line("slope 1", steps, [top * dt / steps[0] for dt in steps], None))
    return panels
