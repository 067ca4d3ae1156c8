"""Peers: the same forward dynamics by other software, where it is installed."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cgraph import Node
from cgraph.order import topological

from ..mechanism import Mechanism
from ..mjcf import to_mjcf
from ..mujoco_io import MujocoTwin
from ..planar_arm import PlanarArm
from ..system import System

Array = np.ndarray[Any, np.dtype[np.float64]]
Model = PlanarArm | Mechanism
# forward(x) -> qdd (n,), for x = (q, qd, tau) (3n,) in the system's order of coordinates
Forward = Callable[[Array], Array]


def joint_names(model: Model) -> list[str]:
    """Names of the joints in MJCF, in the order of the coordinates."""
    if isinstance(model, Mechanism):
        return [body.name for body in model.moving]
    return [f"joint{i + 1}" for i in range(len(model.links))]


def mujoco_forward(model: Model) -> Forward:
    """`mj_forward` on the twin, from Python. Raises ImportError without MuJoCo."""
    twin = MujocoTwin(model)
    order = np.array([twin.model.joint(name).id for name in joint_names(model)])
    n = len(order)
    at, data, compute = np.argsort(order), twin.data, twin.mujoco.mj_forward

    def forward(x: Array) -> Array:
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = x[at], x[n + at], x[2 * n + at]
        compute(twin.model, data)
        return np.array(data.qacc[order])

    return forward


def pinocchio_forward(model: Model, system: System) -> Forward:
    """Pinocchio's `aba`, C++ called from Python; damping is taken off the torque. Raises ImportError without it."""
    import pinocchio

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.xml"
        path.write_text(to_mjcf(model))
        twin = pinocchio.buildModelFromMJCF(str(path))
    twin.damping[:] = 0.0  # whether aba applies them depends on the version
    data = twin.createData()
    order = np.array([twin.joints[twin.getJointId(name)].idx_v for name in joint_names(model)])
    n, at, damping = len(order), np.argsort(order), np.array(system.damping)

    def forward(x: Array) -> Array:
        tau: Array = (x[2 * n :] - damping * x[n : 2 * n])[at]
        qdd: Array = pinocchio.aba(twin, data, x[at], x[n + at], tau)[order]
        return qdd

    return forward


def casadi_forward(system: System) -> Forward:
    """CasADi on the same Lagrangian: its own derivatives, a linear solve with M, run by its virtual machine.

    Raises ImportError without CasADi.
    """
    import casadi

    q, qd, tau = (casadi.SX.sym(name, system.n) for name in ("q", "qd", "tau"))
    env: dict[Node, Any] = {}
    for i in range(system.n):
        env[system.q[i]], env[system.qd[i]] = q[i], qd[i]
    for node in topological([system.lagrangian]):
        if node not in env:
            args = [env[arg] for arg in node.args]
            env[node] = casadi.SX(node.value) if node.value is not None else _CASADI[node.op.name](casadi, *args)
    lagrangian = env[system.lagrangian]
    p = casadi.gradient(lagrangian, qd)
    bias = casadi.jtimes(p, q, qd) - casadi.gradient(lagrangian, q)
    rhs = tau - bias - casadi.DM(list(system.damping)) * qd
    qdd = casadi.solve(casadi.jacobian(p, qd), rhs)
    function = casadi.Function("forward", [casadi.vertcat(q, qd, tau)], [qdd])
    buffer, evaluate = function.buffer()
    result = np.empty(system.n)
    buffer.set_res(0, result.data)

    def forward(x: Array) -> Array:
        buffer.set_arg(0, x.data)
        evaluate()
        return result.copy()

    return forward


_CASADI: dict[str, Callable[..., Any]] = {
    "add": lambda _, a, b: a + b,
    "sub": lambda _, a, b: a - b,
    "mul": lambda _, a, b: a * b,
    "div": lambda _, a, b: a / b,
    "neg": lambda _, a: -a,
    "sin": lambda casadi, a: casadi.sin(a),
    "cos": lambda casadi, a: casadi.cos(a),
}


def peers(model: Model, system: System) -> dict[str, Forward]:
    """The peers that are installed, {name: forward dynamics}."""
    makers: dict[str, Callable[[], Forward]] = {
        "MuJoCo": lambda: mujoco_forward(model),
        "Pinocchio": lambda: pinocchio_forward(model, system),
        "CasADi": lambda: casadi_forward(system),
    }
    found = {}
    for name, make in makers.items():
        try:
            found[name] = make()
        except ImportError:
            continue
    return found
