"""PyTorch eager, as Table 1 of the paper has it."""

from __future__ import annotations

import numpy as np

from viz.paper.eager import eager_evaluations

from .peer import Peer, PeerModel, TimedTask, UnavailableError
from .translate import require_rates


class TorchPeer(Peer):
    """PyTorch, an operation at a time, as Table 1 has it."""

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        require_rates(case)
        self.evaluate = eager_evaluations(case.system, ["chain_rule"])["chain_rule"]

    def prepare(self, task: str, mode: str) -> TimedTask:
        if self.case.system.parameters or any(force.value != 0.0 for force in self.case.system.forces):
            raise UnavailableError("is measured on systems without parameters and applied forces")
        x = self.case.point(task)
        return TimedTask(lambda: self.evaluate(x), lambda taus: np.array([float(tau.detach()) for tau in taus]))
