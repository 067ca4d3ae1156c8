"""Machines as people draw them, along the axes: in other axes, units and orders, and in few digits, they move alike."""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from dynamics.equations.constraints.constraint_rank import independent_rows
from dynamics.equations.constraints.row_numbers import row_numbers
from dynamics.multibody.algebra.spatial import from_quaternion
from tests.slow import slow

from ..linkages import four_bar, peaucellier, windows
from ..models import Array
from ..tilted_linkages import turned

INERTIA, PULL = (1e-3, 1.1e-3, 1.2e-3), (1.0, 2.0, -9.0)
X, Y, Z = np.eye(3)


def body(name: str, kind: str, parent: str, place: Any, end: Any, axis: Any = Z) -> dyn.Body:
    """Of 1 kg, from a joint to an end."""
    return dyn.Body(name, dyn.Joint(kind, axis, place), parent, 1.0, 0.5 * np.asarray(end), INERTIA)


def rod(along: Array, sense: float = 1.0) -> dyn.Mechanism:
    """A crank and a slide with a ball-jointed rod along an axis of its own frame, from either end."""
    across, axis = np.roll(along, 1), np.roll(along, 2)
    bodies = [body("crank", "revolute", "world", (0, 0, 0), 0.2 * across, axis)]
    bodies.append(body("rod", "ball", "crank", 0.2 * across, 0.5 * sense * along))
    bodies.append(body("slide", "prismatic", "world", 0.2 * across + 0.5 * sense * along, (0, 0, 0), along))
    return dyn.Mechanism(bodies, PULL, loops=[dyn.Loop("point", "rod", "slide", 0.5 * sense * along)])


def legs(count: int) -> dyn.Mechanism:
    """A table on upright legs, of ball joints and slides; of three, on rods and hinges."""
    places = [np.array([np.cos(a), np.sin(a), 0.0]) for a in 2.0 * np.pi * np.arange(count) / count]
    bodies = [body("table", "free", "world", 0.5 * Z, (0, 0, 0))]
    for k, place in enumerate(places):
        bodies.append(
            body(f"low {k}", "ball" if count > 3 else "revolute", "world", 0.3 * place, 0.3 * Z, np.cross(Z, place))
        )
        bodies.append(body(f"high {k}", "prismatic" if count > 3 else "ball", f"low {k}", 0.3 * Z, 0.2 * Z))
    loops = [dyn.Loop("point", f"high {k}", "table", 0.2 * Z, 0.3 * place) for k, place in enumerate(places)]
    return dyn.Mechanism(bodies, PULL, loops=loops)


def ankle() -> dyn.Mechanism:
    """A leg whose heel is moved by a ball-jointed rod from the thigh."""
    bodies = [body("thigh", "revolute", "world", (0, 0, 0), -0.4 * Z, Y)]
    bodies += [
        body("shin", "revolute", "thigh", -0.4 * Z, -0.4 * Z, Y),
        body("heel", "revolute", "shin", -0.4 * Z, 0.1 * X, Y),
    ]
    bodies.append(body("rod", "ball", "thigh", (-0.1, 0, -0.05), -0.75 * Z))
    return dyn.Mechanism(bodies, PULL, loops=[dyn.Loop("point", "rod", "heel", -0.75 * Z, -0.1 * X)])


MACHINES: dict[str, Callable[[], dyn.Mechanism]] = {
    **{
        f"rod {name} {sense:+.0f}": partial(rod, axis, sense)
        for name, axis in zip("xyz", np.eye(3), strict=True)
        for sense in (1, -1)
    },
    "ankle": ankle,
    "three legs": partial(legs, 3),
    "six legs": partial(legs, 6),
}
TURN = from_quaternion(np.random.default_rng(5).normal(size=4))


def rounded(machine: dyn.Mechanism, digits: int) -> dyn.Mechanism:
    """As a file with so many decimals has it."""

    def text(given: Any) -> Array:
        return np.round(np.asarray(given, dtype=np.float64), digits)

    joints = [
        replace(each.joint, axis=text(each.joint.axis), position=text(each.joint.position)) for each in machine.bodies
    ]
    bodies = [replace(each, joint=joint) for each, joint in zip(machine.bodies, joints, strict=True)]
    loops = [
        replace(each, **{name: text(getattr(each, name)) for name in ("at", "to_at", "axis", "to_axis")})
        for each in machine.loops
    ]
    return replace(machine, bodies=bodies, loops=loops)


