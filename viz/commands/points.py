"""Points of a graph's inputs for commands: what is given filled up with the rest, and as text."""

from __future__ import annotations

from collections.abc import Mapping

import cgraph as cg
import dynamics as dyn
from cgraph import extend

from . import library

SEED, DIGITS = 20250814, 3  # of the numbers that nobody gave: always the same, and short enough to be typed again

DT = 1e-3  # s, the step of an embedded relation
SHOWN = 12  # inputs that a line of text names

REST = (
    f"of the inputs that it leaves out, parameters keep their values, dt is {DT} s, t is 0, "
    "and the rest have numbers between -1 and 1, always the same"
)


def filled(graph: cg.Graph, scene: dyn.scenes.Scene, given: dict[str, float]) -> dict[str, float]:
    """The given numbers with the rest that the graph's inputs need, by the graph's names. Raises for unknown names.

    Of a graph with the Euler relation, whose inputs are the state before the step, that after it can be given.
    """
    import numpy as np

    chosen = np.random.default_rng(SEED)
    parameters = scene.parameters
    values = {}
    for name in graph.input_names:
        drawn = round(chosen.uniform(-1.0, 1.0), DIGITS)
        values[name] = parameters[name] if name in parameters else {"dt": DT, "t": 0.0}.get(name, drawn)
    names, called = extend.Names(graph, dyn.display_names(scene)), dyn.display_names(scene)
    now = {old.removesuffix("_old"): old for old in values if old.endswith("_old")}
    meant = {spelled: name for name in now for spelled in (name, called[name])}
    after = {meant[name]: value for name, value in given.items() if name in meant}
    before = names.inputs_of("--at", {name: value for name, value in given.items() if name not in meant})
    if twice := [name for name in after if now[name] in before]:
        raise ValueError(f"--at gives {called[twice[0]]} after the step, and {called[now[twice[0]]]} before it")
    values |= before
    return library.before_step(scene.system, values, after) if after else values


def point_text(at: Mapping[str, float], most: int = SHOWN) -> str:
    """`q.knee=0.1, qd.knee=2`, and of many inputs the first."""
    shown = [f"{name}={value:g}" for name, value in list(at.items())[:most]]
    rest = [f"and {len(at) - most} more"] if len(at) > most else []
    return ", ".join([*shown, *rest])
