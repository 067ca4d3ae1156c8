"""Conserved momenta: those that are, and no others."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics import as_system

from ..linkages import four_bar
from ..mechanisms import random_mechanism
from ..models import cart_pendulum, coupled_springs


def kepler() -> dyn.System:
    return dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2) + 1.0 / q[0], "r phi")


def top(lopsided: float = 0.0) -> dyn.Mechanism:
    """A body on three hinges, about the vertical, across it, and about its own axis."""
    z, none = (0.0, 0.0, 1.0), {"mass": 0.0, "inertia": (0.0, 0.0, 0.0)}
    spun = dyn.Body(
        "spin", dyn.Joint("revolute", z), "nod", 1.0, (0.0, 0.0, 0.5), (0.3, 0.3 + lopsided, 0.1)
    )  # fmt: skip
    turned = dyn.Body("turn", dyn.Joint("revolute", z), "world", **none)
    return dyn.Mechanism([turned, dyn.Body("nod", dyn.Joint("revolute", (1.0, 0.0, 0.0)), "turn", **none), spun])


def euler_top() -> dyn.System:
    """The same top by its Lagrangian."""

    def lagrangian(q: Any, qd: Any, t: Any) -> cg.Node:
        c, s = cg.cos(q[1]), cg.sin(q[1])
        return 0.5 * (qd[1] ** 2 + (qd[0] * s) ** 2) + 0.2 * (qd[2] + qd[0] * c) ** 2 - 4.0 * c

    return dyn.System(lagrangian, "turn nod spin")


def free_tree(gravity: Any) -> dyn.Mechanism:
    base = random_mechanism(1, ["revolute"], 1).bodies[0]
    return dyn.Mechanism(
        [
            dyn.Body("base", dyn.Joint("free"), "world", 1.0, (0.1, 0.0, 0.2), (0.2, 0.3, 0.4)),
            dyn.Body("limb", base.joint, "base", base.mass, base.center, base.inertia),
        ],
        gravity,
    )


def cart() -> dyn.System:
    def lagrangian(q: Any, qd: Any, t: Any) -> cg.Node:
        x, y = qd[0] + qd[1] * cg.cos(q[1]), qd[1] * cg.sin(q[1])
        return 0.5 * qd[0] ** 2 + 0.4 * (x * x + y * y) + 9.81 * cg.cos(q[1])

    return dyn.System(lagrangian, "cart pendulum")


def pulled() -> dyn.System:
    """A mass that nothing but a constant force, a damper and a wall hold: on x, y and z."""
    return dyn.System(
        lambda q, qd, t: 0.5 * sum(u * u for u in qd),
        "x y z w",
        forces=lambda q, qd, t: [1.0, 0.0, 0.0, 0.0],
        damping=[0.0, 0.1, 0.0, 0.0],
        constraints=lambda q, t: {"wall": q[2]},
    )


def rooted(kind: str, axis: Any, gravity: float) -> dyn.Mechanism:
    """A body with a limb on a joint without springs and dampers."""
    limb = random_mechanism(1, ["revolute"], 1).bodies[0]
    base = dyn.Body(
        "base", dyn.Joint(kind, axis, pitch=0.2 * (kind == "screw")), "world", 1.0, (0.1, 0.0, 0.2), (0.2, 0.3, 0.4)
    )
    return dyn.Mechanism([base, replace(limb, name="limb", parent="base")], (0.0, 0.0, -gravity))


STEPS = {
    "floor": cg.floor,
    "fmod": lambda x: x - cg.fmod(x, 1.0),
    "sign": lambda x: cg.sign(x - 1.0),
    "less": lambda x: cg.less(x, 2.0),
    "where": lambda x: cg.where(cg.less(x, 2.0), 3.0, 4.0),
    "within": lambda x: cg.where(cg.floor(x), 3.0, cg.ceil(x)),
}


@pytest.mark.parametrize("name", STEPS)
@pytest.mark.parametrize("of", ["potential", "inertia"])
def test_a_step_along_a_coordinate_is_not_conserved(name: str, of: str) -> None:
    """Its slope is 0 beside the step; of the coordinate along the step, the momentum is constant."""

    def lagrangian(q: Any, qd: Any, t: Any) -> cg.Node:
        step = STEPS[name](q[0])
        inertia, potential = (2.0 + step, 0.0) if of == "inertia" else (1.0, step)
        return 0.5 * inertia * qd[0] ** 2 + 0.5 * qd[1] ** 2 * cg.floor(3.0 + cg.sin(t)) - potential

    assert dyn.conserved_momenta(dyn.System(lagrangian, "across along")) == ("along",)


X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
CASES = {
    "an upright hinge": (lambda: rooted("revolute", Z, 9.81), ("base",)),
    "a slide": (lambda: rooted("prismatic", X, 9.81), ("base",)),
    "an upright screw": (lambda: rooted("screw", Z, 9.81), ()),
    "a screw in space": (lambda: rooted("screw", X, 0.0), ("base",)),
    "an upright cylinder": (lambda: rooted("cylindrical", Z, 9.81), ("base.angle",)),
    "a plane in space": (lambda: rooted("planar", Z, 0.0), ("base.x", "base.y")),
    "a ball in space": (lambda: rooted("ball", Z, 0.0), ()),  # about axes in the world, which no velocity is of
    "Kepler": (kepler, ("phi",)),
    "top of bodies": (top, ("turn", "spin")),
    "lopsided top": (lambda: top(0.1), ("turn",)),
    "top": (euler_top, ("turn", "spin")),
    "free tree": (lambda: free_tree((0.0, 0.0, -9.81)), ("base.vx", "base.vy")),
    "free tree in space": (lambda: free_tree((0.0, 0.0, 0.0)), ("base.vx", "base.vy", "base.vz")),
    "pendulum on a cart": (cart, ("cart",)),
    "springs": (coupled_springs, ()),
    "pendulum on a cart on a spring": (cart_pendulum, ()),
    "a mass that is held": (pulled, ("w",)),
    "a loop": (four_bar, ()),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_conserved_is_named_and_nothing_else(name: str) -> None:
    """By the rates of momenta at random states: 0 of those that are named, and of no other."""
    make, names = CASES[name]
    model = make()
    assert dyn.conserved_momenta(model) == names
    system = as_system(model)
    if len(system.constraints):
        return
    graph, rng = dyn.hamilton_equations(model), np.random.default_rng(4)
    at = {node: float(rng.uniform(0.2, 1.0)) for node in graph.input_names} | system.parameters
    rates = graph.evaluate(at | {f"tau{i}": 0.0 for i in range(system.n)})
    for i, velocity in enumerate(system.velocities):
        assert (abs(rates[f"p{i}_dot"]) < 1e-13) == (velocity in names)
