"""Mechanisms whose numbers are replaced by parameters: names, variables, and formulas of them."""

from dataclasses import replace
from typing import Any

import numpy as np

import cgraph as cg
import dynamics as dyn
from dynamics.multibody.bodies.body import BODY_QUANTITIES, JOINT_QUANTITIES


class Replaced:
    def __init__(self, seed: int, share: float) -> None:
        self.rng, self.share = np.random.default_rng(seed), share
        self.values: dict[str, float] = {}

    def number(self, x: float) -> Any:
        """The number, its name, its variable, or a formula that gives it again."""
        if self.rng.uniform() > self.share:
            return x
        name = f"p{len(self.values)}"
        form = self.rng.integers(3)
        self.values[name] = x if form < 2 else 0.5 * (x + 1.0)
        return name if form == 0 else cg.variable(name) if form == 1 else 2.0 * cg.variable(name) - 1.0

    def quantity(self, given: Any) -> Any:
        """The same of a number, a vector, or a symmetric matrix."""
        array = np.asarray(given, dtype=np.float64)
        if array.ndim == 0:
            return self.number(float(array))
        if array.ndim == 1:
            return [self.number(x) for x in array.tolist()]
        lower = [[self.number(x) for x in row[: i + 1]] for i, row in enumerate(array.tolist())]
        return [[lower[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)]


def parametrized(mechanism: dyn.Mechanism, seed: int, share: float = 0.5) -> dyn.Mechanism:
    """The mechanism with that share of its numbers as parameters, at the numbers' values."""
    put = Replaced(seed, share)
    bodies = []
    for body in mechanism.bodies:
        has = {name: value for name in JOINT_QUANTITIES if np.any(np.asarray(value := getattr(body.joint, name)) != 0)}
        joint = replace(body.joint, **{name: put.quantity(value) for name, value in has.items()})
        own = {name: put.quantity(getattr(body, name)) for name in BODY_QUANTITIES}
        bodies.append(replace(body, joint=joint, **own))
    gravity = put.quantity(mechanism.gravity)
    return dyn.Mechanism(bodies, gravity, parameters=put.values, base_parameters=mechanism.base_parameters)
