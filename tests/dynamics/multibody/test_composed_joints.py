"""Cylindrical, universal and planar joints: the slides and hinges that they are made of, written by hand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from pytest import importorskip, mark, raises

import dynamics as dyn
from dynamics.multibody.algebra.spatial import unit
from tests.dynamics.mechanisms import random_body
from tests.dynamics.models import error, run, states
from tests.tolerances import LONG_SUM, TORQUES

KINDS = {"cylindrical": ("shift", "angle"), "universal": ("angle1", "angle2"), "planar": ("x", "y", "angle")}
SIZES = {"damping": (0.1, 0.2, 0.3), "stiffness": (3.0, 0.0, 5.0), "spring_reference": (0.1, -0.2, 0.3),
         "armature": (0.0, 0.02, 0.03)}  # fmt: skip
ACROSS = (2.0, -1.0, 0.0)  # at a right angle to AXIS
AXIS = (1.0, 2.0, 2.0)


def on_joint(kind: str, *, name: str = "") -> dyn.Mechanism:
    """A hinge, a body with numbers of any kind on the composed joint, and one on it."""
    rng = np.random.default_rng(2)
    count = len(KINDS[kind])
    first, middle, last = (random_body(f"b{i}", "revolute", f"b{i - 1}" if i else "world", rng) for i in range(3))
    numbers = {field: values[:count] for field, values in SIZES.items()}
    second = {} if kind == "cylindrical" else {"second_axis": ACROSS}
    joint = dyn.Joint(kind, AXIS, middle.joint.position, middle.joint.orientation, name=name, **numbers, **second)
    return dyn.Mechanism([first, replace(middle, joint=joint), last])


def by_hand(kind: str) -> dyn.Mechanism:
    mechanism = on_joint(kind)
    first, middle, last = mechanism.bodies
    third = np.cross(unit(np.array(AXIS)), unit(np.array(ACROSS)))
    chain: list[tuple[str, Any]] = {
        "cylindrical": [("prismatic", AXIS), ("revolute", AXIS)],
        "universal": [("revolute", AXIS), ("revolute", ACROSS)],
        "planar": [("prismatic", ACROSS), ("prismatic", third), ("revolute", AXIS)],
    }[kind]
    names = [f"b1.{name}" for name in KINDS[kind]]
    joints = [dyn.Joint(each, axis, name=name, **{field: values[i] for field, values in SIZES.items()})
              for i, ((each, axis), name) in enumerate(zip(chain, names, strict=True))]  # fmt: skip
    joints[0] = replace(joints[0], position=middle.joint.position, orientation=middle.joint.orientation)
    bodies = [dyn.Body(name, joint, parent) for name, joint, parent in
              zip(names[:-1], joints, ["b0", *names], strict=False)]  # fmt: skip
    return dyn.Mechanism([first, *bodies, replace(middle, joint=joints[-1], parent=names[-2]), last])


@mark.parametrize("kind", KINDS)
def test_a_composed_joint_is_its_parts_node_by_node(kind: str) -> None:
    composed, chain = on_joint(kind), by_hand(kind)
    assert composed.coordinates == chain.coordinates == ("b0", *[f"b1.{name}" for name in KINDS[kind]], "b2")
    assert len(composed.bodies) == 3
    for graph in (dyn.inverse_dynamics, dyn.forward_dynamics, dyn.energy, dyn.spatial_momentum):
        assert graph(composed).listing() == graph(chain).listing()
    state = np.random.default_rng(0).normal(size=(3, composed.system.n))
    assert np.array_equal(*[dyn.Rows(each).inverse(*state) for each in (composed, chain)])
    assert str(dyn.prune(composed)) == str(dyn.prune(chain))
    assert on_joint(kind, name="j").coordinates[1] == f"j.{KINDS[kind][0]}"


def test_a_plane_across_z_has_the_axes_x_and_y() -> None:
    puck = dyn.Mechanism([dyn.Body("puck", dyn.Joint("planar", damping=0.5), mass=1.0, inertia=(1.0, 1.0, 1.0))])
    assert puck.position("puck").evaluate({"q0": 0.3, "q1": 0.4, "q2": 0.0}) == {"x": 0.3, "y": 0.4, "z": 0.0}
    assert puck.system.damping == (0.5, 0.5, 0.5)


@mark.parametrize("kind", KINDS)
def test_it_is_let_go_with_the_velocity_that_it_has(kind: str) -> None:
    mechanism = on_joint(kind)
    assert mechanism.joint_positions(np.zeros(mechanism.system.n)).shape[1] == mechanism.system.n + 1
    kept = mechanism.detach("b2")
    q, qd = np.random.default_rng(1).normal(size=(2, kept.system.n))
    let_go = dyn.release(kept, q, qd, "b1")
    moving = dyn.arrays_at(kept, dyn.frame_velocity(kept, "b1", kept.bodies[1].center), q, qd)["V"]
    assert np.abs(let_go.body.velocity - moving[:3]).max() < LONG_SUM


@mark.parametrize("kind", KINDS)
def test_files_have_the_parts(kind: str) -> None:
    importorskip("mujoco")
    mechanism = on_joint(kind)
    again = dyn.load_mjcf(dyn.to_mjcf(mechanism))
    assert again.coordinates == mechanism.coordinates
    given = states(mechanism, 3)
    assert error(run(dyn.bias(again), given), run(dyn.bias(mechanism), given)) < TORQUES


@mark.parametrize(
    ("joint", "said"),
    [
        (dyn.Joint("universal", second_axis=(0.1, 0.0, 1.0)), "body 'b': second_axis must be at a right angle to axis"),
        (dyn.Joint("planar", axis=(0.0, 0.0, 0.0)), "body 'b': axis must not be zero"),
        (dyn.Joint("planar", second_axis="x"), "body 'b': second_axis must be"),
        (dyn.Joint("cylindrical", second_axis=(1.0, 0.0, 0.0)), "'cylindrical' has no second axis"),
        (dyn.Joint("revolute", second_axis=(1.0, 0.0, 0.0)), "'revolute' has no second axis"),
        (dyn.Joint("planar", damping=(0.1, 0.2)), "body 'b': damping must be one number, or 3 for x, y, angle, got"),
        (dyn.Joint("revolute", damping=(0.1,)), "body 'b': damping must be finite and at least 0, got"),
        (
            dyn.Joint("universal", stiffness=(1.0, -2.0)),
            "body 'b': stiffness of the coordinate 'b.angle2' must be finite and at least 0, got -2.0",
        ),
        (dyn.Joint("cylindrical", pitch=1.0), "only a screw has a pitch"),
    ],
)
def test_what_is_wrong_is_said(joint: dyn.Joint, said: str) -> None:
    with raises(dyn.MechanismError, match=said):
        dyn.Mechanism([dyn.Body("b", joint, mass=1.0, inertia=(1.0, 1.0, 1.0))])


def test_names_inside_are_taken() -> None:
    body = dyn.Body("b", dyn.Joint("cylindrical"), mass=1.0, inertia=(1.0, 1.0, 1.0))
    weld = dyn.Joint("fixed")
    with raises(dyn.MechanismError, match=r"two bodies have the name 'b\.shift'"):
        dyn.Mechanism([body, dyn.Body("b.shift", weld)])
    with raises(dyn.MechanismError, match=r"body 'c' has the unknown parent 'b\.shift'"):
        dyn.Mechanism([body, dyn.Body("c", weld, "b.shift")])
    with raises(dyn.MechanismError, match=r"a force on the unknown body 'b\.shift'"):
        dyn.Mechanism([body], forces=[dyn.Force("b.shift", (1.0, 0.0, 0.0))])


def test_a_parameter_of_one_coordinate_is_bound() -> None:
    joint = dyn.Joint("planar", damping=("d", 0.1, 0.2))
    table = dyn.Mechanism([dyn.Body("b", joint, mass="m", inertia=(1.0, 1.0, 1.0))], parameters={"d": 0.5, "m": 2.0})
    assert table.bind().system.damping == (0.5, 0.1, 0.2)
    state = {f"{name}{i}": 0.1 for name in ("q", "qd", "tau") for i in range(3)}
    of_parameters = dyn.forward_dynamics(table).evaluate(state | {"d": 0.5, "m": 2.0})
    assert dyn.forward_dynamics(table.bind()).evaluate(state) == of_parameters


WRONG = {
    "position": (0.0, 1.0),
    "orientation": np.ones((3, 3)),
    "axis": (0.0, 0.0, 0.0),
    "pitch": 1.0,
    "name": "a\n",
    "damping": -1.0,
    "stiffness": math.nan,
    "spring_reference": math.inf,
    "armature": "no name",
}


def wrong(what: str, kind: str) -> object:
    inertia = {"mass": 1.0, "center": (0.1, 0.2, 0.3), "inertia": (0.1, 0.2, 0.2)}
    body = dyn.Body("b", dyn.Joint(kind, name="j", damping="c"), **inertia)
    if what in WRONG:
        return dyn.Mechanism([replace(body, joint=replace(body.joint, **{what: WRONG[what]}))], parameters={"c": 0.1})
    if what == "parent":
        return dyn.mass_matrix(dyn.Mechanism([replace(body, parent="nobody")], parameters={"c": 0.1}))
    if what == "value":
        return dyn.Mechanism([body], parameters={"c": -1.0})
    if what == "bound":
        return dyn.Mechanism([body], parameters={"c": 1.0}).bind({"c": -1.0})
    if what == "force":
        return dyn.Mechanism([body], parameters={"c": 1.0}, forces=[dyn.JointFriction("b", 1.0, 1.0)])
    other = dyn.Body("other", dyn.Joint("revolute"), **inertia)
    return dyn.Mechanism([body, other], parameters={"c": 1.0}, loops=[dyn.Loop("coupling", "b", "other")])


@mark.parametrize("kind", KINDS)
@mark.parametrize("what", [*WRONG, "parent", "value", "bound", "force", "coupling"])
def test_what_is_wrong_with_a_joint_of_parts_is_said_of_the_body_and_its_coordinate(kind: str, what: str) -> None:
    with raises(dyn.MechanismError) as caught:
        wrong(what, kind)
    said = str(caught.value)
    assert "'b'" in said or "'b to other'" in said
    assert "'b." not in said
    of_one = what in (*SIZES, "value", "bound")
    assert f"'j.{KINDS[kind][0]}'" in said or not of_one
