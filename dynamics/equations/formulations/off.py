"""How many torques of a formulation are off, and how many of their slopes."""

import re
from collections.abc import Mapping
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, extend
from cgraph._shared import counted


class Off(NamedTuple):
    """How many torques are off, and how many of their slopes d tau / d(q, qd), at a state at which something is.

    torques, slopes: of these many `of_torques`, n, and `of_slopes`, n (nq + n).

    >>> import dynamics as dyn
    >>> print(dyn.formulation_verdict(dyn.scenes.load("triple_pendulum"), "by_definition").off)
    Off are 3 of 3 torques and 15 of 18 slopes d tau/d(q, qd).
    """

    torques: int
    of_torques: int
    slopes: int
    of_slopes: int

    def __str__(self) -> str:
        slopes = f"{self.slopes} of {self.of_slopes} slopes d tau/d(q, qd)"
        return f"Off are {self.torques} of {counted(self.of_torques, 'torque')} and {slopes}."


def off_at(graph: Graph, terms: Graph | None, at: Mapping[str, float], torques: int) -> Off:
    """The count at a state.  graph: the torques.  terms: what each is off by.  torques: how many are off."""
    found = [re.fullmatch(r"(qd?\d+)(?:_old)?", name) for name in graph.input_names]
    state = [each[1] for each in found if each]  # coordinates and velocities, after the step
    of_torques = sum([name.startswith("tau") for name in graph.outputs])
    if terms is None or not torques:
        return Off(0, of_torques, 0, of_torques * len(state))
    slopes = cg.jacobian(terms, wrt=[name for name in state if name in terms.input_names])
    known = {name: at.get(name, 1.0) for name in slopes.input_names}  # of what no torque uses any number
    digits, values = extend.certain_digits(slopes, known), slopes.evaluate(known)
    wrong = [name for name, value in values.items() if value and digits[name] >= 1.0]
    return Off(torques, of_torques, len(wrong), of_torques * len(state))
