"""The formulations by what is true of them, so that no test lists their names."""

import dynamics as dyn

SMALL = 1e-6  # s, a step at which a right formulation with the Euler relation is off by no more than 1e-4
SEEN = 1e-3  # N m, of torques of 10 N m


def _torques() -> dict[str, list[float]]:
    """The torques of two moving links by each formulation, at the same state after a small step."""
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.7])
    q, qd, qdd = [0.3, 0.9], [1.0, -2.0], [0.5, 1.5]
    qd_old = [b - c * SMALL for b, c in zip(qd, qdd, strict=True)]
    q_old = [a - b * SMALL for a, b in zip(q, qd, strict=True)]
    parts = {"q{}": q, "qd{}": qd, "qdd{}": qdd, "q{}_old": q_old, "qd{}_old": qd_old}
    values = {name.format(i): part[i] for name, part in parts.items() for i in range(2)} | {"dt": SMALL}
    graphs = {name: dyn.inverse_dynamics(arm, name) for name in dyn.FORMULATIONS}
    return {
        name: list(graph.evaluate({each: values[each] for each in graph.input_names}).values())
        for name, graph in graphs.items()
    }


_TORQUES = _torques()
WITHOUT_STEP = [
    name
    for name in dyn.FORMULATIONS
    if "dt" not in dyn.inverse_dynamics(dyn.planar_arm([1.0], [1.0]), name).input_names
]
RIGHT = [
    name
    for name, torques in _TORQUES.items()
    if max(abs(a - b) for a, b in zip(torques, _TORQUES["chain_rule"], strict=True)) < SEEN
]
WRONG = [name for name in dyn.FORMULATIONS if name not in RIGHT]
