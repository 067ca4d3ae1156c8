"""Random linkages whose loops say more than they need, in any axes and units, with joints that are tilted a little."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

import dynamics as dyn
from dynamics.multibody.algebra.spatial import from_quaternion
from tests.dynamics.linkages import ACROSS, bar
from tests.dynamics.models import Array

LOOPS = ("point", "hinge", "weld")


def _lengths(rng: np.random.Generator) -> Array:
    """Of crank, coupler and rocker, beside a base of 1, so that the crank goes round."""
    return np.array([rng.uniform(0.15, 0.3), rng.uniform(0.7, 1.1), rng.uniform(0.6, 0.9)])


def four_bar(rng: np.random.Generator, kind: str) -> dyn.Mechanism:
    crank, coupler, rocker = _lengths(rng)
    bars = [bar("crank", "world", crank, (0, 0, 0)), bar("coupler", "crank", coupler, (crank, 0, 0))]
    if kind == "weld":  # the rocker hangs on the coupler, and is a part of the ground that turns about its end
        bars += [bar("rocker", "coupler", rocker, (coupler, 0, 0)), bar("foot", "rocker", 0.1, (rocker, 0, 0))]
        return dyn.Mechanism(bars, loops=[dyn.Loop("weld", "foot", to_at=(1.0, 0, 0))])
    bars.append(bar("rocker", "world", rocker, (1.0, 0, 0)))
    ends: dict[str, Any] = {"at": (coupler, 0, 0), "to_at": (rocker, 0, 0), "axis": ACROSS, "to_axis": ACROSS}
    return dyn.Mechanism(bars, loops=[dyn.Loop(kind, "coupler", "rocker", **ends)])


def slider_crank(rng: np.random.Generator, kind: str) -> dyn.Mechanism:
    crank, rod, _ = _lengths(rng)
    slide = dyn.Joint("prismatic", (1.0, 0, 0), (0, 0, rng.uniform(-0.1, 0.1)))
    bodies = [bar("crank", "world", crank, (0, 0, 0)), bar("rod", "crank", rod, (crank, 0, 0))]
    bodies.append(dyn.Body("piston", slide, "world", 0.7, (0.1, 0, 0), (0.01,) * 3))
    if kind == "weld":
        bodies.append(bar("pin", "rod", 0.1, (rod, 0, 0)))
        return dyn.Mechanism(bodies, loops=[dyn.Loop("weld", "pin", "piston")])
    loop = dyn.Loop(kind, "rod", "piston", at=(rod, 0, 0), axis=ACROSS, to_axis=ACROSS)
    return dyn.Mechanism(bodies, loops=[loop])


def parallelogram(rng: np.random.Generator, kind: str) -> dyn.Mechanism:
    """On three cranks, one more than it needs."""
    length = rng.uniform(0.3, 0.6)
    places = {"first": 0.0, "second": rng.uniform(0.4, 0.6), "third": 1.0}
    bars = [bar(name, "world", length, (at, 0, 0)) for name, at in places.items()]
    bars.append(bar("table", "first", 1.0, (length, 0, 0)))
    kind = "hinge" if kind == "weld" else kind
    ends: dict[str, Any] = {"to_at": (length, 0, 0), "axis": ACROSS, "to_axis": ACROSS}
    loops = [dyn.Loop(kind, "table", name, at=(at, 0, 0), **ends) for name, at in places.items() if at]
    return dyn.Mechanism(bars, loops=loops)


def sarrus(rng: np.random.Generator, kind: str) -> dyn.Mechanism:
    """A table that two legs with hinges across one another move up and down."""
    half, out = rng.uniform(0.3, 0.5, 2)

    def leg(name: str, axis: Any, place: Any, upper: str) -> list[dyn.Body]:
        up = (0.0, 0.0, half)
        return [
            dyn.Body(f"{name} low", dyn.Joint("revolute", axis, place), "world", 0.5, (0, 0, half / 2), (0.02,) * 3),
            dyn.Body(
                f"{name} high", dyn.Joint("revolute", axis, up), f"{name} low", 0.5, (0, 0, half / 2), (0.02,) * 3
            ),
            dyn.Body(upper, dyn.Joint("revolute", axis, up), f"{name} high", 0.8, (0, 0, 0.05), (0.02,) * 3),
        ]

    bodies = [*leg("x", (1.0, 0, 0), (0, out, 0), "table"), *leg("y", ACROSS, (out, 0, 0), "other")]
    return dyn.Mechanism(bodies, loops=[dyn.Loop("weld", "other", "table", at=(-out, 0, 0), to_at=(0, -out, 0))])


def spherical(rng: np.random.Generator, kind: str) -> dyn.Mechanism:
    """Four axes through one point."""
    crank, coupler, rocker, base = rng.uniform([0.3, 0.9, 0.8, 0.9], [0.4, 1.1, 1.0, 1.1])
    angles = [0.0, crank, crank + coupler, base, base + rocker]
    axes = [np.array([np.sin(a), 0.0, np.cos(a)]) for a in angles]

    def shell(name: str, on: str, axis: Array) -> dyn.Body:
        return dyn.Body(name, dyn.Joint("revolute", axis), on, 1.0, 0.5 * axis + (0.1, 0.2, 0.3), (0.1, 0.15, 0.2))

    bodies = [shell("crank", "world", axes[0]), shell("coupler", "crank", axes[1]), shell("rocker", "world", axes[3])]
    ends: dict[str, Any] = {"at": 0.7 * axes[2], "to_at": 0.7 * axes[4], "axis": axes[2], "to_axis": axes[4]}
    return dyn.Mechanism(bodies, loops=[dyn.Loop("hinge" if kind == "weld" else kind, "coupler", "rocker", **ends)])


FAMILIES: dict[str, Callable[[np.random.Generator, str], dyn.Mechanism]] = {
    "four-bar": four_bar,
    "slider-crank": slider_crank,
    "parallelogram": parallelogram,
    "sarrus": sarrus,
    "spherical": spherical,
}


def turned(mechanism: dyn.Mechanism, matrix: Array, length: float, mass: float) -> dyn.Mechanism:
    """With all frames in other axes, and in other units."""

    def inertia(given: Any) -> Array:
        whole = np.asarray(given, dtype=np.float64)
        return np.asarray(mass * length**2 * matrix @ (np.diag(whole) if whole.shape == (3,) else whole) @ matrix.T)

    def place(given: Any) -> Array:
        return np.asarray(length * matrix @ np.asarray(given))

    bodies = [
        replace(
            body,
            mass=mass * body.mass,
            center=place(body.center),
            inertia=inertia(body.inertia),
            joint=replace(body.joint, axis=matrix @ body.joint.axis, position=place(body.joint.position)),
        )
        for body in mechanism.bodies
    ]
    loops = [
        replace(
            loop,
            at=place(loop.at),
            to_at=place(loop.to_at),
            axis=matrix @ np.asarray(loop.axis),
            to_axis=matrix @ np.asarray(loop.to_axis),
        )
        for loop in mechanism.loops
    ]
    return dyn.Mechanism(bodies, length * matrix @ np.asarray(mechanism.gravity), loops=loops)


def tilted(mechanism: dyn.Mechanism, angle: float, rng: np.random.Generator) -> dyn.Mechanism:
    """With each joint's axis turned by up to that angle [rad]."""
    bodies = []
    for body in mechanism.bodies:
        axis = np.asarray(body.joint.axis)
        away = np.cross(axis, rng.normal(size=3))
        away *= angle * rng.uniform(0.1, 1.0) / np.linalg.norm(away)
        bodies.append(replace(body, joint=replace(body.joint, axis=axis + away)))
    return replace(mechanism, bodies=bodies)


def random_linkage(seed: int) -> tuple[dyn.Mechanism, dyn.Mechanism, float, float]:
    """A linkage, the same tilted, by how much, and its unit of length."""
    rng = np.random.default_rng(seed)
    family = list(FAMILIES)[int(rng.integers(len(FAMILIES)))]
    exact = FAMILIES[family](rng, str(rng.choice(LOOPS)))
    length, mass = 10.0 ** rng.uniform(-3.0, 3.0, 2)
    matrix = from_quaternion(rng.normal(size=4)) if rng.integers(2) else np.eye(3)
    exact = turned(exact, matrix, length, mass)
    angle = 10.0 ** rng.uniform(-16.0, -3.0)
    return exact, tilted(exact, angle, rng), angle, length