def accelerations(machine: dyn.Mechanism, length: float) -> dict[str, float]:
    """Of joints of one coordinate, at rest as drawn, those of slides in units of length."""
    q = np.array(machine.system.kinematics.neutral)
    qdd = dyn.arrays_at(machine, dyn.forward_dynamics(machine), q, np.zeros(machine.system.n))["qdd"]
    units = {each.name: length if each.joint.kind == "prismatic" else 1.0 for each in machine.moving}
    return {name: qdd[k] / units[name] for k, name in enumerate(machine.velocities) if name in units}


@pytest.mark.parametrize("name", ["rod x +1", "rod z -1", "ankle", "three legs", *slow(*[*MACHINES][1:5], "six legs")])
def test_axes_units_and_orders_do_not_change_how_a_drawn_machine_moves(name: str) -> None:
    machine = MACHINES[name]()
    expected, rank = accelerations(machine, 1.0), len(independent_rows(machine.system.constraints))
    assert rank == len(machine.system.constraints)
    others = [
        (turned(machine, TURN, 1.0, 1.0), 1.0),
        (replace(machine, bodies=machine.bodies[::-1], loops=machine.loops[::-1]), 1.0),
    ]
    for other, length in [*others, *[(turned(machine, np.eye(3), size, 1.0), size) for size in (1e-3, 1e3, 1e6)]]:
        assert len(independent_rows(other.system.constraints)) == rank
        assert accelerations(other, length) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.filterwarnings("ignore::dynamics.ConstraintWarning")
@pytest.mark.parametrize("machine", [four_bar, partial(four_bar, "hinge"), peaucellier])
def test_planar_loops_in_oblique_axes_of_7_digits_close_to_7_digits(machine: Callable[[], dyn.Mechanism]) -> None:
    flat = machine()
    tilted = rounded(turned(flat, TURN, 1.0, 1.0), 7)
    assert len(independent_rows(tilted.system.constraints)) == len(independent_rows(flat.system.constraints))
    point = next(row_numbers(tilted.system.constraints).states())
    whole = row_numbers(tilted.system.constraints.whole or tilted.system.constraints)
    assert np.abs(whole.gaps(point)).max() < 1e-6


@pytest.mark.parametrize("count", [10, *slow(20, 40)])
def test_rows_that_open_are_kept_in_a_row_of_windows(count: int) -> None:
    """As drawn they lie flat, where half of the rows say nothing; of 40, two are doubted, and kept."""
    model, q, qd = windows(count)
    with warnings.catch_warnings(record=True, action="always", category=dyn.ConstraintWarning) as noted:
        run = dyn.simulate(model, -np.array(q), qd, 1.0)
    assert [each for each in noted if "left out" in str(each.message)] == []
    numbers = row_numbers(model.system.constraints)
    assert run.success
    assert max(np.abs(numbers.gaps(numbers.point(row, {"t": 0.0}))).max() for row in run.q) < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_a_joint_that_a_loop_locks_beside_one_that_moves_starts(seed: int) -> None:
    """A ball joint with a weld across it: what is left of its rates is small beside the rates of the others."""
    rng = np.random.default_rng(seed)
    base, held = (
        body("base", "revolute", "world", rng.normal(size=3), X),
        body("held", "ball", "base", rng.normal(size=3), Y),
    )
    model = dyn.Mechanism([base, held], loops=[dyn.Loop("weld", "held", "base", to_at=held.joint.position)])
    q, qd = np.array([0.3, 1.0, 0.0, 0.0, 0.0]), rng.normal(size=4)
    with warnings.catch_warnings(action="ignore", category=dyn.ConstraintWarning):
        for _ in range(3):
            q, qd = dyn.consistent_state(model, q, qd)
    assert np.abs(qd[1:]).max() < 1e-15 * abs(qd[0])
