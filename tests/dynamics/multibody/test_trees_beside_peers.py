"""Trees of bodies on joints of every kind beside Pinocchio and MuJoCo, which share no code with us or one another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
from pytest import mark, param

import dynamics as dyn
from tests.bench.peers import PEERS
from tests.bench.peers.peer import PeerModel
from tests.dynamics.mechanisms import EVERY_KIND, for_peers, random_state, random_tree
from tests.dynamics.models import run

PEER = 1e-14  # of the sums of sizes that an answer comes from
INSTALLED = [name for name in ("mujoco", "pinocchio") if PEERS[name].installed]


def errors(mechanism: dyn.Mechanism, seed: int) -> dict[str, float]:
    """How far each peer is from our graphs at a random state, over the sums of sizes that the answers come from."""
    q, qd, qdd, tau = random_state(mechanism, seed)
    rows = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    ours = {
        "tau": run(dyn.inverse_dynamics(mechanism), rows),
        "qdd": run(dyn.forward_dynamics(mechanism), rows),
        "M": run(dyn.mass_matrix(mechanism), rows).reshape(len(qd), len(qd)),
        "bias": run(dyn.bias(mechanism), rows),
        "recursive": dyn.RecursiveInverseDynamics(mechanism)(q, qd, qdd),
    }
    weight, M = run(dyn.gravity_force(mechanism), rows), np.abs(ours["M"])
    braking = np.abs(np.array(mechanism.system.damping) * qd)
    bias = np.abs(weight) + np.abs(ours["bias"] - weight)
    torque = M @ np.abs(qdd) + bias + braking
    acceleration = np.abs(np.linalg.inv(ours["M"])) @ (np.abs(tau) + bias + braking)
    scales = {"tau": torque, "qdd": acceleration, "M": M, "bias": torque, "recursive": torque}
    result = {}
    for peer in INSTALLED:
        if peer == "mujoco" and any(not body.joint.type.mjcf for body in mechanism.moving):
            continue  # which it has not
        theirs = PEERS[peer].make(PeerModel("tree", mechanism)).quantities(**rows)  # type: ignore[attr-defined]
        theirs["recursive"] = theirs["tau"]
        for name, scale in scales.items():
            result[f"{peer} {name}"] = float(np.abs(ours[name] - theirs[name]).max() / scale.max())
    return result


@mark.skipif(not INSTALLED, reason="neither MuJoCo nor Pinocchio is installed")
@mark.parametrize("count", [6, param(1000, marks=[mark.slow, mark.timeout(3600)])])
def test_peers_find_the_same(count: int, record_property: Callable[[str, object], None]) -> None:
    worst, trees = dict[str, float](), Counter[str]()
    for seed in range(100, 100 + count):
        found = errors(for_peers(random_tree(seed, 1 + seed % 7, EVERY_KIND), seed), seed)
        trees.update({name.split()[0] for name in found})
        for name, error in found.items():
            worst[name] = max(error, worst.get(name, 0.0))
    record_property("worst", worst)
    print(dict(trees), ", ".join([f"{name} {error:.1e}" for name, error in worst.items()]))  # noqa: T201
    assert max(worst.values()) <= PEER, worst
