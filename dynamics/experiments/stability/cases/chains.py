"""Chains: masses and lengths far apart, masses that nearly vanish, nearly singular mass matrices, and many links."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cgraph as cg

from ....equations.equations_of_motion import momentum
from ....multibody.builders import planar_arm
from ....multibody.trees.mechanism import Body, Joint, Mechanism
from ....systems.system import System
from ...accuracy_task import GROWN, RTOL, SLACK, Criterion, StabilityCase, case, conserved, energy_criterion

GRAVITY = 9.81  # m/s^2
UNIT = 2.0**-53  # rounding of float64


def _two_links(
    name: str, about: str, arm: Mechanism, fastest: float, bend: float, growth: float | None, *criteria: Criterion
) -> StabilityCase:
    """Two links let go straight, at rest, for a hundred radians of the fastest mode [rad/s], at most 2 s."""
    size, t_end = (1.0, bend, math.sqrt(GRAVITY), bend * fastest), min(2.0, 100.0 / fastest)
    more = {"size": size, "stiff": fastest > 1e3, "growth": growth, "series": growth is not None}
    return case(name, about, arm, (1.0, 0.0, 0.0, 0.0), t_end, *criteria, **more)


def mass_ratio(ratio: float, growth: float) -> StabilityCase:
    """Two points on unit rods without mass, the lower `ratio` times as heavy as the upper."""
    arm = planar_arm([1.0, ratio], [1.0, 1.0], mass_model="point", gravity=GRAVITY)
    about = f"a light link {'under a heavy one' if ratio < 1.0 else 'above a heavy one swings fast in its pull'}"
    fastest = math.sqrt(2.0 * GRAVITY * max(ratio, 1.0))  # of the upper point between the two rods
    bend = 1.0 / max(ratio, 1.0)  # gravity over the square of that
    lost = UNIT * ratio  # the light mass is rounded in the sum with the heavy one
    kept = energy_criterion(GRAVITY * (1.0 + 2.0 * ratio))
    error = Criterion("error", SLACK * max(RTOL * growth, lost), GROWN)
    return _two_links(f"mass ratio {ratio:g}", about, arm, fastest, bend, growth, kept, error)


def length_ratio(ratio: float, growth: float | None) -> StabilityCase:
    """Two rods of equal mass, the lower `ratio` times as long as the upper."""
    arm = planar_arm([1.0, 1.0], [1.0, ratio], gravity=GRAVITY)
    about = "a short link under a long one" if ratio < 1.0 else "a long link under a short one"
    fastest = math.sqrt(GRAVITY / min(ratio, 1.0))
    # Of a long link below, the float64 accelerations themselves have a relative error of 2^-53 ratio^2.
    why = "the short link's inertia is rounded in the sum with the long one's, larger by the square of the ratio"
    lost = Criterion("energy", SLACK * max(RTOL, UNIT * ratio**2), why, GRAVITY * (2.0 + ratio))
    kept = energy_criterion(GRAVITY * (2.0 + ratio)) if ratio < 1.0 else lost
    return _two_links(f"length ratio {ratio:g}", about, arm, fastest, 1.0, growth, kept)


def nearly_singular(small: float) -> StabilityCase:
    """M = [[1, 1], [1, 1 + small]], and yet slow modes: q0 + q1 and q1 swing by themselves."""

    def lagrangian(q: Sequence[cg.Node], qd: Sequence[cg.Node], t: cg.Node) -> list[cg.Node]:
        both, apart = q[0] + q[1], q[1]
        return [
            0.5 * (qd[0] + qd[1]) ** 2 - 0.5 * (4.0 * both**2),
            0.5 * (small * qd[1] ** 2) - 0.5 * (small * apart**2),
        ]

    about = "the smallest inertia is lost when it is added to the largest"
    model, start, size = System(lagrangian, ["first", "second"]), (1.0, 0.5, 0.0, 0.0), (1.0, 1.0, 2.0, 2.0)
    why, name = "rounding changes the small inertia and its frequency", f"mass matrix of condition {4 / small:.0e}"
    error = Criterion("error", max(SLACK * RTOL, 200.0 * (UNIT / small)), why)
    return case(name, about, model, start, 20.0, error, energy_criterion(10.0), size=size, growth=1.8)


def massless_links() -> StabilityCase:
    """Three hinges, the first two on bodies without mass: their inertia is the motors' armature alone."""
    axis, below = (0.0, 1.0, 0.0), (0.0, 0.0, -0.5)
    joint = Joint("revolute", axis, below, armature=1e-3)
    bodies = [
        Body("first", Joint("revolute", axis, armature=1e-3)),
        Body("second", joint, "first"),
        Body("third", joint, "second", mass=1.0, center=(0.0, 0.0, -0.25), inertia=(0.02, 0.02, 0.001)),
    ]
    name, about = "massless links with armature", "links without mass between motors: inertia only by the armatures"
    start = (0.7, 0.4, -0.3, 0.0, 0.0, 0.0)
    return case(name, about, Mechanism(bodies), start, 2.0, energy_criterion(10.0), growth=30.0)


def long_chain(n: int, t_end: float) -> StabilityCase:
    """n equal rods, 1 kg and 1 m in all, let go straight at 45 degrees."""
    about = "many links: a dense mass matrix of condition n^4, and a fast whip at the end"
    arm, start = planar_arm([1.0 / n] * n, [1.0 / n] * n, gravity=GRAVITY), (math.pi / 4,) + (0.0,) * (2 * n - 1)
    return case(f"{n} links", about, arm, start, t_end, energy_criterion(GRAVITY), series=False)


def zero_gravity() -> StabilityCase:
    """Three rods without gravity, spinning: beside energy, the momentum of the first joint stays."""
    arm = planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], gravity=0.0)

    def spin(q: Sequence[cg.Node], qd: Sequence[cg.Node]) -> cg.Node:
        return momentum(arm).outputs["p0"]

    name, about = "zero gravity", "nothing but inertia: energy and angular momentum stay"
    start, invariants = (0.3, 0.5, -0.8, 1.0, -2.0, 3.0), conserved(**{"angular momentum": spin})
    kept = energy_criterion(1.0), Criterion("angular momentum", SLACK * RTOL, "the system may be turned as a whole")
    return case(name, about, arm, start, 10.0, *kept, growth=110.0, invariants=invariants)


def cases() -> list[StabilityCase]:
    """The rows of this file."""
    masses = {1e-12: 27.0, 1e-8: 27.0, 1e-4: 27.0, 1e4: 30.0, 1e8: 44.0, 1e12: 44.0}
    # None: the reference is not to be had in minutes.
    lengths: dict[float, float | None] = {1e-6: 21.0, 1e6: None}
    return [
        *[mass_ratio(ratio, growth) for ratio, growth in masses.items()],
        *[length_ratio(ratio, growth) for ratio, growth in lengths.items()],
        *[nearly_singular(small) for small in (1e-4, 1e-8, 1e-12)],
        massless_links(),
        long_chain(100, 1.0),
        long_chain(1000, 0.1),
        zero_gravity(),
    ]
