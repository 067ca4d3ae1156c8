"""Switches: the surfaces on which a rate jumps or kinks, and the modes that say which side of each holds."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, Names, folded

LONGEST_WORDS = 60  # characters of a surface


@dataclass(frozen=True, eq=False)
class Switches:
    """The surfaces of a problem in modes, which are its last parameters. Graphs are over states, t and parameters."""

    modes: tuple[str, ...]
    surfaces: Graph  # g, over the inputs of the rate and earlier modes
    spacing: tuple[float, ...]  # from one side to the next: 2, or 1 of a whole number
    signs: tuple[bool, ...]  # whether the rate has the sign of g as such, as friction has
    gaps: Graph  # g, less the n of a floor: zero at the lower end of a side, in a slide at the surface
    margins: Graph  # positive where the modes hold
    turns: tuple[tuple[int, int], ...]  # of each margin, the mode that turns where it is zero, and whether up or down
    called: Mapping[str, str]  # {name of an input: what a person calls it}
    ends: int = 0  # of the last margins, how many are of shares of slides, each 1 where its surface is not slid on

    @cached_property
    def sides(self) -> list[Node]:
        """The side of each surface at a state, over the inputs alone."""
        known: dict[Node, Node] = {}
        for mode, g, spacing in zip(
            cg.variables(list(self.modes)), self.surfaces.outputs.values(), self.spacing, strict=True
        ):
            (plain,) = folded([g], Builder(), known)
            known[mode] = cg.sign(plain) if spacing == 2.0 else cg.floor(plain)
        return list(known.values())

    @cached_property
    def words(self) -> tuple[str, ...]:
        """The surfaces as formulas, such as "qd.x", or "floor(t)"; dots stand for what is long, with its tags."""
        names = Names(Graph(self.gaps.inputs, {f"{k}": side for k, side in enumerate(self.sides)}), self.called)
        texts = list[str]()
        for side, surface in zip(self.sides, self.surfaces.outputs.values(), strict=True):
            g = side if side.op.name == "floor" else side.args[0]
            first = g.args[0].value if g.op.name == "add" else None
            text = names.text(g if first is None else g.args[1], LONGEST_WORDS)
            text += "" if first is None else f" {'-' if first < 0.0 else '+'} {abs(first):.6g}"
            text, shortened = re.subn(r"%\d+", "..", text)
            texts.append(f"{text} of {', '.join(sorted(surface.tags))}" if shortened and surface.tags else text)
        return tuple(texts)
