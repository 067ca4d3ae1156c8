"""StateForm: what the steps of a run are of, q and qd or q and p, and the way there and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph.extend import Array, require_choice

from ..equations.hamiltonian import FORMS
from ..integrators import Problem, momentum_form
from .row_values import row_values

NEEDS = ("events", "dense_output=True", "a SampledController")  # in the order of `needs`


class StateForm:
    """The states of the steps of a problem, whose rows are states (q, qd).

    problem: that the steps are of.
    needs: whether the run has what only states (q, qd) can have, see `NEEDS`.
    """

    def __init__(self, problem: Problem, form: str, needs: Sequence[bool]) -> None:
        momenta = require_choice("form", form, FORMS) == "momentum"
        if momenta and any(needs):
            what = NEEDS[list(needs).index(True)]
            raise ValueError(f'form="momentum" has rows alone, without {what}: take form="velocity"')
        if momenta and problem.system is None:
            raise ValueError('form="momentum" needs a Lagrangian, which a system of first order does not have')
        self._form = momentum_form(problem) if momenta else None
        self.problem = self._form.problem if self._form else problem

    def start(self, x: Array, t: float) -> Array:
        """A state (q, qd) as one of the steps."""
        if self._form is None:
            return x
        momenta = row_values(self._form.momenta, np.array([t]), x[np.newaxis])[0]
        return np.concatenate([x[: self.problem.nq], momenta])

    def rows(self, times: Array, states: Array) -> tuple[Array, Array, Array | None]:
        """Times and states of the steps as times, states (q, qd), and momenta, None where the steps have none."""
        if self._form is None:
            return times, states, None
        q, momenta = states[:, : self.problem.nq], states[:, self.problem.nq :]
        velocities = row_values(self._form.velocities, times, states)
        return times, np.concatenate([q, velocities], axis=1), momenta
