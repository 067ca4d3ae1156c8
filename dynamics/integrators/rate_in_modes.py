"""Rate in modes: one that jumps or kinks as a smooth one, whose sides of switching surfaces are inputs, its modes.

Where g passes zero, sign(g), |g|, a < b, max(a, b) and their kin take another piece. A mode says which side of such a
surface holds: -1 or 1, or n of a floor. In a slide, of a mode half way between two sides, the rate is mixed from
those of both so that g stays zero (Filippov 1988): f = f_0 + sum_j w_j (f_j - f_0), with shares 0 <= w <= 1 of f_j,
which differs from f_0 in the side of surface j.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import SMOOTH, intervals, kept_by_first
from cgraph.extend import Builder, building, folded, topological

from ..systems.arguments import new_variables
from ..systems.kinematics import changes, numbered_graph
from ..systems.model import display_names
from .problem import Problem
from .switches import Switches

STEPS = {"floor": (1.0, 0.0), "ceil": (-1.0, 0.0), "round": (1.0, 0.5)}  # s floor(s a + offset): s, offset
PIECES: dict[str, Callable[[Node, Node, Node], Node]] = {  # by the side of a, or of a - b
    "sign": lambda side, a, b: side,
    "abs": lambda side, a, b: side * a,
    "less": lambda side, a, b: 0.5 * (1.0 - side),
    "less_equal": lambda side, a, b: 0.5 * (1.0 - side),
    "minimum": lambda side, a, b: cg.where(0.5 * (1.0 - side), a, b),
    "maximum": lambda side, a, b: cg.where(0.5 * (1.0 - side), b, a),
}
TINY = 1e-290  # taken from a pivot, that may be zero where a force begins: shares of such are lost in any case
SWITCHED = {"fmod", *PIECES, *STEPS}


@kept_by_first
def switched(problem: Problem) -> Problem:
    """The problem in modes; the same object where the rate is smooth, or has solvers of its own."""
    if problem.missing is not None or not any([node.op.name in SWITCHED for node in problem.evaluation.called.nodes]):
        return problem
    reader = _Reader(problem)
    rates = reader.read(list(problem.rate.outputs.values()))
    used = reader.used(rates)
    if not used:
        return problem
    inputs = [*problem.rate.inputs, *[surface.mode for surface in used]]
    over = [surface.gap for surface in used]
    margins, turns = list[Node](), list[tuple[int, int]]()
    with building(reader.build):
        for k, surface in enumerate(used):
            if surface.spacing == 1.0:
                margins += [surface.gap, 1.0 - surface.gap]
                turns += [(k, -1), (k, 1)]
            else:
                margins.append(surface.mode * surface.gap)
                turns.append((k, 0))
    names = tuple([str(surface.mode.name) for surface in used])
    switches = Switches(
        names,
        numbered_graph(inputs, [surface.quantity for surface in used]),
        tuple([surface.spacing for surface in used]),
        tuple([surface.is_sign for surface in used]),
        numbered_graph(inputs, over),
        numbered_graph(inputs, margins),
        tuple(turns),
        display_names(problem.model),
    )
    outputs = dict(zip(problem.rate.outputs, rates, strict=True))
    wide = ("projection", "multipliers", "velocities", "momentum")
    more: dict[str, Any] = {name: _widened(getattr(problem, name), names) for name in wide}
    parameters = (*problem.parameters, *names)
    return replace(problem, parameters=parameters, rate=Graph(inputs, outputs), switches=switches, **more)


def _widened(graph: Graph | None, names: Sequence[str]) -> Graph | None:
    """The graph with inputs besides that it does not use."""
    return graph and Graph([*graph.inputs, *cg.variables(list(names))], graph.outputs)


@dataclass
class _Surface:
    """A surface that was read: its mode, the quantity, and this less the n of a floor."""

    mode: Node
    quantity: Node
    gap: Node
    spacing: float
    is_sign: bool = False


class _Reader:
    """Reads nodes into modes."""

    def __init__(self, problem: Problem, known: Switches | None = None) -> None:
        self.build, self._taken = Builder(), [*problem.rate.input_names]
        self._surfaces: dict[tuple[Node, float], _Surface] = {}
        self._shared, self._known = Builder(), dict[tuple[Node, float], Node]()
        if known is not None:
            surfaces = folded(list(known.surfaces.outputs.values()), self._shared)
            of = zip(surfaces, known.spacing, cg.variables(list(known.modes)), strict=True)
            self._known = {(g, spacing): mode for g, spacing, mode in of}

    def read(self, nodes: Sequence[Node]) -> list[Node]:
        """Copies of nodes with modes in place of what switches."""
        new: dict[Node, Node] = {}
        with building(self.build) as labelled:
            for node in topological(nodes):
                if not node.args:
                    new[node] = node
                    continue
                labelled(node.label)
                args = [new[arg] for arg in node.args]
                is_read = node.op.name in SWITCHED and SMOOTH not in node.roles
                made = self._piece(node.op.name, args) if is_read else None
                new[node] = self.build(node.op, tuple(args), node.label, node.name) if made is None else made
        return [new[node] for node in nodes]

    def used(self, rates: Sequence[Node]) -> list[_Surface]:
        """Surfaces that rates depend on, or others of these, in the order in which they were read."""
        surfaces, reached = [*self._surfaces.values()], set(topological(rates))
        for surface in reversed(surfaces):  # gaps depend on earlier modes
            if surface.mode in reached:
                reached.update(topological([surface.gap]))
        return [surface for surface in surfaces if surface.mode in reached]

    def _piece(self, name: str, args: list[Node]) -> Node | None:
        """The piece of an operation that modes choose; None where it never switches."""
        if all([arg.value is not None for arg in args]):
            return None
        a, b = args[0], args[-1]
        if name in STEPS:
            sign, offset = STEPS[name]
            step = self._surface(sign * a + offset, 1.0)
            return None if step is None else sign * step.mode
        if name == "fmod":
            quotient = a / b
            side = self._side(quotient)
            step = None if side is None else self._surface(side * quotient, 1.0)
            return None if side is None or step is None else a - b * (side * step.mode)
        side = self._side(a if len(args) == 1 else a - b, is_sign=name == "sign")
        return None if side is None else PIECES[name](side, a, b)

    def _side(self, g: Node, *, is_sign: bool = False) -> Node | None:
        """The sign of g as a mode, shared by what is g but for a constant factor; None where it is never zero."""
        sign = 1.0
        while True:
            if g.op.name == "neg":
                g, sign = g.args[0], -sign
            elif g.op.name == "mul" and (factor := g.args[0].value):
                g, sign = g.args[1], math.copysign(sign, factor * sign)
            elif g.op.name == "sub" and (g.args[0].value is not None or g.args[0].serial > g.args[1].serial):
                g, sign = g.args[1] - g.args[0], -sign
            else:
                break
        if g.value is not None:
            return cg.constant(math.copysign(sign, g.value * sign)) if g.value else None
        low, high = intervals(topological([g]), {})[g]
        if low > 0.0 or high < 0.0:
            return None
        if (surface := self._surface(g, 2.0)) is None:
            return None
        surface.is_sign |= is_sign
        return surface.mode if sign > 0.0 else -surface.mode

    def _surface(self, g: Node, spacing: float) -> _Surface | None:
        """The surface of a quantity; None of one that is not among those that are known, if some are."""
        if (g, spacing) not in self._surfaces:
            mode = self._known.get((folded([g], self._shared)[0], spacing)) if self._known else None
            if mode is None and self._known:
                return None
            if mode is None:
                (mode,) = new_variables("mode", 1, self._taken)
                self._taken.append(str(mode.name))
            self._surfaces[g, spacing] = _Surface(mode, g, g if spacing == 2.0 else g - mode, spacing)
        return self._surfaces[g, spacing]


@kept_by_first
def in_modes(problem: Problem, graph: Graph) -> Graph:
    """Another graph over states, t and parameters, of which what switches as the rate does is in its modes."""
    if problem.switches is None:
        return graph
    reader = _Reader(problem, problem.switches)
    return Graph(graph.inputs, dict(zip(graph.outputs, reader.read(list(graph.outputs.values())), strict=True)))


def rows_in_modes(problem: Problem, make: Callable[[], Graph], among: frozenset[int]) -> Graph:
    """A graph over states of the model, t and parameters as one over those of a problem in modes, mixed in slides."""
    rate, graph = problem.rate, make()
    more = in_modes(problem, problem.observed(graph.outputs)).outputs.values()
    outputs = {**rate.outputs, **{f"row {name}": node for name, node in zip(graph.outputs, more, strict=True)}}
    slid = replace(problem, rate=Graph(rate.inputs, outputs))
    nodes = [*(sliding(slid, among) if among else slid).rate.outputs.values()]
    return Graph(rate.inputs, dict(zip(graph.outputs, nodes[problem.size :], strict=True)))


@kept_by_first
def sliding(problem: Problem, among: frozenset[int]) -> Problem:
    """A problem in modes that slides on those surfaces, `among` others, whose modes are half way between two sides.

    Its parameters are the same; what the rate has besides those of states is mixed, too. Each step ends on the
    surfaces, moved there along the difference of the rates.
    """
    switches = problem.switches
    assert switches is not None
    build, m, inputs, spacing = Builder(), problem.size, problem.rate.inputs, switches.spacing
    modes, states = inputs[len(inputs) - len(switches.modes) :], list(inputs[:m])
    rates, gaps = list(problem.rate.outputs.values()), list(switches.gaps.outputs.values())
    chosen = sorted(among)
    with building(build):
        # of a mode that slides, h = 1, the lower side, else its own
        place = {k: _slides(modes[k], spacing[k]) for k in chosen}
        lower = {modes[k]: modes[k] - 0.5 * spacing[k] * hold for k, hold in place.items()}
    holds, read = [*place.values()], [*rates, *[gaps[k] for k in chosen]]
    sides = [lower, *[lower | {modes[k]: lower[modes[k]] + spacing[k] * hold} for k, hold in place.items()]]
    first, *others = [folded(read, build, side) for side in sides]
    f, g = first[: len(rates)], first[len(rates) :]
    ways = dict(zip(states, f, strict=False)) | {inputs[m]: cg.constant(1.0)}
    with building(build):
        # g of the upper end of a floor's lower side
        g = [gap - hold if spacing[k] == 1.0 else gap for k, hold, gap in zip(chosen, holds, g, strict=True)]
        jumps = [[there - here for there, here in zip(other, f, strict=False)] for other in others]
    directions = [ways, *[dict(zip(states, jump, strict=False)) for jump in jumps]]
    drift, *columns_of = [_along(g, direction, build) for direction in directions]
    # a jump that does not move its g itself, as that of an acceleration by a position, moves the rate of g
    if late := [k for k, column in enumerate(columns_of) if column[k].value == 0.0]:
        g = [drift[k] if k in late else gap for k, gap in enumerate(g)]
        drift, *columns_of = [_along(g, direction, build) for direction in directions]
    surfaces = list(switches.surfaces.outputs.values())
    with building(build):
        matrix = [
            [cg.where(holds[i] * holds[j], column[i], 1.0 if i == j else 0.0) for j, column in enumerate(columns_of)]
            for i in range(len(chosen))
        ]
        rights = [[cg.where(h, -value, 0.0) for h, value in zip(holds, part, strict=True)] for part in (drift, g)]
        shares, moves = _solved(matrix, rights)
        rate = [_mixed(each, shares, [jump[i] for jump in jumps]) for i, each in enumerate(f)]
        onto = [_mixed(each, moves, [jump[i] for jump in jumps]) for i, each in enumerate(states)]
        _pin(rate, onto, inputs, [(surfaces[k], hold) for k, hold in place.items() if spacing[k] == 2.0], build)
        turns, margins = list(switches.turns), list(switches.margins.outputs.values())
        margins = [cg.where(place[k], 1.0, g) if k in place else g for (k, _), g in zip(turns, margins, strict=True)]
        for k, hold, share in zip(chosen, holds, shares, strict=True):
            margins += [cg.where(hold, share, 1.0), cg.where(hold, 1.0 - share, 1.0)]
            turns += [(k, -1), (k, 1)]
    made = replace(switches, margins=numbered_graph(inputs, margins), turns=tuple(turns), ends=2 * len(chosen))
    project = numbered_graph(inputs, onto)
    if problem.projection is not None:
        before = dict(zip(states, problem.projection.outputs.values(), strict=True))
        project = numbered_graph(inputs, folded(onto, build, before))
    outputs = dict(zip(problem.rate.outputs, rate, strict=True))
    return replace(problem, rate=Graph(inputs, outputs), projection=project, switches=made, slides=True)


def _pin(
    rate: list[Node], onto: list[Node], inputs: Sequence[Node], held: Sequence[tuple[Node, Node]], build: Builder
) -> None:
    """States that stay on a surface g = 0, a sum of constants times states, where hold is 1: they do so exactly.

    Those that are at rest are then without rounding, which would be all that there is of them.
    """
    states, t, pinned = inputs[: len(onto)], inputs[len(onto)], set[int]()
    for g, hold in sorted(held, key=lambda each: len(topological([each[0]]))):
        slopes = [_along([g], {state: cg.constant(1.0)}, build)[0].value for state in states]
        numbers = {i: slope for i, slope in enumerate(slopes) if slope}
        free = [i for i in numbers if i not in pinned]
        if not free or None in slopes:
            continue
        i = free[-1]
        pinned.add(i)
        (way,) = _along([g], {t: cg.constant(1.0)}, build)
        (off,) = folded([g], build, dict(zip(states, onto, strict=True)))
        for j, number in numbers.items():
            if j != i:
                way = way + number * rate[j]
        rate[i] = cg.where(hold, -way / numbers[i], rate[i])
        onto[i] = cg.where(hold, onto[i] - off / numbers[i], onto[i])


def _slides(mode: Node, spacing: float) -> Node:
    """1 where a mode is half way between two sides, else 0."""
    return 1.0 - mode * mode if spacing == 2.0 else 2.0 * (mode - cg.floor(mode))


def _along(g: Sequence[Node], seeds: Mapping[Node, Node], build: Builder) -> list[Node]:
    """The derivatives of quantities along a direction."""
    return changes({node: seed for node, seed in seeds.items() if seed.value != 0.0}, g, build)


def _mixed(start: Node, shares: Sequence[Node], jumps: Sequence[Node]) -> Node:
    """start + sum of share * jump."""
    for share, jump in zip(shares, jumps, strict=True):
        start = start + share * jump
    return start


def _solved(matrix: list[list[Node]], rights: list[list[Node]]) -> list[list[Node]]:
    """The solutions of A w = b for several b, by elimination in the order as it is, of pivots below zero or at zero."""
    n, pivots = len(matrix), list[Node]()
    for k in range(n):
        pivots.append(matrix[k][k] - TINY)
        for i in range(k + 1, n):
            factor = matrix[i][k] / pivots[k]
            if factor.value == 0.0:
                continue
            matrix[i] = [a - factor * b for a, b in zip(matrix[i], matrix[k], strict=True)]
            for right in rights:
                right[i] = right[i] - factor * right[k]
    for right in rights:
        for k in reversed(range(n)):
            for j in range(k + 1, n):
                right[k] = right[k] - matrix[k][j] * right[j]
            right[k] = right[k] / pivots[k]
    return rights
