"""Torque by link and by motion: what the parts are, that they add up, and how tables are written."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

import dynamics as dyn
from dynamics import torque_by_joint_motion, torque_by_link
from dynamics.equations.states.evaluate import evaluate
from dynamics.equations.torque_parts.torque_table import TorqueTable
from dynamics.multibody.builders import planar_links
from tests.dynamics.mechanisms import FAMILIES, PLAIN, turned_tree
from tests.dynamics.models import MODELS, at, random_arm, states
from tests.slow import slow

ROUNDING = 1e-12  # of the largest torque
NOTHING = 1e-13  # kg and kg m^2: what is left of a link that is taken away, for no link may weigh nothing
LOST = 1e-10  # N m: the weight of NOTHING, and the rounding of torques of some 100 N m
TABLES = {each.__name__: each for each in (torque_by_link, torque_by_joint_motion)}
QUADRATIC = {name: make for name, make in MODELS.items() if name != "relativistic"}
EVERY = QUADRATIC | {name: lambda make=make: make(5) for name, make in FAMILIES.items()}


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("name", [*[name for name in EVERY if name not in PLAIN], *slow(*PLAIN)])
def test_the_cells_add_up_to_inverse_dynamics(name: str, table: str) -> None:
    model = EVERY[name]()
    state = at(states(model, 1), 0)
    found = TABLES[table](model).at(state["q"], state["qd"], state["qdd"], t=0.4)
    tau = evaluate(model, dyn.inverse_dynamics(model), state, 0.4)
    assert found.total == approx(tau, abs=ROUNDING * abs(tau).max())


def lighter(arm: dyn.Mechanism, without: int) -> dyn.Mechanism:
    """The arm with next to nothing left of one link but its length."""
    bodies = list(arm.bodies)
    bodies[without] = replace(bodies[without], mass=NOTHING, inertia=(NOTHING, NOTHING, 0.0))
    return dyn.Mechanism(bodies, arm.gravity)


@pytest.mark.parametrize("k", range(3))
def test_a_link_s_row_is_what_is_lost_without_the_link(k: int) -> None:
    arm = random_arm(3)
    state = at(states(arm, 1), 0)
    whole, less = (evaluate(arm.system, dyn.inverse_dynamics(each), state) for each in (arm, lighter(arm, k)))
    row = torque_by_link(arm).at(state["q"], state["qd"], state["qdd"]).values[k]
    assert row == approx(whole - less, abs=LOST)


def test_a_joint_feels_no_link_that_it_does_not_carry() -> None:
    """In a binary tree of 7, joint i carries link k if i is k or one of its ancestors."""

    def path(k: int) -> set[int]:
        return {k} | (path((k - 1) // 2) if k else set())

    carried = np.array([[i in path(k) for i in range(7)] for k in range(7)])
    table = torque_by_link(turned_tree(7))
    assert (table.zeros[:7] == ~carried).all()
    both = torque_by_joint_motion(turned_tree(7)).zeros[:, :7]
    assert (both == ~(carried.T @ carried)).all()  # joints move each other where one link hangs on both


def test_half_of_a_coriolis_force_belongs_to_each_of_its_velocities() -> None:
    """Two links: tau_0 has 2 h qd0 qd1 + h qd1^2, of which joint 1 has h qd0 qd1 + h qd1^2; tau_1 has -h qd0^2."""
    arm = random_arm(2, damped=False)
    q, qd = np.array([0.3, 0.7]), np.array([1.1, -0.6])
    one, two = planar_links(arm)
    h = -two.mass * one.length * two.center * np.sin(q[1])
    expected = h * np.array([[qd[0] * qd[1], qd[0] * qd[1] + qd[1] ** 2], [-(qd[0] ** 2), 0.0]])
    assert torque_by_joint_motion(arm).at(q, qd).values[:, :2] == approx(expected)


def test_motion_of_one_joint_alone_fills_its_column_alone() -> None:
    arm = random_arm(3, damped=False)
    values = torque_by_joint_motion(arm).at(np.array([0.1, 0.5, -0.3]), qdd=np.array([0.0, 2.0, 0.0])).values
    assert (values[:, [0, 2]] == 0.0).all()
    mass = evaluate(arm.system, dyn.mass_matrix(arm), {"q": [0.1, 0.5, -0.3]}).reshape(3, 3)
    assert values[:, 1] == approx(2.0 * mass[:, 1])


def pendulum() -> TorqueTable:
    return torque_by_link(dyn.planar_arm([3.0], [2.0], damping=0.5))


def test_a_table_without_a_state_shows_expressions() -> None:
    assert pendulum().to_text() == (
        "                                             joint 1\n"
        "link 1   4 * qdd.joint 1 - (-29.43 * sin(q.joint 1))\n"
        "damping                             0.5 * qd.joint 1\n"
    )
    with pytest.raises(ValueError, match="has no state"):
        assert pendulum().total is None


def small() -> TorqueTable:
    return torque_by_link(dyn.planar_arm([3.0, 1.0], [2.0, 1.0])).at([0.0, 0.0], qdd=[1.0, 1e-9])


def test_tables_as_text_markdown_and_latex() -> None:
    assert small().to_text() == (
        "        joint 1  joint 2\nlink 1        4        ·\nlink 2    6.333    1.333\ntau       10.33    1.333\n"
    )
    assert small().to_markdown(3) == (
        "|  | joint 1 | joint 2 |\n| --- | ---: | ---: |\n| link 1 | 4 | · |\n| link 2 | 6.33 | 1.33 |\n"
        "| tau | 10.3 | 1.33 |\n"
    )
    assert small().to_latex(3).splitlines()[2:6] == [
        r" & joint 1 & joint 2 \\",
        r"\hline",
        r"link 1 & $4$ & $\cdot$ \\",
        r"link 2 & $6.33$ & $1.33$ \\",
    ]


def test_names_are_escaped_and_small_numbers_have_powers_in_latex() -> None:
    system = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["a_b|c"])
    table = torque_by_link(system).at([0.0], qdd=[1e-9])
    assert r"a\_b|c" in table.to_latex()
    assert r"$1 \cdot 10^{-9}$" in table.to_latex()
    assert r"a_b\|c" in table.to_markdown()


def test_a_state_of_another_shape_and_unknown_parameters_are_refused() -> None:
    table = torque_by_link(random_arm(2))
    for wrong in (np.zeros(3), np.zeros((2, 2)), 0.0):
        with pytest.raises(ValueError, match="shape"):
            table.at(wrong)
    with pytest.raises(ValueError, match="no parameter k"):
        table.at([0.0, 0.0], parameters={"k": 1.0})
