"""Nodes that AD of the energy carries: those of the chain rule that equations by velocities do not have, and why."""

from __future__ import annotations

from collections import Counter

import cgraph as cg
from dynamics.equations.formulations.node_classes import formulation_classes
from dynamics.equations.formulations.verdict import formulation_verdict
from dynamics.scenes import Scene

from .. import theme
from ..pages.document import Table

BOTH = ("chain_rule", "newton_euler")


def carried(scene: Scene) -> Table | None:
    """The nodes that only the chain rule has, counted by part of the model and by what they are; None where none is.

    The classes are those of `cgraph compare`: the rates of slopes are what -dL/dq cancels in part.
    """
    verdicts = [formulation_verdict(scene, name) for name in BOTH]
    left, right = (each.graph for each in verdicts)
    classes = cg.compare(left, right, classify=formulation_classes(verdicts)).classes("left")
    counts = {tuple(name.rpartition(": ")[::2]): count for name, count in classes.items()}
    if not counts:
        return None
    of_part, of_kind = Counter[str](), Counter[str]()
    for (part, kind), count in counts.items():
        of_part[part] += count
        of_kind[kind] += count
    kinds = [kind for kind, _ in of_kind.most_common()]
    rows = []
    for part in sorted(of_part, key=lambda part: (not part, theme.natural_order(part))):
        cells = [str(counts.get((part, kind), "")) for kind in kinds]
        rows.append([part or "no part", *cells, str(of_part[part])])
    rows.append(["all", *[str(of_kind[kind]) for kind in kinds], f"{of_part.total()}"])
    caption = (
        f"What AD of the energy carries: of {len(left.nodes)} nodes by the chain rule these {of_part.total()} are not "
        f"among the {len(right.nodes)} of equations by velocities, which never build what cancels"
    )
    return Table(caption, ["nodes of", *map(theme.pretty, kinds), "all"], rows)
