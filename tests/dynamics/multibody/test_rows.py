"""Rows beside straight graphs: all kinds of joints, all quantities, one state and many, and after every change."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
from pytest import mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.multibody.joints import TYPES
from tests.dynamics.mechanisms import EVERY_KIND, random_state, random_tree
from tests.dynamics.models import Array
from tests.dynamics.multibody.test_user_joints import Angles
from tests.slow import slow

ROUNDING = 1e-13  # of the largest entry
TOOL = dyn.Body("tool", dyn.Joint("fixed", position=(0.1, 0.2, 0.3)), "b1", 0.3, (0.1, 0.0, 0.0), (0.1, 0.1, 0.1))


def assert_same(rows: dyn.Rows, model: dyn.Mechanism) -> None:
    """All quantities at three states as those of graphs; accelerations by the torques that they take."""
    assert (rows.coordinates, rows.velocities) == (model.coordinates, model.velocities)
    q, qd, qdd, _ = [np.array(each) for each in zip(*[random_state(model, seed) for seed in range(3)], strict=True)]
    at, n = np.hstack([q, qd, qdd]).T, rows.n
    torques = cg.compile(dyn.inverse_dynamics(model)).batch(at).T
    slopes = cg.compile(dyn.inverse_dynamics_derivatives(model)).batch(at)[n:].T.reshape(3, 3, n, n).swapaxes(0, 1)
    placements = [dyn.arrays_at(model, dyn.frame_placement(model, body), q[0]) for body in rows.bodies]
    found: dict[str, tuple[Array, Array]] = {
        "inverse": (rows.inverse(q, qd, qdd), torques),
        "at one state": (rows.inverse(q[0], qd[0], qdd[0]), torques[0]),
        "forward": (np.einsum("nij,nj->ni", slopes[2], rows.forward(q, qd, torques) - qdd) + torques, torques),
        "energy": (sum(rows.energy(q, qd)), cg.compile(dyn.energy(model)).batch(at[: rows.nq + n])[0]),
        "positions": (rows.frames(q)[0][0], np.array([each["p"] for each in placements])),
        "axes": (rows.frames(q[0])[1], np.array([each["R"] for each in placements])),
    }
    found["mass"] = rows.mass_matrix(q[0]), slopes[2][0]
    if all(body.joint.type.turns_with_body for body in model.moving) and not any(
        body.gravity_compensation for body in model.bodies
    ):
        inverse_mass = rows.forward_derivatives(q, qd, torques)[2]
        found |= {f"slope {k}": (got, slopes[k]) for k, got in enumerate(rows.inverse_derivatives(q, qd, qdd))}
        found["inverse mass"] = slopes[2] @ inverse_mass @ slopes[2], slopes[2]
    else:
        with raises(dyn.MechanismError, match=r"^derivatives by rows know no (gravity|changing directions)"):
            rows.inverse_derivatives(q, qd, qdd)
    error = {name: np.abs(a - b).max() / np.abs(b).max() for name, (a, b) in found.items()}
    assert {name: size for name, size in error.items() if not size <= ROUNDING} == {}


@mark.parametrize("seed", [0, *slow(*range(1, 40))])
def test_rows_are_the_graphs_for_every_kind_of_joint_and_after_every_change(seed: int) -> None:
    """Joints are locked where they stand by default, also one of several coordinates, and elsewhere."""
    with patch.dict(TYPES, angles=Angles()):
        rng = np.random.default_rng(seed)
        model = random_tree(seed, 6, [*EVERY_KIND, "angles"])
        rows, last = dyn.Rows(model), model.bodies[-1].name
        tool, other = replace(TOOL, parent=last), replace(model.bodies[int(rng.integers(6))], mass=3.0)
        grown = random_tree(seed, 3, base=("planar", "revolute", "free")[seed % 3])
        limb = [replace(body, name=f"x{body.name}", parent=f"x{body.parent}") for body in grown.bodies]
        moved = [body.name for body in model.bodies if body.joint.moves and len(body.joint.neutral) == 1]
        for change in (
            lambda m: m,
            lambda m: m.attach(limb, to=last),
            lambda m: m.attach(tool),
            lambda m: m.lock(limb[0].name),
            lambda m: m.with_body(replace(tool, mass=0.9, center=(0.0, 0.2, 0.0))),
            lambda m: m.unlock(limb[0].name),
            lambda m: m.detach(limb[1].name),
            lambda m: m.with_body(other),
            *[lambda m, body=body, at=at: m.lock(body, at) for body, at in zip(moved, (None, 0.3), strict=False)],
        ):  # fmt: skip
            model = change(model)
            change(rows)
            assert_same(rows, model)
        assert rows.mechanism.coordinates == model.coordinates


def test_forces_and_balanced_weights_are_in_the_rows() -> None:
    model, tool = random_tree(3, 5, EVERY_KIND), replace(TOOL, parent="b4")
    push, slip = dyn.Force("b4", (1.0, 2.0, 3.0), torque=(0.1, 0.2, 0.3)), dyn.Contact("b3", radius=0.1, stiffness=50.0)
    light = replace(model, bodies=[replace(body, gravity_compensation=0.4) for body in model.bodies])
    for whole in (replace(model, forces=[push, slip]), light):
        rows = dyn.Rows(whole)
        assert_same(rows, whole)
        rows.attach(tool)
        assert_same(rows, whole.attach(tool))


def test_what_rows_do_not_take_is_told() -> None:
    arm = dyn.planar_arm([1.0, 1.0], [1.0, 1.0])
    with raises(ValueError, match=r"^qd must have shape \(2,\) or \(N, 2\), a number for each, got \(3,\)$"):
        dyn.Rows(arm).inverse([0.1, 0.2], [0.0] * 3, [0.0] * 2)
    closed = dyn.Rows(replace(arm, loops=[dyn.Loop("point", "link 2", "world", (0.0, 0.0, -1.0), (1.0, 0.0, -1.0))]))
    with raises(dyn.MechanismError, match=r"accelerations by rows are those of a tree, and .* closes a loop"):
        closed.forward([0.1, 0.2], [0.0] * 2, [0.0] * 2)
