"""State sizes: which components of a state can be compared, and how large those of a kind are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, rounding_noise

from ...equations.state_equation import state_inputs
from ...integrators import Problem
from ...systems.evaluation import ByRows
from ...systems.kinematics import numbered_graph
from .row_values import values_of

Flags = np.ndarray[Any, np.dtype[np.bool_]]

OTHERS = 1e-4  # of the largest component of its kind, below which one counts as no smaller: it may be rounding
MOVES = 10.0  # times what rounding does to a rate: one beyond is not rounding alone
ROUNDING_SIZE = 1e-10  # of the largest component of its kind: where one is that small, rounding is no error of it


@dataclass(frozen=True, eq=False)
class StateKinds:
    """Components of a state that can be compared, (m,) each."""

    kinds: tuple[int, ...]  # the same number for those of one kind, as coordinates
    groups: tuple[int, ...]  # the same for those of one quantity, as a quaternion
    lengths: tuple[float, ...]  # what 1 stands for beside 1 of others of its kind, see `System.lengths`
    ordinary: bool  # whether it is that of a first-order system, whose components may all round each other
    moved: tuple[tuple[int, ...], ...]  # of a velocity the coordinates that velocities like it move; () of all else
    floor: Graph | None = None  # what rounding moves a state by in a time, (1) to (m); None if by nothing

    def scale(self, size: Array) -> Array:
        """Scale of errors of components that have been so large, (.., m)."""
        if self.ordinary:
            largest = size.max(axis=-1, keepdims=True)
        else:
            largest = np.moveaxis(values_of(self.largest, np.moveaxis(size, -1, 0), *size.shape[:-1]), 0, -1)
        result: Array = size + ROUNDING_SIZE * largest
        return result

    @cached_property
    def largest(self) -> Graph:
        """Largest size among components of one kind, as one of each component's own, (m) to (m)."""
        x, pairs = self._variables, zip(self._variables, self.lengths, strict=True)
        sizes = _largest([abs(value if length == 1.0 else length * value) for value, length in pairs], self.kinds)
        return numbered_graph(x, [size / length for size, length in zip(sizes, self.lengths, strict=True)])

    @cached_property
    def coordinate(self) -> Graph:
        """Largest of the coordinates that velocities like this one move, of each component, (m) to (m); 0 of none."""
        x = self._variables
        weighed = [length * abs(size) for size, length in zip(x, self.lengths, strict=True)]
        kinds = dict.fromkeys(self.moved)
        largest = {those: reduce(cg.maximum, [weighed[k] for k in those], cg.constant(0.0)) for those in kinds}
        return numbered_graph(
            x, [largest[those] / length for those, length in zip(self.moved, self.lengths, strict=True)]
        )

    @cached_property
    def together(self) -> Graph | None:
        """Sizes of components to those of quantities of several, such as a quaternion; None where there are none."""
        x = self._variables
        return numbered_graph(x, _largest(x, self.groups)) if len(set(self.groups)) < len(x) else None

    @property
    def _variables(self) -> list[Node]:
        return cg.variables([f"x{k}" for k in range(len(self.kinds))])


def _largest(values: Sequence[Node], alike: Sequence[int]) -> list[Node]:
    """Largest node among those of the same number, for each."""
    found: dict[int, Node] = {}
    for value, number in zip(values, alike, strict=True):
        found[number] = cg.maximum(found[number], value) if number in found else value
    return [found[number] for number in alike]


def state_kinds(problem: Problem) -> StateKinds:
    """Kinds: coordinates, velocities, those of no known length, and groups of several, such as a quaternion."""
    system, nq, every = problem.system, problem.nq, tuple(range(problem.size))
    if system is None:
        return StateKinds(every, every, (1.0,) * problem.size, ordinary=True, moved=((),) * problem.size)
    known = list(map(bool, system.lengths))
    lengths = [size or 1.0 for size in system.lengths]
    if problem.momenta:
        lengths[nq:] = [1.0 / size for size in lengths[nq:]]
    groups = (*map(system.kinematics.groups.index, system.kinematics.groups), *every[nq:])  # by their first
    kinds = [(k < nq, known[k], groups[k] if groups.count(groups[k]) > 1 else None) for k in every]
    still = every if problem.momenta else every[:nq]
    moved = [() if k in still else tuple([j for j in every[:nq] if known[j] == known[k]]) for k in every]
    return StateKinds(tuple(map(kinds.index, kinds)), groups, tuple(lengths), ordinary=False, moved=tuple(moved))


def with_floor(kinds: StateKinds, problem: Problem) -> StateKinds:
    """The kinds with the floor of their errors: what rounding does at the neutral state to what rests but for that.

    A body drawn upright in axes that are not the world's rests so, and steps that resolved the motion that this starts
    would be without number. Nothing is rounded along the axes of the world.
    """
    if problem.system is None or problem.momenta:
        return kinds
    known, nq = state_inputs(problem.model).parameters, problem.nq
    point = dict.fromkeys(problem.rate.input_names, 0.0)
    point |= {name: float(known[name]) for name in problem.parameters if name in known}
    point |= dict(zip(problem.states, problem.system.kinematics.neutral, strict=False))
    rate = problem.rate
    rates, pushed = rate.noise(point) if isinstance(rate, ByRows) else rounding_noise(rate, point)
    rests = np.isfinite(pushed) & (np.abs(rates) <= MOVES * pushed) & (np.arange(problem.size) >= nq)
    pushed = np.where(rests, pushed, 0.0)
    if not pushed.any():
        return kinds
    at_once = np.zeros(problem.size)
    if problem.projection is not None:
        at_once = np.nan_to_num(rounding_noise(problem.projection, point)[1], posinf=0.0)
    pushed, at_once = (values_of(kinds.largest, each) for each in (pushed, at_once))  # one passes it on to another
    turned = np.zeros(problem.size)  # coordinates by the velocities that move them
    for k, those in enumerate(kinds.moved):
        for j in those:
            turned[j] = max(turned[j], pushed[k] * kinds.lengths[k] / kinds.lengths[j])
    [time] = cg.variables("time")
    rows = zip(at_once.tolist(), pushed.tolist(), turned.tolist(), strict=True)
    return replace(kinds, floor=cg.simplify(numbered_graph([time], [a + time * (b + time * c) for a, b, c in rows])))


def off_by(errors: Array, scale: Array, allowed: Array, components: tuple[str, ...]) -> str:
    """The component whose error, a share of its size, is the largest of those beyond what is allowed; "" if none is."""
    beyond = ~(errors * scale <= allowed)
    if not beyond.any():
        return ""
    worst = int(np.argmax(np.where(beyond, errors, -1.0)))
    return f"the state is off by an estimated {errors[worst]:.2g} of the size of {components[worst]}"
