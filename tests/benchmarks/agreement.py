"""Largest relative differences from MuJoCo and Pinocchio: `python tests/benchmarks/agreement.py`.

Planar arms of 1 to 10 links at 100 random states, relative to the largest entry at the same state. Prints what is
installed; asserts nothing.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import cgraph as cg
import dynamics as dyn
from dynamics.io.mujoco_model import MujocoTwin
from tests.dynamics.models import at, error, random_arm, states

QUANTITIES = {
    "tau": dyn.inverse_dynamics,
    "qdd": dyn.forward_dynamics,
    "M": dyn.mass_matrix,
    "bias": dyn.bias,
}
Peer = Callable[[dict[str, Any]], dict[str, Any]]


def mujoco_peer(arm: dyn.Mechanism) -> Peer:
    """MuJoCo's values at a state."""
    twin = MujocoTwin(arm)
    return lambda x: {
        "tau": twin.inverse(x["q"], x["qd"], x["qdd"]),
        "qdd": twin.accelerations(x["q"], x["qd"], x["tau"]),
        "M": twin.mass_matrix(x["q"]).ravel(),
        "bias": twin.bias(x["q"], x["qd"]),
    }


def pinocchio_peer(arm: dyn.Mechanism) -> Peer:
    """Pinocchio's values at a state, its damping added beside it."""
    import pinocchio

    from tests.dynamics.pinocchio_twin import pinocchio_model

    model, damping = pinocchio_model(arm), np.array(arm.system.damping)
    data = model.createData()
    return lambda x: {
        "tau": pinocchio.rnea(model, data, x["q"], x["qd"], x["qdd"]) + damping * x["qd"],
        "qdd": pinocchio.aba(model, data, x["q"], x["qd"], x["tau"] - damping * x["qd"]),
        "M": pinocchio.crba(model, data, x["q"]).ravel(),
        "bias": pinocchio.nonLinearEffects(model, data, x["q"], x["qd"]).copy(),
    }


PEERS = {"MuJoCo": mujoco_peer, "Pinocchio": pinocchio_peer}


def differences(arm: dyn.Mechanism, peer: Peer, count: int) -> dict[str, float]:
    """The largest relative difference of each quantity over random states."""
    functions = {name: cg.compile(make(arm)) for name, make in QUANTITIES.items()}
    many = states(arm, count)
    worst = dict.fromkeys(QUANTITIES, 0.0)
    for row in range(count):
        state = at(many, row)
        theirs = peer(state)
        for name, function in functions.items():
            given = [x for x in ("q", "qd", "qdd", "tau") if f"{x}0" in function.graph.input_names]
            ours = function(np.concatenate([state[x] for x in given]))
            worst[name] = max(worst[name], error(ours, theirs[name]))
    return worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--links", type=int, default=10, help="arms of 1 to this many links (default: 10)")
    parser.add_argument("--states", type=int, default=100, help="random states of each arm (default: 100)")
    arguments = parser.parse_args()
    for name, make in PEERS.items():
        for model in ("rod", "point"):
            print(f"largest relative difference from {name}, {model}s, {arguments.states} states")
            try:
                make(random_arm(1, model=model))
            except ImportError as missing:
                print(f"  not measured: {missing}")
                break
            print(f"{'links':>7}" + "".join(f"{quantity:>10}" for quantity in QUANTITIES))
            for n in range(1, arguments.links + 1):
                arm = random_arm(n, model=model)
                worst = differences(arm, make(arm), arguments.states)
                print(f"{n:>7}" + "".join(f"{value:>10.1e}" for value in worst.values()))


if __name__ == "__main__":
    main()
