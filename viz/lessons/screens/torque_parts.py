"""Parts of a torque: what of it vanishes with q̈, what with q̇, and what remains at rest."""

from html import escape

import numpy as np

from dynamics import inverse_dynamics

from ...pages.document import Table
from ..glossary import term
from ..screen import Screen
from ..subject import SHOWN, Subject, number

PARTS = ("inertia: what vanishes with q̈", "velocity: what vanishes with q̇", "position: what remains at rest")
MOVED = 3  # joints with three sliders


def torque_parts(subject: Subject) -> Screen:
    """The screen of a system."""
    graph = inverse_dynamics(subject.system, "chain_rule")
    still = {f"qd{i}": 0.0 for i in range(subject.system.n)}
    steady = {f"qdd{i}": 0.0 for i in range(subject.system.n)}
    held = subject.evaluate(graph, **still, **steady)
    parts = np.stack([subject.evaluate(graph, **still) - held, subject.evaluate(graph, **steady) - held, held])
    joint = int(np.abs(parts).sum(axis=0).argmax())
    sizes = np.abs(parts[:, joint])
    name = escape(subject.joints[joint])
    rows = [[joint_name, *[number(value) for value in column], number(column.sum())]
            for joint_name, column in zip(subject.joints[:SHOWN], parts.T, strict=False)]  # fmt: skip
    table = Table("Parts of τ", [subject.joint, "inertia", "velocity", "position", "τ"], rows)
    each = "the coordinate" if subject.system.n == 1 else f"each {subject.joint}"
    play = subject.play(
        "parts",
        {"graph": graph},
        sliders=subject.sliders(("q", "qd", "qdd"), MOVED),
        joints=subject.joints[:SHOWN],
        joint=subject.joint,
        parts=[part.partition(":")[0] for part in PARTS],
    )
    return Screen(
        "why-this-torque",
        "Why this large?",
        3,
        f"<p>In the moment that the lesson began with, the system moves. The {term('generalized force', subject.force)} τ that "
        f"drives {each} has three parts that add up: <b>inertia</b>, which vanishes with q̈; what the <b>velocity</b> does, which vanishes "
        "with q̇; and what the <b>position</b> does, which remains at rest.</p>",
        f"Which part is the largest at <b>{name}</b> in this moment?",
        PARTS,
        int(sizes.argmax()),
        "<p>The same graph of τ, evaluated three times: at rest without acceleration, then with q̈ alone, then with "
        f"q̇ alone. The three add up to τ.</p>{table.html()}",
        f"At {name} the parts are {', '.join(number(value) for value in parts[:, joint])}.",
        "Make the velocity part the largest, if there is one; then find a position that is held without any τ. Bars: inertia "
        "light blue, velocity orange, position green.",
        play,
    )
