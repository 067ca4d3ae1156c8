"""Formulations of Lagrange's equation on pages: what they are called, and the one table of their sizes."""

from collections.abc import Mapping, Sequence

from cgraph._shared import counted

from .. import theme
from .document import Table

TITLES = {
    "by_definition": "by definition",
    "kinetic_only": "kinetic only",
    "chain_rule": "chain rule",
    "chain_rule_literal": "chain rule, literal",
    "kinetic_only_exact": "kinetic only, exact",
    "newton_euler": "Newton-Euler",
}
COLORS = {TITLES[name]: color for name, color in theme.FORMULATIONS.items()}
WHY_FEWER = (
    "The torque has fewer spurious nodes than its inertial term, because −∂L/∂q and all that it needs belong to the "
    "torque anyway. Besides, the momentum p is an output of the inertial term alone."
)


def size_table(sizes: Mapping[tuple[str, str], Sequence[int]]) -> Table:
    """The sizes of each term by each formulation, {(term, formulation): (nodes, edges, depth, spurious ones, missing)}.

    Sizes are those of `dynamics.formulation_sizes`.
    """
    rows, kinds = [], ("node", "edge", "missing term")
    for (term, formulation), found in sizes.items():
        mistakes = [counted(count, kind) for count, kind in zip(found[3:], kinds, strict=True) if count]
        counts = [str(count) for count in found[:3]]
        rows.append([f"{theme.pretty(term)}, {TITLES[formulation]}", *counts, ", ".join(mistakes) or "none"])
    return Table("Sizes of the graphs", ["", "nodes", "edges", "depth", "there by mistake"], rows)
