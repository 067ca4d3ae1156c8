"""Mechanisms in space against Pinocchio, which gets the bodies one by one and shares no code with MuJoCo's compiler."""

from __future__ import annotations

import numpy as np
import pytest
from pytest import mark

import dynamics as dyn
from tests.dynamics.mechanisms import FAMILIES, random_mechanism
from tests.dynamics.models import at, error, run, states

pytest.importorskip("pinocchio", reason="the bench extra has it")
from tests.dynamics.pinocchio_twin import PinocchioTwin

STATES = 100
AGREEMENT = 1e-10  # of the largest entry: rounding of two codes, times the condition number of M


SCREWS = {"screws": lambda n: random_mechanism(n, ["screw", "revolute", "prismatic"], 2)}


@mark.parametrize("n", [1, 2, 7, 20, 40])
@mark.parametrize("family", [*FAMILIES, *SCREWS])
def test_random_mechanisms_agree_with_pinocchio(family: str, n: int, record_property) -> None:
    """aba, rnea and crba: hinges, slides and screws about any axis, branches, welds, springs, damping and armature."""
    mechanism = (FAMILIES | SCREWS)[family](n)
    peer, given = PinocchioTwin(mechanism), states(mechanism, STATES, seed=n)
    rows = [at(given, row) for row in range(STATES)]
    theirs = {
        "aba": [peer.aba(row["q"], row["qd"], row["tau"]) for row in rows],
        "rnea": [peer.rnea(row["q"], row["qd"], row["qdd"]) for row in rows],
        "crba": [peer.crba(row["q"]).ravel() for row in rows],
    }
    ours = {"aba": dyn.forward_dynamics, "rnea": dyn.inverse_dynamics, "crba": dyn.mass_matrix}
    errors = {name: error(run(make(mechanism), given), np.array(theirs[name])) for name, make in ours.items()}
    for name, worst in errors.items():
        record_property(name, worst)
    print(f"{family} {n}:", *(f"{name} {worst:.0e}" for name, worst in errors.items()))  # noqa: T201
    assert max(errors.values()) < AGREEMENT


@mark.parametrize("n", [3, 10])
def test_pinned_chains_agree_with_pinocchio(n: int) -> None:
    """constraintDynamics of a chain whose tip is held at a point, without its stabilisation."""
    import pinocchio as pin

    arm = dyn.planar_arm([1.0] * n, [0.8] * n)
    pinned = dyn.Mechanism(arm.bodies, arm.gravity, loops=[dyn.Loop("point", "tip", to_at=(1.0, 0.0, 0.0))])
    rng = np.random.default_rng(n)
    q, qd = dyn.consistent_state(pinned, 0.6 * rng.normal(size=n), rng.normal(size=n))
    tau = rng.normal(size=n)
    model = pin.buildModelFromXML(dyn.to_urdf(arm))
    data, models, datas = model.createData(), pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    tip, post = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.8])), pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
    models.append(
        pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, model.njoints - 1, tip, 0, post, pin.LOCAL)
    )
    datas.append(models[0].createData())
    pin.initConstraintDynamics(model, data, models, datas)
    turns = np.column_stack([np.cos(q), np.sin(q)]).ravel()
    theirs = pin.constraintDynamics(model, data, turns, qd, tau, models, datas, pin.ProximalSettings(1e-12, 1e-12, 20))
    ours = run(dyn.forward_dynamics(pinned), {"q": q, "qd": qd, "tau": tau})[:n]
    assert error(ours, np.array(theirs)) < AGREEMENT
