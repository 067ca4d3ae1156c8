"""Formulations of Lagrange's equation on pages: what they are called, and the one table of their sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .. import theme
from .document import Table

TITLES = {
    "euler_embedded": "by definition",
    "kinetic_only": "kinetic only",
    "chain_rule": "chain rule",
    "chain_rule_literal": "chain rule, literal",
    "kinetic_only_exact": "kinetic only, exact",
}
COLORS = {TITLES[name]: color for name, color in theme.FORMULATIONS.items()}
WHY_FEWER = (
    "The torque counts fewer nodes as mistakes than its inertial term: −∂L/∂q stands in it by right, and what −∂L/∂q "
    "needs is there by right, too. Besides, the momentum p is an output of the inertial term alone."
)


def size_table(sizes: Mapping[tuple[str, str], Sequence[int]]) -> Table:
    """The sizes of each term by each formulation, {(term, formulation): (nodes, edges, depth, spurious ones)}.

    Sizes are those of `dynamics.formulation_sizes`.
    """
    rows = [
        [
            f"{theme.pretty(term)}, {TITLES[formulation]}",
            *[str(count) for count in counts],
            f"{nodes} nodes, {edges} edges" if nodes else "none",
        ]
        for (term, formulation), (*counts, nodes, edges) in sizes.items()
    ]
    return Table("Sizes of the graphs", ["", "nodes", "edges", "depth", "there by mistake"], rows)
