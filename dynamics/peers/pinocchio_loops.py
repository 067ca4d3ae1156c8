"""Pinocchio's constraintDynamics on the loops of a mechanism."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array

from ..multibody.body import WORLD
from ..multibody.loops import Loop
from ..multibody.mechanism import Mechanism
from .peer import PeerModel, UnavailableError
from .pinocchio import PinocchioPeer

if TYPE_CHECKING:
    from pinocchio import SE3

_KINDS = {"point": "CONTACT_3D", "weld": "CONTACT_6D"}
_PROXIMAL = 1e-14, 1e-8, 200  # what is left of the constraints, its regularization, and iterations


def constrained_accelerations(mechanism: Mechanism, q: Array, qd: Array, tau: Array) -> Array:
    """qdd, (N, n), at states that meet the loops, without Baumgarte's stabilization.

    Raises ImportError without Pinocchio, and UnavailableError for what it has not.
    """
    ready, rows = constraint_dynamics(mechanism, _PROXIMAL), []
    for x in np.concatenate([q, qd, tau], axis=1):
        run, result = ready(x)
        run()
        rows.append(result())
    return np.array(rows)


def constraint_dynamics(
    mechanism: Mechanism, proximal: tuple[float, float, int]
) -> Callable[[Array], tuple[Callable[[], object], Callable[[], Array]]]:
    """At x = (q, qd, tau): a call, and what reads the accelerations, (n,), that it left.

    proximal: what is left of the constraints, its regularization, and iterations. Raises as above.
    """
    for loop in mechanism.loops:
        if loop.kind not in _KINDS:
            raise UnavailableError(f"has no loop of the kind {loop.kind!r}")
    peer = PinocchioPeer(PeerModel("held", mechanism))
    pin, twin, data = peer.pinocchio, peer.twin, peer.data
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for loop in mechanism.loops:
        ends = [*_frame(peer, mechanism, loop.body, loop.at), *_frame(peer, mechanism, loop.to, loop.to_at, loop)]
        models.append(pin.RigidConstraintModel(getattr(pin.ContactType, _KINDS[loop.kind]), twin, *ends, pin.LOCAL))
        datas.append(models[-1].createData())
    pin.initConstraintDynamics(twin, data, models, datas)
    settings, solve = pin.ProximalSettings(*proximal), pin.constraintDynamics

    def ready(x: Array) -> tuple[Callable[[], object], Callable[[], Array]]:
        theirs = peer.arguments(x, "forward")
        return (
            lambda: solve(twin, data, *theirs, models, datas, settings),
            lambda: peer.of.our_a(*theirs[:2], np.array(data.ddq)),
        )

    return ready


def _frame(
    peer: PinocchioPeer, mechanism: Mechanism, body: str, at: ArrayLike, loop: Loop | None = None
) -> tuple[int, SE3]:
    """Pinocchio's joint of a body, and the frame of a loop there.  loop: whose orientation the frame has."""
    carrier = mechanism.carriers[body]
    names = {each.name: each.coordinate for each in mechanism.moving}
    joint = 0 if carrier.name == WORLD else peer.twin.getJointId(names[carrier.name])
    turn = np.eye(3) if loop is None else np.asarray(loop.orientation, dtype=np.float64)
    place = carrier.position + carrier.orientation @ np.asarray(at, dtype=np.float64)
    return joint, peer.pinocchio.SE3(carrier.orientation @ turn, place)
