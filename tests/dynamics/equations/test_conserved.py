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
from ..models import coupled_springs
from ..textbook import TEXTBOOK


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


def free_tree(gravity: Any) -> dyn.Mechanism:
    base = random_mechanism(1, ["revolute"], 1).bodies[0]
    return dyn.Mechanism(
        [
            dyn.Body("base", dyn.Joint("free"), "world", 1.0, (0.1, 0.0, 0.2), (0.2, 0.3, 0.4)),
            dyn.Body("limb", base.joint, "base", base.mass, base.center, base.inertia),
        ],
        gravity,
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


def particle(**more: Any) -> dyn.System:
    return dyn.System(lambda q, qd, t, p: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 0.5 * q[0] ** 2, "x y", {"B": 2.0}, **more)


def in_x_and_y(q: Any, qd: Any, t: Any, p: Any) -> cg.Node:
    return p["m"] * (0.5 * (qd[0] ** 2 + qd[1] ** 2) + 1.0 / cg.hypot(q[0], q[1]))


X, Z = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
EDGE = cg.sin(cg.variable("q0")) * cg.variable("qd0") - cg.cos(cg.variable("q0")) * cg.variable("qd1")
CASES = {
    "an upright hinge": (lambda: rooted("revolute", Z, 9.81), "p.base"),
    "a slide": (lambda: rooted("prismatic", X, 9.81), "p.base"),
    "an upright screw": (lambda: rooted("screw", Z, 9.81), ""),
    "a screw in space": (lambda: rooted("screw", X, 0.0), "p.base"),
    "an upright cylinder": (lambda: rooted("cylindrical", Z, 9.81), "p.base.angle"),
    "a plane in space": (lambda: rooted("planar", Z, 0.0), "p.base.x p.base.y"),
    "a ball in space": (lambda: rooted("ball", Z, 0.0), ""),  # about axes in the world, which no velocity is of
    "Kepler": (kepler, "p.phi energy"),
    "Kepler in x and y, per mass": (lambda: dyn.System(in_x_and_y, "x y", {"m": 2.0}), "energy"),
    "top of bodies": (top, "p.turn p.spin energy"),
    "lopsided top": (lambda: top(0.1), "p.turn energy"),
    "free tree": (lambda: free_tree((0.0, 0.0, -9.81)), "p.base.vx p.base.vy"),
    "free tree in space": (lambda: free_tree((0.0, 0.0, 0.0)), "p.base.vx p.base.vy p.base.vz"),
    "springs": (coupled_springs, ""),
    "a loop": (four_bar, "energy"),
    "magnetic force": (lambda: particle(forces=lambda q, qd, t, p: [p["B"] * qd[1], -p["B"] * qd[0]]), "energy"),
    "hoop in two terms": (lambda: dyn.System(lambda q, qd, t: qd[0] ** 2 + cg.sin(q[0]) ** 2 - q[0], "x"), "Jacobi"),
    "train": (lambda: dyn.System(lambda q, qd, t: 0.5 * (qd[0] + 2.0) ** 2 - q[0] ** 2, "x"), "Jacobi"),
    "spring in one factor": (lambda: dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 - 9.0 * q[0] ** 2), "x"), "energy"),
    "Atwood": (lambda: particle(constraints=lambda q, t: {"rope": q[0] + q[1] - 1.0}), "energy"),
    "a track that moves": (lambda: particle(constraints=lambda q, t: {"track": q[0] - cg.sin(3.0 * t)}), "p.y"),
    "skate": (lambda: particle(velocity_constraints=lambda q, qd, t: {"edge": EDGE}), "energy"),
    "pushed skate": (lambda: particle(velocity_constraints=lambda q, qd, t: {"edge": EDGE - 1.0}), ""),
    "damped by a parameter": (lambda: particle(damping=[cg.variable("B"), 0.0]), "p.y"),
    "damped and driven": (lambda: particle(forces=lambda q, qd, t: [0.0, cg.sin(t)], damping=[0.1, 0.0]), ""),
    "hoop": (TEXTBOOK["hoop"], "Jacobi"),  # from the place of the bead at time t, as are the next two
    "rotating tube": (TEXTBOOK["rotating tube"], "Jacobi"),
    "turning frame": (TEXTBOOK["turning frame"], "Jacobi"),
    "moving pivot": (TEXTBOOK["moving pivot"], ""),
    "relativistic": (lambda: dyn.System(lambda q, qd, t: -cg.sqrt(9.0 - qd[0] ** 2) - q[0] ** 2, "x"), "Jacobi"),
    "charge in a magnetic field": (TEXTBOOK["charge"], "p.phi energy"),
    "heavy top": (TEXTBOOK["top"], "p.phi p.psi energy"),
    "spherical pendulum": (TEXTBOOK["spherical"], "p.x1 energy"),
    "spring pendulum": (TEXTBOOK["elastic"], "energy"),
    "swinging Atwood": (TEXTBOOK["swinging Atwood"], "energy"),
    "pendulum on a cart": (TEXTBOOK["cart pole"], "p.x0 energy"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::dynamics.ConstraintWarning")  # starts are moved onto constraints
@pytest.mark.parametrize("name", CASES)
def test_what_is_conserved_is_named_and_nothing_else(name: str) -> None:
    """Along a motion to 1e-10; each that is missing changes by more than 1e-4."""
    make, names = CASES[name]
    model = make()
    found, rng = dyn.conserved(model), np.random.default_rng(3)
    assert [each.removesuffix("'s integral") for each in found.quantities] == names.split()
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
