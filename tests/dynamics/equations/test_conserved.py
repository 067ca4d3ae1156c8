"""Conserved quantities: those that are, and no others."""

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

    found = dyn.conserved(dyn.System(lagrangian, "across along"))
    assert list(found.quantities) == ["p.along"]
    assert found.missing["p.across"].endswith("L jumps along it")
    assert found.missing["energy"] == "L depends on t and L jumps"


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
    found = [each for each in dyn.conserved(model).quantities if each.startswith("p.")]
    assert found == [f"p.{each}" for each in names]
    system = as_system(model)
    if len(system.constraints):
        return
    graph, rng = dyn.hamilton_equations(model), np.random.default_rng(4)
    at = {node: float(rng.uniform(0.2, 1.0)) for node in graph.input_names} | system.parameters
    rates = graph.evaluate(at | {f"tau{i}": 0.0 for i in range(system.n)})
    for i, velocity in enumerate(system.velocities):
        assert (abs(rates[f"p{i}_dot"]) < 1e-13) == (velocity in names)


def particle(**more: Any) -> dyn.System:
    return dyn.System(lambda q, qd, t, p: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 0.5 * q[0] ** 2, "x y", {"B": 2.0}, **more)


def hoop(written: int) -> dyn.System:
    """A bead on a hoop that is turned, its kinetic energy written in one sum or in two."""

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> cg.Node:
        slung = (p["W"] * cg.sin(q[0])) ** 2
        kinetic = [0.5 * p["m"] * (qd[0] ** 2 + slung), 0.5 * p["m"] * qd[0] ** 2 + 0.5 * p["m"] * slung][written]
        return kinetic + 9.81 * p["m"] * cg.cos(q[0])

    return dyn.System(lagrangian, "angle", {"m": 2.0, "W": 3.0})


def in_field(q: Any, qd: Any, t: Any) -> cg.Node:
    return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + qd[2] ** 2) + 2.0 * q[0] * qd[1]


def spring_pendulum(q: Any, qd: Any, t: Any) -> cg.Node:
    return 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2) - 4.5 * (q[0] - 1.0) ** 2 + 9.81 * q[0] * cg.cos(q[1])


def in_x_and_y(q: Any, qd: Any, t: Any, p: Any) -> cg.Node:
    return p["m"] * (0.5 * (qd[0] ** 2 + qd[1] ** 2) + 1.0 / cg.hypot(q[0], q[1]))


SKATE = {"velocity_constraints": lambda q, qd, t: {"edge": cg.sin(q[0]) * qd[0] - cg.cos(q[0]) * qd[1]}}
ENERGIES = {
    "Kepler": (kepler(), {"p.phi", "energy"}),
    "Kepler in x and y, per mass": (dyn.System(in_x_and_y, "x y", {"m": 2.0}), {"energy"}),
    "spherical pendulum and spin": (euler_top(), {"p.turn", "p.spin", "energy"}),
    "spring pendulum": (dyn.System(spring_pendulum, "r angle"), {"energy"}),
    "charge in a magnetic field": (dyn.System(in_field, "x y z"), {"p.y", "p.z", "energy"}),
    "charge in a magnetic field, as a force": (
        particle(forces=lambda q, qd, t, p: [p["B"] * qd[1], -p["B"] * qd[0]]), {"energy"},
    ),
    "hoop": (hoop(0), {"Jacobi's integral"}),
    "hoop in two terms": (hoop(1), {"Jacobi's integral"}),
    "relativistic": (dyn.System(lambda q, qd, t: -cg.sqrt(9.0 - qd[0] ** 2) - q[0] ** 2, "x"), {"Jacobi's integral"}),
    "spring in one factor": (dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 - 9.0 * q[0] ** 2), "x"), {"energy"}),
    "Atwood": (particle(constraints=lambda q, t: {"rope": q[0] + q[1] - 1.0}), {"energy"}),
    "a track that moves": (particle(constraints=lambda q, t: {"track": q[0] - cg.sin(3.0 * t)}), {"p.y"}),
    "skate": (particle(**SKATE), {"energy"}),
    "pushed skate": (
        particle(velocity_constraints=lambda q, qd, t: {"edge": q[0] * qd[0] - qd[1] - 1.0}), set(),
    ),
    "damped": (particle(damping=[0.0, 0.1]), set()),
    "damped by a parameter": (particle(damping=[cg.variable("B"), 0.0]), {"p.y"}),
    "driven": (particle(forces=lambda q, qd, t: [0.0, cg.sin(t)]), set()),
    "arm": (dyn.planar_arm([1.0, 1.0], [1.0, 0.5]), {"energy"}),
    "damped tree in space": (free_tree((0.0, 0.0, 0.0)), {"p.base.vx", "p.base.vy", "p.base.vz"}),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::dynamics.ConstraintWarning")  # starts are moved onto constraints
@pytest.mark.parametrize("name", ENERGIES)
def test_momenta_and_energies_stay_as_they_are_and_others_do_not(name: str) -> None:
    """Along a motion to 1e-10; each that is missing changes by more than 1e-4."""
    model, names = ENERGIES[name]
    found, rng = dyn.conserved(model), np.random.default_rng(3)
    assert set(found.quantities) == names
    start = rng.uniform(0.4, 0.9, as_system(model).nq), rng.uniform(0.4, 0.9, len(model.velocities))
    motion = dyn.simulate(model, *start, 1.0, "dop853", rtol=1e-12, t_eval=[0.0, 0.5, 1.0])

    def along(graph: cg.Graph) -> np.ndarray:
        return np.column_stack([*dyn.arrays_at(model, graph, motion.q, motion.qd).values()])

    others = dict(zip([f"p.{u}" for u in model.velocities], along(dyn.momentum(model)).T, strict=True))
    others["energy"] = along(dyn.energy(model))
    assert set(found.quantities) | set(found.missing) >= set(others) - {"energy"}
    for each in found.missing:
        assert np.ptp(others[each]) > 1e-4, each
    for each, graph in found.quantities.items():
        row = along(graph)
        assert np.ptp(row) < 1e-10 * (1.0 + np.abs(row).max()), each
