"""MuJoCo twins asked at single states for the quantities that the graphs give."""

import numpy as np

from cgraph._shared import Array
from dynamics.io.mujoco_twin import MujocoTwin


class AskedTwin(MujocoTwin):
    """MuJoCo's model of a mechanism, asked. Damping is not in `bias`; accelerations of loops are refused."""

    def _set(self, q: Array, qd: Array) -> None:
        self.data.qpos[:], self.data.qvel[:] = q, qd
        self.data.qfrc_applied[:] = 0.0

    def accelerations(self, q: Array, qd: Array, tau: Array) -> Array:
        """qdd, (n,), by `mj_forward` under applied torque tau, (n,). Raises MechanismError for loops."""
        self.require_tree("accelerations")
        self._set(q, qd)
        self.data.qfrc_applied[:] = tau
        self.mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.qacc)

    def inverse(self, q: Array, qd: Array, qdd: Array) -> Array:
        """tau, (n,), by `mj_inverse`; damping included."""
        self._set(q, qd)
        self.data.qacc[:] = qdd
        self.mujoco.mj_inverse(self.model, self.data)
        return np.array(self.data.qfrc_inverse)

    def mass_matrix(self, q: Array) -> Array:
        """M(q), (n, n)."""
        self._set(q, np.zeros(self.model.nv))
        self.mujoco.mj_forward(self.model, self.data)
        columns = np.empty((self.model.nv, self.model.nv))
        for column, unit in zip(columns, np.eye(self.model.nv), strict=True):  # mj_fullM differs between versions
            self.mujoco.mj_mulM(self.model, self.data, column, unit)
        return columns

    def bias(self, q: Array, qd: Array) -> Array:
        """Coriolis, centrifugal and gravity force and that of springs, (n,)."""
        self._set(q, qd)
        self.mujoco.mj_forward(self.model, self.data)
        springs = self.data.qfrc_passive + self.model.dof_damping * qd
        return np.array(self.data.qfrc_bias - springs)
