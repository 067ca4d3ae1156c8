"""Chains: masses and lengths far apart, masses that nearly vanish, nearly singular mass matrices, and many links."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import cgraph as cg

from ....equations.equations_of_motion import momentum
from ....multibody.mechanism import Body, Joint, Mechanism
from ....multibody.planar_arm import planar_arm
from ....reference import closed_forms
from ....systems.system import System
from .case import GROWN, RTOL, SLACK, Case, Watch, conserved, energy_watch, error_watch

GRAVITY = 9.81  # m/s^2
UNIT = 2.0**-53  # rounding of float64


def _two_links(
    name: str,
    about: str,
    build: Callable[[], Mechanism],
    fastest: float,
    bend: float,
    watch: tuple[Watch, ...],
    growth: float | None,
) -> Case:
    """Two links let go straight, at rest, for a hundred radians of the fastest mode [rad/s], at most 2 s."""
    return Case(
        name=name,
        about=about,
        build=build,
        start=(1.0, 0.0, 0.0, 0.0),
        size=(1.0, bend, math.sqrt(GRAVITY), bend * fastest),
        t_end=min(2.0, 100.0 / fastest),
        watch=watch,
        stiff=fastest > 1e3,
        growth=growth,
        invariants=conserved(),
        method=None if growth is None else "taylor",
    )


def mass_ratio(ratio: float, growth: float) -> Case:
    """Two points on unit rods without mass, the lower `ratio` times as heavy as the upper."""

    def build() -> Mechanism:
        return planar_arm([1.0, ratio], [1.0, 1.0], mass_model="point", gravity=GRAVITY)

    about = (
        "a light link under a heavy one" if ratio < 1.0 else "a light link above a heavy one swings fast in its pull"
    )
    fastest = math.sqrt(2.0 * GRAVITY * max(ratio, 1.0))  # of the upper point between the two rods
    bend = 1.0 / max(ratio, 1.0)  # gravity over the square of that
    lost = UNIT * ratio  # the light mass is rounded in the sum with the heavy one
    watch = (energy_watch(GRAVITY * (1.0 + 2.0 * ratio)), Watch("error", SLACK * max(RTOL * growth, lost), GROWN))
    return _two_links(f"mass ratio {ratio:g}", about, build, fastest, bend, watch, growth)


def length_ratio(ratio: float, growth: float | None) -> Case:
    """Two rods of equal mass, the lower `ratio` times as long as the upper."""

    def build() -> Mechanism:
        return planar_arm([1.0, 1.0], [1.0, ratio], gravity=GRAVITY)

    about = "a short link under a long one" if ratio < 1.0 else "a long link under a short one"
    fastest = math.sqrt(GRAVITY / min(ratio, 1.0))
    # Of a long link below, the float64 accelerations themselves have a relative error of 2^-53 ratio^2.
    why = "the short link's inertia is rounded in the sum with the long one's, larger by the square of the ratio"
    lost = Watch("energy", SLACK * max(RTOL, UNIT * ratio**2), why, GRAVITY * (2.0 + ratio))
    watch: tuple[Watch, ...] = (energy_watch(GRAVITY * (2.0 + ratio)) if ratio < 1.0 else lost,)
    if growth is not None:
        watch += (error_watch(growth, GROWN),)
    return _two_links(f"length ratio {ratio:g}", about, build, fastest, 1.0, watch, growth)


def nearly_singular(small: float) -> Case:
    """M = [[1, 1], [1, 1 + small]], and yet slow modes: q0 + q1 and q1 swing by themselves."""

    def lagrangian(q: Any, qd: Any, t: Any) -> list[cg.Node]:
        both, apart = q[0] + q[1], q[1]
        return [
            0.5 * (qd[0] + qd[1]) ** 2 - 0.5 * (4.0 * both**2),
            0.5 * (small * qd[1] ** 2) - 0.5 * (small * apart**2),
        ]

    lost = UNIT / small
    return Case(
        name=f"mass matrix of condition {4 / small:.0e}",
        about="the smallest inertia is lost when it is added to the largest",
        build=lambda: System(lagrangian, ["first", "second"]),
        start=(1.0, 0.5, 0.0, 0.0),
        t_end=20.0,
        watch=(
            Watch("error", max(SLACK * RTOL, 200.0 * lost), "rounding changes the small inertia, and its frequency"),
            energy_watch(10.0),
        ),
        size=(1.0, 1.0, 2.0, 2.0),
        growth=1.8,
        invariants=conserved(),
        exact=lambda times: closed_forms.two_modes(times, (1.0, 0.5), (4.0, 1.0)),
        method="taylor",
    )


def massless_links() -> Case:
    """Three hinges, the first two on bodies without mass: their inertia is the motors' armature alone."""

    def build() -> Mechanism:
        axis, below = (0.0, 1.0, 0.0), (0.0, 0.0, -0.5)
        bodies = [
            Body("first", Joint("revolute", axis, armature=1e-3)),
            Body("second", Joint("revolute", axis, below, armature=1e-3), "first"),
            Body(
                "third",
                Joint("revolute", axis, below, armature=1e-3),
                "second",
                mass=1.0,
                center=(0.0, 0.0, -0.25),
                inertia=[[0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.001]],
            ),
        ]
        return Mechanism(bodies)

    growth = 30.0
    return Case(
        name="massless links with armature",
        about="links without mass between motors: inertia only by the armatures",
        build=build,
        start=(0.7, 0.4, -0.3, 0.0, 0.0, 0.0),
        t_end=2.0,
        watch=(energy_watch(10.0), error_watch(growth, GROWN)),
        growth=growth,
        invariants=conserved(),
        method="taylor",
    )


def long_chain(n: int, t_end: float) -> Case:
    """n equal rods, 1 kg and 1 m in all, let go straight at 45 degrees."""

    def build() -> Mechanism:
        return planar_arm([1.0 / n] * n, [1.0 / n] * n, gravity=GRAVITY)

    return Case(
        name=f"{n} links",
        about="many links: a dense mass matrix of condition n^4, and a fast whip at the end",
        build=build,
        start=(math.pi / 4,) + (0.0,) * (2 * n - 1),
        t_end=t_end,
        watch=(energy_watch(GRAVITY),),
        invariants=conserved(),
    )


def zero_gravity() -> Case:
    """Three rods without gravity, spinning: beside energy, the momentum of the first joint stays."""

    def build() -> Mechanism:
        return planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], gravity=0.0)

    def spin(q: Any, qd: Any) -> cg.Node:
        return momentum(build()).outputs["p0"]

    growth = 110.0
    return Case(
        name="zero gravity",
        about="nothing but inertia: energy and angular momentum stay",
        build=build,
        start=(0.3, 0.5, -0.8, 1.0, -2.0, 3.0),
        t_end=10.0,
        watch=(
            energy_watch(1.0),
            Watch("angular momentum", SLACK * RTOL, "the system may be turned as a whole", 1.0),
            error_watch(growth, GROWN),
        ),
        growth=growth,
        invariants=conserved(**{"angular momentum": spin}),
        method="taylor",
    )


def cases() -> list[Case]:
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
