"""Agreement: the largest differences of our equations from those of MuJoCo and Pinocchio at random states."""

from collections.abc import Iterator

import numpy as np

import cgraph as cg
from dynamics import Mechanism, bias, forward_dynamics, inverse_dynamics, mass_matrix, planar_arm
from tests.bench.peers.mujoco import MujocoPeer
from tests.bench.peers.peer import PeerModel
from tests.bench.peers.pinocchio import PinocchioPeer
from tests.bench.tables import Table
from tests.bench.timing import relative_difference

LINKS, STATES = 10, 100
QUANTITIES = {"tau": inverse_dynamics, "qdd": forward_dynamics, "M": mass_matrix, "bias": bias}
PEERS: dict[str, type[MujocoPeer] | type[PinocchioPeer]] = {"MuJoCo": MujocoPeer, "Pinocchio": PinocchioPeer}


def agreement(links: int = LINKS, count: int = STATES) -> Iterator[Table | str]:
    """A table for each peer and mass model: arms of 1 to `links` links, relative to the largest entry at the state."""
    for name, make in PEERS.items():
        for mass_model in ("rod", "point"):
            title = f"largest relative difference from {name}, {mass_model}s, {count} states"
            rows = []
            try:
                for n in range(1, links + 1):
                    arm = random_arm(n, mass_model)
                    worst = differences(arm, make(PeerModel(name, arm)), count)
                    rows.append([str(n), *[f"{worst[quantity]:.1e}" for quantity in QUANTITIES]])
            except ImportError as missing:
                yield f"{title}: not measured, {missing}"
                break
            yield Table(title, ["links", *QUANTITIES], rows, ())


def random_arm(n: int, mass_model: str) -> Mechanism:
    """An arm of n unlike links with damping."""
    rng = np.random.default_rng(n)
    masses, lengths, damping = (rng.uniform(low, 3.0 * low, n).tolist() for low in (0.5, 0.5, 0.15))
    return planar_arm(masses, lengths, damping, mass_model)


def differences(arm: Mechanism, peer: MujocoPeer | PinocchioPeer, count: int) -> dict[str, float]:
    """The largest difference of each quantity over random states, relative to its largest entry at the state."""
    functions = {name: cg.compile(make(arm)) for name, make in QUANTITIES.items()}
    rng = np.random.default_rng((len(arm.links), 1))
    worst = dict.fromkeys(QUANTITIES, 0.0)
    for _ in range(count):
        state = {"q": rng.uniform(-3.0, 3.0, peer.case.n)}
        state |= {name: rng.uniform(-0.9, 0.9, peer.case.n) for name in ("qd", "qdd", "tau")}
        theirs = peer.quantities(**state)
        for name, function in functions.items():
            inputs = [x for key, x in state.items() if f"{key}0" in function.graph.input_names]
            worst[name] = max(worst[name], relative_difference(function(np.concatenate(inputs)), theirs[name].ravel()))
    return worst
