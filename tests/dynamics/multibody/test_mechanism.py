"""Mechanisms: against MuJoCo, their counts, their tags, and what cannot be one."""

import re
import sys
from collections.abc import Callable
from dataclasses import replace
from types import FrameType
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics import Body, Joint, Mechanism, MechanismError
from dynamics.multibody.algebra.spatial import from_quaternion, rotation, to_quaternion
from tests.dynamics.mechanisms import FAMILIES, random_body, turned_arm, turned_tree
from tests.dynamics.models import error, run, states
from tests.each_row import each_row
from tests.tolerances import EQUATIONS, LAST_BITS, SOLVED


def nodes(model: Any, of: str = "forward") -> int:
    return len((dyn.forward_dynamics(model, "recursive") if of == "forward" else dyn.inverse_dynamics(model)).nodes)


def point(name: str, parent: str = "world", **given: Any) -> Body:
    """A body of 1 kg, 0.5 m out along x from a joint about y, 0.5 m from the joint before."""
    joint = given.pop("joint", Joint("revolute", (0.0, 1.0, 0.0), (0.5, 0.0, 0.0)))
    return Body(name, joint, parent, **({"mass": 1.0, "center": (0.5, 0.0, 0.0)} | given))


def test_the_order_of_the_bodies_only_orders_the_coordinates() -> None:
    mechanism = FAMILIES["branched"](6)
    turned_round = Mechanism(mechanism.bodies[::-1], mechanism.gravity)
    names = [body.name for body in mechanism.moving]
    order = [names.index(name) for name in turned_round.system.coordinates]
    given = states(mechanism, 3)
    shuffled = {name: value[:, order] for name, value in given.items() if isinstance(value, np.ndarray)}
    ours = run(dyn.forward_dynamics(mechanism), given)
    assert run(dyn.forward_dynamics(turned_round), shuffled) == approx(ours[:, order], rel=SOLVED)


SIZES = [
    (turned_arm(7), "forward", 1639),
    (turned_arm(30), "forward", 9196),
    (turned_arm(30), "inverse", 3901),
    (dyn.planar_arm([0.9] * 20, [0.7] * 20), "forward", 1703),
]


@each_row("model, of, count", SIZES)
def test_graphs_of_arms_have_as_many_nodes_as_they_had(model: Any, of: str, count: int) -> None:
    assert nodes(model, of) == count


def test_a_tree_costs_a_body_what_a_chain_costs() -> None:
    assert nodes(turned_tree(15)) <= 1.3 * nodes(turned_arm(15))


def test_a_weld_leaves_no_nodes() -> None:
    rng = np.random.default_rng(5)
    first, last = (random_body(name, "revolute", on, rng) for name, on in (("a", "world"), ("b", "tool")))
    welded = Mechanism([first, random_body("tool", "fixed", "a", rng), last])
    alone = Mechanism([first, replace(last, parent="a")])  # with other numbers
    assert welded.system.coordinates == alone.system.coordinates
    assert [nodes(welded, of) for of in ("forward", "inverse")] == [nodes(alone, of) for of in ("forward", "inverse")]


def test_a_weld_s_inertia_counts_without_mass() -> None:
    """As of a flywheel whose mass is counted elsewhere; its carrier may have none either."""
    shaft, wheel = Body("shaft", Joint("revolute")), Body("wheel", Joint("fixed"), "shaft", inertia=(0.1, 0.1, 0.2))
    at = {"q0": 0.0, "qd0": 0.0, "tau0": 1.0}
    assert dyn.forward_dynamics(Mechanism([shaft, wheel])).evaluate(at) == {"qdd0": approx(5.0)}


def hinge(**given: Any) -> Joint:
    return Joint("revolute", **given)


