"""Parts of a torque: what of it moves mass, what goes around the bend, what holds weight and springs."""

from __future__ import annotations

from html import escape

import numpy as np

from cgraph.extend import Array
from dynamics import inverse_dynamics

from ..pages.document import Table
from .subject import SHOWN, Screen, Subject, number

PARTS = ("inertia: what q̈ takes", "velocity: Coriolis, centrifugal, damping", "position: weight and springs")
MOVED = 3  # joints with three sliders


def torque_parts(subject: Subject) -> Screen:
    """The screen of a system."""
    graph, system = inverse_dynamics(subject.system, "chain_rule"), subject.system
    parts = _parts(subject)
    joint = int(np.abs(parts).sum(axis=0).argmax())
    sizes = np.abs(parts[:, joint])
    name = escape(subject.joints[joint])
    state = ", ".join(
        f"{escape(subject.shown(f'{kind}{i}'))} = {number(subject.values[f'{kind}{i}'])}"
        for i in range(min(system.n, SHOWN))
        for kind in (("q", "qd", "qdd") if system.nq == system.n else ("qd", "qdd"))
    )
    rows = [[joint_name, *[number(value) for value in column], number(column.sum())]
            for joint_name, column in zip(subject.joints[:SHOWN], parts.T, strict=False)]  # fmt: skip
    table = Table("Parts of the torque", ["joint", "inertia", "velocity", "position", "torque"], rows)
    play = subject.play(
        "parts",
        {"graph": graph},
        sliders=subject.sliders(("q", "qd", "qdd"), MOVED),
        joints=subject.joints[:SHOWN],
        parts=[part.partition(":")[0] for part in PARTS],
    )
    return Screen(
        "why-this-torque",
        "Why this torque?",
        3,
        f"<p>The system moves: {state}. The torque at a joint, or the force where it slides, has three parts: "
        "inertia, which vanishes with q̈; centrifugal and Coriolis terms, which vanish with q̇; and weight and springs, "
        "which remain at rest.</p>",
        f"Which part is the largest at <b>{name}</b> in this state?",
        PARTS,
        int(sizes.argmax()),
        "<p>The same graph of the torque, evaluated three times: at rest without acceleration, then with q̈ alone, then with "
        f"q̇ alone. The three add up to the torque.</p>{table.html()}",
        "Move the joints. Make the velocity part the largest; then find a position that is held without torque. Bars: inertia "
        "light blue, velocity orange, position green.",
        play,
        f"At {name} the parts are {', '.join(number(value) for value in parts[:, joint])}.",
    )


def _parts(subject: Subject) -> Array:
    """The three parts at each joint, (3, n)."""
    graph = inverse_dynamics(subject.system, "chain_rule")
    still = {f"qd{i}": 0.0 for i in range(subject.system.n)}
    steady = {f"qdd{i}": 0.0 for i in range(subject.system.n)}
    held = subject.evaluate(graph, **still, **steady)
    return np.stack([subject.evaluate(graph, **still) - held, subject.evaluate(graph, **steady) - held, held])
