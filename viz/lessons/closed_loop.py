"""A loop closes: a constraint as an unknown force, the multiplier, found with the accelerations."""

from __future__ import annotations

from html import escape

from cgraph import Node
from dynamics import System, forward_dynamics, gravity_force

from ..pages.document import Table
from .subject import SHOWN, Screen, Subject, number


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
    multipliers = [answer[name] for name in names]
    first = multipliers[0]
    weight = f"<b>{escape(shown[0])}</b>"
    static = 0.0 if own else float(subject.evaluate(gravity_force(subject.system))[-1])
    choices, right = _choices(first, static)
    rows = [[joint, number(a), number(answer[f"qdd{i}"])]
            for i, (joint, a) in enumerate(zip(subject.joints[:SHOWN], free.tolist(), strict=False))]  # fmt: skip
    sliders = [] if own else subject.sliders()
    play = subject.play(
        "loop",
        {"free": free_graph, "held": held_graph},
        values=subject.values | still,
        sliders=sliders,
        joints=subject.joints[:SHOWN],
        multipliers=dict(zip(names, shown, strict=True)),
    )
    return Screen(
        "closed-loop",
        "A loop closes",
        3,
        ("<p>This system has constraints: rows z(q, q̇) that stay zero." if own else
         f"<p>We clamp <b>{escape(subject.joints[-1])}</b>: a row z = q̇ that stays zero, the simplest of all loops.") +
        " Nobody knows beforehand with which force. So the force becomes an unknown, the <b>multiplier</b> λ, beside the "
        "accelerations: M q̈ − Jᵀλ = τ − b and J q̈ = −J̇ q̇. As many equations as unknowns, one elimination.</p>",
        f"At rest, let go, without motors: what does {weight} have to give at this very instant?",
        choices,
        right,
        f"<p>λ = {number(first)}: as much as it takes so that the row stays zero, no more. It does no work, for along what "
        "is still allowed to move, J q̇ = 0.</p>"
        + Table("Accelerations at rest", ["joint", "free", "held"], rows).html()
        + Table("Multipliers", ["row", "λ"], [[a, number(b)] for a, b in zip(shown, multipliers, strict=True)][:SHOWN]).html(),
        "Find a place where the clamp has nothing to do. Is it where nothing moves at all?"
        if sliders else "Accelerations without and with the rows, at rest.",
        play,
        f"λ = {number(first)}. Where others are free to swing, it differs from the torque that holds the same place still.",
    )  # fmt: skip


def _clamped(system: System) -> System:
    """The system with its last velocity held at zero."""

    def row(q: list[Node], qd: list[Node], t: Node) -> list[Node]:
        return [qd[-1]]

    def forces(*_: object) -> list[Node]:
        return list(system.forces)

    return System(
        lambda *_: list(system.partial_lagrangians),
        system.coordinates,
        system.parameters,
        forces=forces,
        damping=list(system.damping),
        quasi_velocities=system.kinematics.quasi,
        velocity_constraints=row,
    )


def _choices(force: float, static: float) -> tuple[tuple[str, ...], int]:
    """Three numbers, in order, and the place of the right one; static: what would hold it if nothing else moved."""
    size = max(abs(force), abs(static))
    near = [value for value in (static, -force, 0.0, 2.0 * force, 1.0, -1.0) if abs(value - force) > 0.1 * size]
    values = sorted([force, *list(dict.fromkeys([value + 0.0 for value in near]))[:2]])
    return tuple([number(value) for value in values]), values.index(force)
