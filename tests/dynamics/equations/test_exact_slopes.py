"""Derivatives of random trees of bodies against 60 digits without graphs, and beside Pinocchio's errors."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import pytest

import dynamics as dyn
from tests.dynamics.mechanisms import TREES, Array, floating, random_mechanism, random_state, random_tree, turned_arm
from tests.dynamics.tree_in_digits import Slopes, digits, exactly, floats, slopes_in_digits
from tests.slow import slow

# Of the largest entry of a matrix of slopes of torques; and, of slopes X of accelerations, M X = dtau, of what a
# relative change of M and of dtau may do to X: of the largest entry of |M^-1| (|M| |X| + |dtau|).
ROUNDING = 4e-15
LONG_CHAIN = 1e-14  # of the largest entry, of slopes of forward dynamics by elimination itself


class Errors(NamedTuple):
    """The largest errors of slopes by q, qd, and qdd or tau, over the largest entry of these.

    conditioned: those of accelerations over the largest entry of |M^-1| (|M| |X| + |sides|), of the solution X of M X =
    sides. It is what a relative change of all numbers in M and in the sides may do to X.
    """

    torques: tuple[float, ...]
    accelerations: tuple[float, ...]
    conditioned: tuple[float, ...]

    def __str__(self) -> str:
        return "; ".join([" ".join([f"{error:.1e}" for error in each]) for each in self])


def errors(found: Slopes, exact: Slopes) -> Errors:
    with digits():
        off = [np.abs(floats(a - exactly(b))) for a, b in zip(exact[:2], found[:2], strict=True)]
    torques, accelerations, sides = (np.abs(floats(each)) for each in exact)
    n = len(sides)
    conditioned = accelerations[:, 2 * n :] @ (torques[:, 2 * n :] @ accelerations + sides)

    def over(errors: Array, sizes: Array) -> tuple[float, ...]:
        blocks = zip(np.hsplit(errors, 3), np.hsplit(sizes, 3), strict=True)
        return tuple([float(error.max() / max(size.max(), 1e-300)) for error, size in blocks])

    return Errors(over(off[0], torques), over(off[1], accelerations), over(off[1], conditioned))


def ours(tree: dyn.Mechanism, state: tuple[Array, ...]) -> Slopes:
    q, qd, qdd, tau = state
    found = dyn.arrays_at(tree, dyn.inverse_dynamics_derivatives(tree), q, qd, qdd)
    A, B = dyn.linearize(tree, q, qd, tau)
    n = len(qd)
    return Slopes(np.hstack([found[name] for name in ("dtau_dq", "dtau_dqd", "M")]), np.hstack([A[n:], B[n:]]))


def pinocchios(tree: dyn.Mechanism, state: tuple[Array, ...]) -> Slopes:
    from tests.bench.peers import PeerModel
    from tests.bench.peers.pinocchio import PinocchioPeer

    peer, (q, qd, qdd, tau) = PinocchioPeer(PeerModel("tree", tree)), state
    return Slopes(
        peer.slopes(np.concatenate([q, qd, qdd]), "inverse-derivatives"),
        peer.slopes(np.concatenate([q, qd, tau]), "derivatives"),
    )


def require_exact(off: Errors) -> None:
    assert max(off.torques) < ROUNDING
    assert max(off.conditioned) < ROUNDING


OTHERS = ("hinges", "a free base in its own axes", "fixed")  # of which others have most


@pytest.mark.parametrize("name", [*[name for name in TREES if name not in OTHERS], *slow(*OTHERS)])
def test_slopes_of_every_kind_of_joint_are_exact(name: str) -> None:
    tree = TREES[name]()
    state = random_state(tree, 0)
    require_exact(errors(ours(tree, state), slopes_in_digits(tree, *state)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(200))
def test_slopes_of_random_trees_are_exact(seed: int, record_property: Any) -> None:
    """Chains and branches of hinges, slides, balls and welds, on fixed and free bases; Pinocchio's if installed.

    Of 1 to 31 bodies, as many trees of up to 5 as beyond.
    """
    tree = random_tree(seed, round(10 ** np.random.default_rng(seed).uniform(0.0, 1.5)))
    state = random_state(tree, seed)
    exact, found = slopes_in_digits(tree, *state), {"ours": ours(tree, state)}
    with suppress(ImportError):
        found["Pinocchio"] = pinocchios(tree, state)
    for name, each in found.items():
        off = errors(each, exact)
        print(name, tree.system.n, off)  # noqa: T201
        record_property(name, repr(off))
    require_exact(errors(found["ours"], exact))


LONG: dict[str, Callable[[], dyn.Mechanism]] = {
    "planar 60": lambda: dyn.planar_arm([0.2 + 0.05 * (i % 3) for i in range(60)], [0.3] * 60, damping=0.1),
    "arm 60": lambda: turned_arm(60),
    "arm 100": lambda: turned_arm(100),
    "free 100": lambda: floating("free", random_mechanism(99, ["revolute", "prismatic"], 2)),
    "mixed 100": lambda: random_mechanism(100, ["revolute", "prismatic", "ball"], 3),
}


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", LONG)
def test_slopes_of_a_hundred_bodies_are_exact(name: str) -> None:
    """By graphs and by the machine code of `linearize_many`; no warning, as of an engine that is not that of others."""
    tree = LONG[name]()
    q, qd, _, tau = state = random_state(tree, 0)
    exact, found = slopes_in_digits(tree, *state), ours(tree, state)
    off = errors(found, exact)
    print(name, off)  # noqa: T201
    require_exact(off)
    (A,), (B,) = dyn.linearize_many(tree, q[None], qd[None], tau)
    n = len(qd)
    again = errors(Slopes(found.torques, np.hstack([A[n:], B[n:]])), exact)
    print(name, again)  # noqa: T201
    require_exact(again)
    if tree.system.kinematics.quasi is None:  # elimination differentiated loses nothing to the condition of M
        assert max(again.accelerations) < LONG_CHAIN
