"""StateForm: what the steps of a run are of, q and qd or q and p, and the way there and back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph.extend import Array, require_choice

from ..integrators import Problem, momentum_form
from .row_values import row_values
from .state_sizes import OTHERS

FORMS = ("velocity", "momentum")
LOOSE = 1e-6  # of a momentum, or so much of the largest: what an iteration may leave of it
NEEDS = ("events", "dense_output=True", "a SampledController")  # in the order of `needs`


class StateForm:
    """The states of the steps of a problem, whose rows are states (q, qd).

    problem: that the steps are of.
    needs: whether the run has what only states (q, qd) can have, see `NEEDS`.
    warnings: what speaks against the rows, a sentence each.
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
        self.warnings: list[str] = []

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
        velocities, missing = np.split(row_values(self._form.velocities, times, states), [momenta.shape[1]], axis=1)
        if missing.size:
            self._judge(times, momenta, missing)
        return times, np.concatenate([q, velocities], axis=1), momenta

    def _judge(self, times: Array, momenta: Array, missing: Array) -> None:
        """Warn where the velocities that were iterated do not have the momenta. Both of the shape (T, n)."""
        sizes = np.abs(momenta).max(axis=0, initial=0.0)
        allowed = np.maximum(sizes, OTHERS * sizes.max(initial=0.0))
        bad = np.argwhere(~(np.abs(missing) <= LOOSE * allowed))
        if len(bad):
            row, k = bad[0].tolist()
            name = self.problem.components[self.problem.nq + k]
            self.warnings.append(
                f"at t = {times[row]:.6g} s the velocities do not have the momenta: the iteration for them leaves "
                f"{missing[row, k]:.2g} of {momenta[row, k]:.2g}, {name}; take form='velocity'"
            )
