"""Quasi-velocities that do not fit their coordinates are told apart from those that do, in any unit."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pytest import mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph import Node

UNITS = (1e-9, 1.0, 1e9)  # of the lengths


def energy(q: Sequence[Node], u: Sequence[Node], t: Node) -> Node:
    return 0.5 * (u[0] ** 2 + u[1] ** 2 + u[2] ** 2)


def sledge(unit: float, sign: float = 1.0, **more: Any) -> dyn.QuasiVelocities:
    """Velocities along and across a body in a plane, and its turning: the structure has the sign 1."""

    def rate(q: Sequence[Node], u: Sequence[Node]) -> list[Node]:
        c, s = cg.cos(q[2]), cg.sin(q[2])
        return [unit * (c * u[0] - s * u[1]), unit * (s * u[0] + c * u[1]), u[2]]

    def structure(u: Sequence[Node], p: Sequence[Node]) -> list[Node]:
        return [-sign * u[2] * p[1], sign * u[2] * p[0], sign * (u[0] * p[1] - u[1] * p[0])]

    return dyn.QuasiVelocities("along across turning", rate, structure, **more)


@mark.parametrize("unit", UNITS)
def test_a_structure_that_belongs_to_its_rate_gives_the_motion_in_the_coordinates(unit: float) -> None:
    """Of a body whose kinetic energy is that of its center: free, it moves straight on."""
    body = dyn.System(energy, "x y angle", quasi_velocities=sledge(unit))
    run = dyn.simulate(body, [0.0, 0.0, 0.3], [1.0, 0.5, 2.0], 1.0, t_eval=[0.0, 0.5, 1.0])
    first, second = np.diff(run.q, axis=0)
    assert np.abs(second - first).max() <= 1e-7 * np.abs(first[:2]).max() + 1e-7


@mark.parametrize("unit", UNITS)
def test_one_that_does_not_and_velocities_that_move_the_coordinates_alike_are_refused_in_any_unit(unit: float) -> None:
    for sign in (-1.0, 0.0, 1.0 + 1e-6):
        with raises(ValueError, match="structure does not belong to rate"):
            dyn.System(energy, "x y angle", quasi_velocities=sledge(unit, sign))
    alike = dyn.QuasiVelocities("a b", lambda q, u: [unit * (u[0] + u[1]), unit * (2.0 * u[0] + 2.0 * u[1])])
    with raises(ValueError, match="two of them move the coordinates alike"):
        dyn.System(lambda q, u, t: 0.5 * (u[0] ** 2 + u[1] ** 2), "x y", quasi_velocities=alike)


def test_other_rates_that_cannot_be_are_refused() -> None:
    def system(rate: Any, **more: Any) -> dyn.System:
        kind = dyn.QuasiVelocities("v", rate, **more)
        return dyn.System(lambda q, u, t: 0.5 * u[0] ** 2, "x", quasi_velocities=kind)

    with raises(ValueError, match="rate must be linear in the velocities"):
        system(lambda q, u: [u[0] ** 2])
    with raises(ValueError, match="rate is not finite about the neutral coordinates"):
        system(lambda q, u: [u[0] * cg.sqrt(q[0] - 5.0)])
    system(lambda q, u: [u[0] * cg.sqrt(q[0] - 5.0)], neutral=[7.0])
    with raises(ValueError, match="rate must give 1 values, got 2"):
        system(lambda q, u: [u[0], u[0]])
