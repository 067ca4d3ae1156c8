"""Points of a graph's inputs for commands: what is given, filled up with the rest."""

from __future__ import annotations

import cgraph as cg
import dynamics as dyn

from . import library

SEED, DIGITS = 20250814, 3  # of the numbers that nobody gave: always the same, and short enough to be typed again

DT = 1e-3  # s, the step of an embedded relation

REST = (
    f"of the inputs that it leaves out, parameters keep their values, dt is {DT} s, t is 0, q and qd of a file "
    "are its start unless that is 0, as q of any model with quaternions, and the rest have numbers between -1 and 1, "
    "always the same"
)


def filled(graph: cg.Graph, scene: dyn.scenes.Scene, given: dict[str, float]) -> dict[str, float]:
    """The given numbers with the rest that the graph's inputs need, by the graph's names. Raises for unknown names.

    Of a graph with the Euler relation, whose inputs are the state before the step, that after it can be given.
    """
    import numpy as np

    called, of_library = dyn.display_names(scene), scene.name in dyn.scenes.names()
    names = library.Names(graph, called)

    # What is not given: the start of a scene of the user's, its parameters, and numbers by lot
    starts = any([*scene.q, *scene.qd]) and not scene.ode  # all at 0 nobody has chosen, and it may be singular
    q = scene.q if starts and (not of_library or len(scene.q) > len(scene.qd)) else ()
    qd, chosen = scene.qd if starts and not of_library else (), np.random.default_rng(SEED)
    start = {f"q{k}": x for k, x in enumerate(q)} | {f"qd{k}": x for k, x in enumerate(qd)}
    known: dict[str, float] = {"dt": DT, "t": 0.0, **start, **scene.parameters}
    drawn = {name: round(chosen.uniform(-1.0, 1.0), DIGITS) for name in graph.input_names}
    now = {old.removesuffix("_old"): old for old in drawn if old.endswith("_old")}
    values = {name: known.get(name, known.get(name.removesuffix("_old"), x)) for name, x in drawn.items()}

    # What is given: of inputs, of the state after the step, and of coordinates by their bare names
    bare = {name: f"q{k}" for k, name in enumerate(scene.coordinates) if names.meant(name) not in values}
    spelled = {bare.get(name, name): x for name, x in given.items()}
    if twice := [name for name in given if name in bare and {bare[name], called[bare[name]]} & set(given)]:
        raise ValueError(f"--at gives {twice[0]} twice")
    meant = {text: name for name in now for text in (name, called[name])}
    after = {meant[name]: x for name, x in spelled.items() if name in meant}
    before = names.inputs_of("--at", {name: x for name, x in spelled.items() if name not in meant})
    if twice := [name for name in after if now[name] in before]:
        raise ValueError(f"--at gives {called[twice[0]]} after the step, and {called[now[twice[0]]]} before it")
    values |= before
    return library.before_step(scene.system, values, after) if after else values
