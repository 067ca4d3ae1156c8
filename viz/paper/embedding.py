"""The law of the embedding: the error of the torque against the time step."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics import inverse_dynamics, planar_arm
from dynamics.experiments.timing import exponent
from dynamics.systems.model import Model, as_system

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots.direct_labels import Line, PlotPanel, labeled
from .part import Part, plotted

STEPS = tuple(10.0 ** (-k / 2) for k in range(4, 13))  # s, 1e-2 to 1e-6


@dataclass(frozen=True)
class EmbeddingError:
    """At one state of an arm: how far a formulation's torque is from the true one, and from its limit, at `STEPS`.

    error, distance: largest entries [N m] at each step.  limit: the largest of the part that stays as dt -> 0.
    slope: fitted power of dt in `distance`; None where it is exact.
    """

    formulation: str
    n: int
    error: list[float]  # |tau_formulation - tau|
    distance: list[float]  # |tau_formulation - (tau + limit)|
    limit: float  # of dL/dq by definition, dK/dq for kinetic only
    slope: float | None


def embedding_error(model: Model, q: Array, qd: Array, qdd: Array, formulation: str) -> EmbeddingError:
    """The error at the state (q, qd, qdd), each (n,), for "by_definition" or "kinetic_only"."""
    system = as_system(model)
    energy = {"by_definition": system.lagrangian, "kinetic_only": system.kinetic}[formulation]
    parameters = list(system.parameters.values())
    true = cg.compile(inverse_dynamics(system, "chain_rule"))(np.concatenate([q, qd, qdd, parameters]))
    slopes = cg.jacobian(system.graph({"E": energy}, system.q, system.qd), wrt=system.q)
    limit = cg.compile(slopes)(np.concatenate([q, qd, parameters]))
    flawed = cg.compile(inverse_dynamics(system, formulation))
    error, distance = [], []
    for dt in STEPS:
        tau = flawed(np.concatenate([q - qd * dt, qd - qdd * dt, qdd, [dt], parameters]))
        error.append(float(np.abs(tau - true).max()))
        distance.append(float(np.abs(tau - true - limit).max()))
    fitted = exponent(STEPS, distance) if min(distance) > 0 else None
    return EmbeddingError(formulation, system.n, error, distance, float(np.abs(limit).max()), fitted)


def embedding(links: Sequence[int] = (1, 2, 3, 6)) -> Part:
    """The law of the embedding: torque error against dt, at a random state of an arm of each number of links."""
    rng, laws = np.random.default_rng(0), list[EmbeddingError]()
    for n in links:
        arm = planar_arm(rng.uniform(0.5, 1.5, n).tolist(), rng.uniform(0.5, 1.5, n).tolist())
        q, qd, qdd = rng.uniform(-1.0, 1.0, (3, n))
        laws += [embedding_error(arm, q, qd, qdd, formulation) for formulation in ("by_definition", "kinetic_only")]
    header = ("formulation", "links", "slope", "largest entry of the limit [N m]", "error at dt = 1e-6 s [N m]")
    rows = [
        (
            TITLES[law.formulation],
            str(law.n),
            "exact" if law.slope is None else f"{law.slope:.3f}",
            f"{law.limit:.4g}",
            f"{law.error[-1]:.4g}",
        )
        for law in laws
    ]
    caption = (
        "Figure 8. Not in the paper: the torque's error against dt, at random states of planar arms of n links. Left: the error does "
        "not vanish with dt. Right: the distance to τ + ∂L/∂θ (by definition) and to τ + ∂K/∂θ (kinetic only) does, with slope 1."
    )
    most = max(laws, key=lambda law: law.error[-1])
    seen = (
        f"Left, lines that stay level from dt = {STEPS[0]:g} to {STEPS[-1]:g} s, the highest {TITLES[most.formulation]} with "
        f"n = {most.n} at {most.error[-1]:.3g} N m. Right, lines that fall in parallel with one of slope 1."
    )
    blocks: list[Block] = [
        Paragraph(
            "A smaller time step does not help: by definition the whole term ∂L/∂θ is lost, kinetic only the part ∂K/∂θ.",
            point=True,
        ),
        plotted("law", labeled(_panels(laws), shared=False, room=0.5), caption, seen),
        Table("The error and its limit as dt tends to 0", header, rows, file="law"),
        Paragraph(
            "Kinetic only is exact for one joint, where K does not depend on θ, and wrong for an arm of several links under this plain "
            "embedding. It is exact again if the momentum is taken before the relation is embedded. The paper calls its "
            "kinetic-only method accurate on three links (Table 1). Its program is not public: it may have done either."
        ),
    ]
    data = {f"{law.formulation} n={law.n}": {"slope": law.slope, "limit": law.limit} for law in laws}
    return Part("law", "Figure 8: why a smaller dt does not help", blocks, {"law": data})


def _panels(laws: Sequence[EmbeddingError]) -> list[PlotPanel]:
    """The errors, and the distances from their limits beside a line of slope 1."""
    x = "dt [s] (smaller to the right)"
    panels = []
    for title, of in (("error of the torque", "error"), ("distance from its limit", "distance")):
        lines = [
            Line(f"{TITLES[law.formulation]}, n = {law.n}", STEPS, getattr(law, of),
                 COLORS[TITLES[law.formulation]], law.formulation == "kinetic_only")
            for law in laws
            if min(getattr(law, of)) > 0.0
        ]  # fmt: skip
        panels.append(PlotPanel(title, x, "largest |Δτ| [N m]", lines))
    top = 4.0 * max(max(line.y) for line in panels[1].lines)
    panels[1].lines.append(Line("slope 1", STEPS, [top * dt / STEPS[0] for dt in STEPS], None))
    return panels
