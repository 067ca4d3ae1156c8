"""Time to the first torque after a change of structure: `python tests/benchmarks/reconfiguration.py`.

An arm of 30 unlike hinges. Each change is made to the arm, and the torques at one state are computed: by the kernels
of `RecursiveInverseDynamics`; by a full rebuild, the graph of inverse dynamics, compiled, and called; and by MuJoCo,
the same edit of its MjSpec, compiled, and `mj_inverse`. Every change has numbers of its own, so that nothing made for
an earlier one is found again, but what an earlier run of a rebuild left in the cache of compiled code. Prints medians
and shortest times of this machine, and asserts nothing about them; that torques agree, and that to detach and to attach
again gives the same graph, it does assert.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import numpy as np

import cgraph as cg
import dynamics as dyn
from cgraph.core.structure_hash import structure_hash
from dynamics.multibody.spatial import rotation
from tests.dynamics.multibody.test_reconfiguration import arm

Array = np.ndarray[Any, np.dtype[np.float64]]
Torque = Callable[[Array], Array]  # of q, where qd = q / 2 and qdd = -q
MIDDLE = 0.5  # of the arm: which joint is locked


def tool(mass: float) -> dyn.Body:
    grip = dyn.Joint("fixed", position=(0.1, 0.0, -0.2))
    return dyn.Body("tool", grip, mass=mass, center=(0.0, 0.05, 0.0), inertia=(2e-3, 3e-3, 4e-3))


def by_kernels(mechanism: dyn.Mechanism) -> Torque:
    run = dyn.RecursiveInverseDynamics(mechanism)
    return lambda q: run(q, q / 2, -q)


def by_rebuild(mechanism: dyn.Mechanism) -> Torque:
    """As from a mechanism that shares nothing with another."""
    fresh = dyn.Mechanism(mechanism.bodies, mechanism.gravity, locked=mechanism.locked)
    function = cg.compile(dyn.inverse_dynamics(fresh))
    return lambda q: np.asarray(function(np.concatenate([q, q / 2, -q])))


class ByMujoco:
    """The arm as an MjSpec, with the same changes."""

    def __init__(self, mechanism: dyn.Mechanism, version: int) -> None:
        import mujoco

        self.mujoco: Any = mujoco
        self.spec = mujoco.MjSpec.from_string(dyn.to_mjcf(mechanism))
        self.spec.compile()
        self.last = mechanism.bodies[-1].name
        self.middle = mechanism.bodies[int(MIDDLE * len(mechanism.bodies))]
        self.version = version

    def detach(self) -> None:
        self.spec.delete(self.spec.body(self.last))

    def attach(self) -> None:
        body = tool(1.0 + 1e-3 * self.version)
        made = self.spec.body(self.last).add_body(name="tool", pos=body.joint.position)
        made.explicitinertial, made.mass, made.ipos, made.inertia = True, body.mass, body.center, body.inertia

    def lock(self) -> None:
        """The joint goes, and its body is turned to where it stands."""
        body = self.spec.body(self.middle.name)
        axis = np.asarray(self.middle.joint.axis) / np.linalg.norm(np.asarray(self.middle.joint.axis))
        body.alt.xyaxes = rotation(axis, 0.2 + 1e-3 * self.version)[:, :2].T.ravel()
        self.spec.delete(body.joints[0])

    def unlock(self) -> None:
        body = self.spec.body(self.middle.name)
        body.alt.xyaxes = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
        body.add_joint(type=self.mujoco.mjtJoint.mjJNT_HINGE, axis=self.middle.joint.axis, damping=0.1)

    def torque(self, q: Array) -> Array:
        model = self.spec.compile()
        data = self.mujoco.MjData(model)
        data.qpos, data.qvel, data.qacc = q, q / 2, -q
        self.mujoco.mj_inverse(model, data)
        return np.array(data.qfrc_inverse)


def changes(base: dyn.Mechanism, version: int) -> dict[str, tuple[Callable[[], dyn.Mechanism], int]]:
    """{name: (the change, coordinates after it)}, with numbers that no other version has."""
    n, last, middle = len(base.bodies), base.bodies[-1].name, base.bodies[int(MIDDLE * len(base.bodies))].name
    held = base.lock(middle, 0.2 + 1e-3 * version)
    return {
        "detach": (lambda: base.detach(last), n - 1),
        "attach": (lambda: base.attach(tool(1.0 + 1e-3 * version), last), n),
        "lock": (lambda: base.lock(middle, 0.2 + 1e-3 * version), n - 1),
        "unlock": (lambda: held.unlock(middle), n),
    }


def timed(work: Callable[[], Array]) -> tuple[float, Array]:
    start = time.perf_counter()
    found = work()
    return time.perf_counter() - start, found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--links", type=int, default=30, help="of the arm (default: 30)")
    parser.add_argument("--repeats", type=int, default=30, help="changes of each kind (default: 30; rebuilds: 3)")
    arguments = parser.parse_args()
    base = arm(arguments.links)
    by_kernels(base)(np.zeros(arguments.links))  # the kernels are there
    name = base.bodies[-1].name
    again = base.detach(name).attach(base.subtree(name))
    assert structure_hash(dyn.inverse_dynamics(again)) == structure_hash(dyn.inverse_dynamics(base))
    print(f"arm of {arguments.links} hinges; milliseconds to the first torque: median (shortest)")
    print(f"{'change':8} {'kernels':>18} {'full rebuild':>22} {'ratio':>8} {'MuJoCo':>18} {'ratio':>8}")
    for kind in changes(base, 0):
        times: dict[str, list[float]] = {"kernels": [], "rebuild": [], "mujoco": []}
        for version in range(arguments.repeats):
            change, n = changes(base, version)[kind]
            q = np.linspace(-0.5, 0.5, n)
            seconds, found = timed(lambda: by_kernels(change())(q))  # noqa: B023 (called in this turn of the loop)
            times["kernels"].append(seconds)
            if version < 3:
                seconds, expected = timed(lambda: by_rebuild(change())(q))  # noqa: B023
                times["rebuild"].append(seconds)
                assert np.abs(found - expected).max() <= 1e-10 * np.abs(expected).max()
            times["mujoco"] += mujoco_times(base, kind, version, q, found)
        row = {who: (1e3 * statistics.median(each), 1e3 * min(each)) if each else None for who, each in times.items()}
        print(f"{kind:8} {shown(row['kernels']):>18} {shown(row['rebuild']):>22} {ratio(row, 'rebuild'):>8} "
              f"{shown(row['mujoco']):>18} {ratio(row, 'mujoco'):>8}", flush=True)  # fmt: skip


def mujoco_times(base: dyn.Mechanism, kind: str, version: int, q: Array, expected: Array) -> list[float]:
    """Seconds of its edit, compilation and inverse dynamics; nothing where it is not installed."""
    try:
        twin = ByMujoco(base, version)
    except ImportError:
        return []
    if kind == "unlock":
        twin.lock()
        twin.torque(q[:-1])

    def work() -> Array:
        getattr(twin, kind)()
        return twin.torque(q)

    seconds, found = timed(work)
    assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max(), (kind, found, expected)
    return [seconds]


def shown(found: tuple[float, float] | None) -> str:
    return f"{found[0]:.2f} ({found[1]:.2f})" if found else "-"


def ratio(row: dict[str, tuple[float, float] | None], peer: str) -> str:
    """Ours to theirs, shortest times."""
    ours, theirs = row["kernels"], row[peer]
    return f"{ours[1] / theirs[1]:.2g}" if ours and theirs else "-"


if __name__ == "__main__":
    main()
