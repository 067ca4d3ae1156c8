"""A loop closes: a constraint as an unknown force, the multiplier, found with the accelerations."""

from html import escape

import numpy as np

from dynamics import System, forward_dynamics, gravity_force
from dynamics.systems.constraints import Constraints

from ...pages.document import Table
from ..glossary import term
from ..screen import Screen
from ..subject import SHOWN, Subject, number

ROUNDING = 1e-12  # of the largest weight, or acceleration: what is rounding


def closed_loop(subject: Subject) -> Screen:
    """The screen of a system, with its own constraints, or with its last joint clamped where it has none."""
    own = len(subject.system.constraints) > 0
    held = subject.system if own else _clamped(subject.system)
    names = [f"lambda{k}" for k in range(len(held.constraints))]
    shown = list(held.constraints.names) if own else [f"clamp at {subject.joints[-1]}"]
    free_graph, held_graph = forward_dynamics(subject.system.without_constraints), forward_dynamics(held)
    still = {f"qd{i}": 0.0 for i in range(subject.system.n)}
    free = subject.evaluate(free_graph, **still)
    answer = dict(zip(held_graph.outputs, subject.evaluate(held_graph, **still).tolist(), strict=True))
    weights = subject.evaluate(gravity_force(subject.system))
    heaviest = float(np.abs(weights).max(initial=0.0))
    rounding = ROUNDING * heaviest
    multipliers = [answer[name] if abs(answer[name]) > rounding else 0.0 for name in names]
    first = multipliers[0]
    weight = f"<b>{escape(shown[0])}</b>"
    static = 0.0 if own or abs(weights[-1]) <= rounding else float(weights[-1])
    unit = "" if own else subject.unit(f"tau{subject.system.n - 1}")
    choices, right = _choices(first, static, unit)
    many = subject.system.n > 1 and not own
    still_held = np.array([answer[f"qdd{i}"] for i in range(subject.system.n)])
    both = np.stack([free[: len(still_held)], still_held])
    both[np.abs(both) <= ROUNDING * np.abs(both).max()] = 0.0
    rows = [[joint, *map(number, pair)] for joint, pair in zip(subject.joints[:SHOWN], both.T, strict=False)]
    sliders = [] if own else subject.sliders()
    play = subject.play(
        "loop",
        {"free": free_graph, "held": held_graph},
        values=subject.values | still,
        sliders=sliders,
        joints=subject.joints[:SHOWN],
        multipliers=dict(zip(names, shown, strict=True)),
        rounding=ROUNDING,
        force=heaviest,
    )
    last = escape(subject.joints[-1])
    return Screen(
        "closed-loop",
        "A loop closes" if own else f"{last} is clamped",
        5,
        (f"<p>This system has a {term('constraint')}: " + ("rows" if len(names) > 1 else "a row") + " z(q, q̇) that "
         + ("stay" if len(names) > 1 else "stays") + " zero." if own else
         f"<p>We clamp <b>{last}</b>. This is the simplest {term('constraint')}, a row z = q̇ that stays zero.") +
        f" The force that does this is not known beforehand. So it becomes an unknown, the {term('multiplier')} λ, beside the "
        f"{term('acceleration', 'accelerations')}: M q̈ − Jᵀλ = τ − b and J q̈ = −J̇ q̇, where J holds the slopes of z by q̇. "
        "There are as many equations as unknowns, and one elimination finds them all.</p>",
        f"The system is at rest where the lesson began, with τ = 0, and is let go. How large is λ of {weight} at that instant?",
        choices,
        right,
        "<p>λ is what it takes to keep the row at zero. It does no work, because J q̇ = 0 along every "
        "motion that is still possible."
        + (f" While the rest of the system swings, λ is not the {subject.force} that would hold all of it still." if many else "")
        + "</p>"
        + Table("Accelerations at rest", [subject.joint, "free", "held"], rows).html()
        + Table("Multipliers", ["row", f"λ{unit and f' [{unit.strip()}]'}"], [[a, number(b)] for a, b in zip(shown, multipliers, strict=True)][:SHOWN]).html(),
        f"λ = {number(first)}{unit}.",
        f"Find a position where λ is zero. Would {last} stay at rest there without the clamp?" if sliders else "",
        play,
    )  # fmt: skip


def _clamped(system: System) -> System:
    """The system with its last velocity held at zero."""
    clamp = Constraints(system.kinematics, system.t, system.parameters, None, lambda q, qd, t: [qd[-1]])
    return system.changed(constraints=clamp, extra_inputs=system.extra_inputs)


def _choices(force: float, static: float, unit: str) -> tuple[tuple[str, ...], int]:
    """Three numbers, in order, and the place of the right one; static: what would hold it if nothing else moved."""
    size = max(abs(force), abs(static))
    near = [value for value in (static, -force, 0.0, 2.0 * force, 1.0, -1.0) if abs(value - force) > 0.1 * size]
    values = sorted([force, *list(dict.fromkeys([value + 0.0 for value in near]))[:2]])
    return tuple([f"{number(value)}{unit}" for value in values]), values.index(force)