GOOD: dict[str, Any] = {"name": "a", "joint": hinge(), "mass": 1.0, "center": (0.1, 0.0, 0.0)}
LEAF = [Body("a", hinge(), mass=1.0), Body("leaf", hinge(), "a")]
AND_NO_MORE = "carries no mass, and its joint has no armature"
SKEW = [[1.0, 0.2, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]]
BAD = [
    ([Body("a", hinge(), "c", mass=1.0)], "body 'a' has the unknown parent 'c'"),
    ([point("a", "b"), point("b", "a")], "body 'b' is its own ancestor, by way of 'a'"),
    ([point("a", "a")], "body 'a' is its own ancestor, by way of 'a'"),
    ([point("a"), point("b"), point("a")], "two bodies have the name 'a'"),
    ([point("world")], "a body needs a name other than 'world'"),
    ([point("")], "the name of a body must not be empty"),
    ({"joint": hinge(orientation=2.0 * np.eye(3))}, "body 'a': orientation must be a rotation matrix"),
    ({"joint": hinge(orientation=-np.eye(3))}, "body 'a': orientation must be a rotation matrix"),
    ({"joint": hinge(axis=(0, 0, 0))}, "body 'a': axis must not be zero"),
    ({"joint": hinge(axis=(0, 1))}, "body 'a': axis must be (3,) finite numbers, got (0, 1)"),
    ({"joint": hinge(damping=-0.1)}, "body 'a': damping must be finite and at least 0, got -0.1"),
    ({"joint": hinge(stiffness=-1.0)}, "body 'a': stiffness must be finite and at least 0, got -1.0"),
    ({"joint": hinge(armature=-1.0)}, "body 'a': armature must be finite and at least 0, got -1.0"),
    ({"joint": hinge(spring_reference=np.nan)}, "body 'a': spring_reference must be finite"),
    ({"joint": hinge(position=(0, np.inf, 0))}, "body 'a': position must be (3,) finite numbers"),
    ({"mass": -0.8}, "body 'a': mass must be finite and at least 0, got -0.8 kg"),
    ({"mass": np.nan}, "body 'a': mass must be finite and at least 0, got nan kg"),
    ({"center": (np.nan, 0.0, 0.0)}, "body 'a': center must be (3,) finite numbers, got (nan, 0.0, 0.0)"),
    ({"inertia": (1.0, 1.0, np.nan)}, "body 'a': inertia must be (3,) finite numbers"),
    ({"inertia": [[1.0], [2.0, 3.0]]}, "body 'a': inertia must be (3, 3) finite numbers"),
    ({"inertia": SKEW}, "body 'a': inertia must be symmetric"),
    ({"inertia": (-1.0, 1.0, 1.0)}, "body 'a': inertia must not be negative, its principal moments are [-1.0"),
    ({"mass": "too heavy"}, "the name of a parameter of body 'a': mass must be without white space"),
    ({"mass": np.inf}, "body 'a': mass must be finite and at least 0, got inf kg"),
    ({"joint": hinge(orientation=np.full((3, 3), np.nan))}, "body 'a': orientation must be (3, 3) finite numbers"),
    (
        {"mass": 1e308, "center": (1.0, 1.0, 1.0)},
        "body 'a': inertia about the joint is beyond float64, with 0 kg m^2 about its center and inf kg m^2 by that",
    ),
    ({"inertia": (1e308, 1e308, 1e308)}, "body 'a': inertia about the joint is beyond float64"),
    (
        [Body("a", hinge()), *[Body(f"b{k}", Joint("fixed"), "a", 9e307, (0.9, 0.9, 0.0)) for k in range(2)]],
        "body 'a': its inertia about the joint is beyond float64, with all welded to it",
    ),
    (LEAF, f"body 'leaf' has no mass, {AND_NO_MORE}"),
    ({"center": (0.0, 0.0, 0.5)}, f"body 'a' has no inertia about its axis, {AND_NO_MORE}"),
    (
        {"joint": hinge(axis=(1, 2, -2)), "center": (-0.1, -0.2, 0.2)},
        f"body 'a' has no inertia about its axis, {AND_NO_MORE}",
    ),
    ({"joint": Joint("prismatic"), "mass": 0.0, "inertia": (1.0, 1.0, 1.0)}, f"body 'a' has no mass, {AND_NO_MORE}"),
]


def test_a_mass_of_any_size_has_a_mass_matrix_or_is_beyond_float64() -> None:
    """Never "carries no mass", where its square distance has a number, whatever the unit."""
    for mass in [float(f"1e{k}") for k in range(-150, 309, 17)]:
        for length in [float(f"1e{k}") for k in range(-75, 154, 19)]:
            body = Body("a", hinge(axis=(0.0, 1.0, 0.0)), mass=mass, center=(length, 0.0, 0.0))
            if mass * length * length < 1e308:
                (inertia,) = dyn.mass_matrix(Mechanism([body])).evaluate({"q0": 0.3, "qd0": 0.0}).values()
                assert inertia == approx(mass * length**2, rel=1e-15, abs=0.0)
            else:
                with raises(MechanismError, match="inertia about the joint is beyond float64"):
                    Mechanism([body])


