"""The state at which a verdict is told: one that it chooses, or one that is asked for."""

from collections.abc import Callable, Mapping

import numpy as np

from cgraph import Graph, GraphError
from cgraph._shared import or_nearest, real_number, require_mapping

from ...systems.system import System

STATES = 24  # tried where c does not fold to 0: a third of size 1, the rest of sizes from 1e-6 to 1e6


def chosen_state(
    system: System, terms: Graph, excess_at: Callable[[dict[str, float]], dict[str, float]]
) -> tuple[dict[str, float], int]:
    """The first state at which c is not 0, else the last; and at how many it was finite.

    States are about the neutral one, always the same, of three digits, so that a person can type them again.
    """
    names, accelerations = terms.input_names, [str(node.name) for node in system.qdd]
    rng, finite, at = np.random.default_rng(0), 0, dict[str, float]()
    neutral = {f"q{i}": number for i, number in enumerate(system.kinematics.neutral)}
    for k in range(STATES):
        sizes = 10.0 ** rng.uniform(-6.0, 6.0, len(names)) if k >= STATES // 3 else np.ones(len(names))
        drawn = rng.uniform(-1.0, 1.0, len(names)) * sizes
        drawn = np.abs(drawn) if k % 2 else drawn  # where a root or a logarithm is
        numbers = {name: neutral.get(name, 0.0) + x for name, x in zip(names, drawn, strict=True)}
        at = {name: float(f"{x:.3g}") for name, x in numbers.items()} | system.parameters
        if np.isfinite([float(value) for value in terms.evaluate(at).values()]).all():
            finite += 1
            if excess_at(at):
                break
    drawn = np.random.default_rng(1).uniform(-1.0, 1.0, system.n)
    qdd = {name: float(f"{x:.3g}") for name, x in zip(accelerations, drawn, strict=True)}
    order = [*names[: system.nq + system.n], *qdd, *names[system.nq + system.n :]]
    return {name: (at | qdd)[name] for name in order}, finite


def asked_state(names: Mapping[str, str], known: Mapping[str, float], at: Mapping[str, float]) -> dict[str, float]:
    """The state that is asked for, by the graph's names. Raises GraphError for a name that is none."""
    meant = {names.get(name, name): name for name in known}
    for name in at:
        if name not in known and name not in meant:
            raise GraphError(f"at: there is no {name!s:.80}; {or_nearest(str(name), [*meant])}")
    return {meant.get(name, name): value for name, value in at.items()}


def numbers_of(at: Mapping[str, float] | None) -> dict[str, float]:
    """What was given as a state. Raises TypeError and ValueError for what is none."""
    given = {} if at is None else require_mapping("at", at, "name: number")
    return {name: real_number(f"at: {name!s:.80}", value) for name, value in given.items()}
