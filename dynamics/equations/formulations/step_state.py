"""States before and after the embedded step, qd = qdd dt + qd_old and q = G qd dt + q_old, as numbers by name."""

from collections.abc import Mapping

from cgraph import Graph

from ...systems.system import System

ROUNDS = 100  # of q_old, where G depends on it


def after_step(system: System, at: Mapping[str, float]) -> dict[str, float]:
    """{q0.., qd0..: the state after the step} of numbers of all inputs of an embedded graph."""
    qd = {f"qd{i}": at[f"qdd{i}"] * at["dt"] + at[f"qd{i}_old"] for i in range(system.n)}
    moved = _moved(system, at, qd)
    return {f"q{i}": rate * at["dt"] + at[f"q{i}_old"] for i, rate in enumerate(moved)} | qd


def before_step(system: System, at: Mapping[str, float], after: Mapping[str, float]) -> dict[str, float]:
    """`at`, with the old state that leads to `after`, some of q0.., qd0.., in place of its own; the rest is held."""
    found = dict(at)
    for i in range(system.n):
        if f"qd{i}" in after:
            found[f"qd{i}_old"] = after[f"qd{i}"] - at[f"qdd{i}"] * at["dt"]
    for _ in range(ROUNDS):
        moved = _moved(system, found, after_step(system, found))
        old = {f"q{i}_old": after[f"q{i}"] - rate * at["dt"] for i, rate in enumerate(moved) if f"q{i}" in after}
        if found.items() >= old.items():
            break
        found |= old
    return found


def _moved(system: System, at: Mapping[str, float], qd: Mapping[str, float]) -> list[float]:
    """The rates G(q_old) qd."""
    rates = Graph([*system.q, *system.qd], {f"q{i}": rate for i, rate in enumerate(system.q_dot)})
    state = {f"q{i}": at[f"q{i}_old"] for i in range(system.nq)}
    state |= {name: qd[name] for name in rates.input_names[system.nq :]}
    return [float(rate) for rate in rates.evaluate(state).values()]