@each_row(("bodies", "message"), BAD)
def test_what_cannot_be_is_refused_by_name(bodies: Any, message: str) -> None:
    with raises(MechanismError, match="^" + re.escape(message)) as caught:
        Mechanism([Body(**(GOOD | bodies))] if isinstance(bodies, dict) else bodies)
    assert "\n" not in str(caught.value)


@mark.parametrize("bodies", [[], [Body("a", Joint("fixed"), mass=1.0)]])
def test_a_system_needs_a_joint_that_moves(bodies: list[Body]) -> None:
    with raises(MechanismError, match="the mechanism has no joint that moves"):
        _ = Mechanism(bodies).system


def test_a_tree_by_its_parents_is_the_tree_spelled_out_and_a_chain_of_default_rods_the_planar_arm() -> None:
    parents = [-1, 0, 0, 2]
    axes = [(0, 1, 0), (1, 0, 0), (0, 0, 1), (1, 1, 0)]
    names = ["world", "link 1", "link 1", "link 3"]
    spelled = [
        Body(
            f"link {i + 1}",
            Joint("revolute", axes[i], (0.0, 0.0, -1.0 if i else 0.0)),
            names[i],
            mass=1.0,
            center=(0.0, 0.0, -0.5),
            inertia=(1 / 12, 1 / 12, 0.0),
        )
        for i in range(4)
    ]
    chain = dyn.tree(range(-1, 4), axes=(0.0, -1.0, 0.0))  # about -y, so that angles count alike
    rods = dyn.planar_arm([1.0] * 5, [1.0] * 5)
    for one, other in ((dyn.tree(parents, axes=axes), Mechanism(spelled)), (chain, rods)):
        given = states(one, 5)
        for derive in (dyn.forward_dynamics, dyn.inverse_dynamics):
            assert error(run(derive(one), given), run(derive(other), given)) < EQUATIONS


@mark.parametrize(
    ("arguments", "message"),
    [
        ({"parents": [-1, 2]}, "parents must be indices from -1 to 1, got 2 for link 2"),
        ({"parents": [-2]}, "parents must be indices from -1 to 0, got -2 for link 1"),
        ({"parents": ["world"]}, "parents must be indices from -1 to 0, got 'world' for link 1"),
        ({"parents": [-1, 1]}, "body 'link 2' is its own ancestor, by way of 'link 2'"),
        ({"parents": [-1], "links": []}, "a tree needs a link for each of its 1 parents, got 0"),
        ({"parents": [-1, 0], "axes": [(0, 1, 0)] * 3}, "axes must be (3,) finite numbers, got [(0, 1, 0)"),
        ({"parents": [-1], "axes": (0, 0, 0)}, "body 'link 1': axis must not be zero"),
    ],
)
def test_a_tree_that_cannot_be_is_refused(arguments: dict[str, Any], message: str) -> None:
    with raises(MechanismError, match="^" + re.escape(message)):
        dyn.tree(**arguments)


def lines_run(work: Callable[[], object]) -> int:
    """How many lines of Python a work takes: a time that no other program on the machine changes."""
    count = 0

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal count
        count += event == "line"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(before)
    return count


def test_reading_a_chain_takes_time_linear_in_its_length() -> None:
    """Also leaf first, where each search for a placed ancestor walks the whole chain."""
    names = [f"b{i}" for i in range(300)]
    rows = [[point(name, names[i - 1] if i else "world") for i, name in enumerate(names)] for _ in range(2)]
    assert lines_run(lambda: Mechanism(rows[0][::-1])) < 2 * lines_run(lambda: Mechanism(rows[1]))


def test_a_planar_arm_hangs_down_at_zero_and_swings_to_the_right() -> None:
    arm = dyn.planar_arm([1.0, 1.0], [2.0, 1.0])
    hanging, right, folded = arm.joint_positions(np.array([[0.0, 0.0], [np.pi / 2, 0.0], [np.pi / 2, np.pi / 2]]))
    assert hanging == approx(np.array([[0, 0], [0, -2], [0, -3]]), abs=LAST_BITS)
    assert right == approx(np.array([[0, 0], [2, 0], [3, 0]]), abs=LAST_BITS)
    assert folded == approx(np.array([[0, 0], [2, 0], [2, 1]]), abs=LAST_BITS)


@mark.parametrize("angle", [0.0, 0.3, -1.2, np.pi, 3.0])
@mark.parametrize("axis", [(0.6, 0.0, 0.8), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_rotation_comes_back_from_its_quaternion(axis: tuple[float, ...], angle: float) -> None:
    turn = rotation(np.array(axis), angle)
    assert from_quaternion(to_quaternion(turn)) == approx(turn, abs=LAST_BITS)
