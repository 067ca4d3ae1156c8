"""PyTorch eager: inverse dynamics by torch.autograd."""

from __future__ import annotations

import numpy as np

from ..experiments.paper_numbers.torch_eager import eager_evaluations
from .case import Case
from .contender import Contender, Peer, UnavailableError


class TorchPeer(Peer):
    """PyTorch, an operation at a time, as Table 1 has it."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self.evaluate = eager_evaluations(case.system, ["chain_rule"])["chain_rule"]

    def prepare(self, task: str, mode: str) -> Contender:
        """See Peer."""
        if self.case.system.parameters or any(force.value != 0.0 for force in self.case.system.forces):
            raise UnavailableError("is measured on systems without parameters and applied forces")
        x = self.case.point(task)
        return Contender(lambda: self.evaluate(x), lambda taus: np.array([float(tau.detach()) for tau in taus]))
