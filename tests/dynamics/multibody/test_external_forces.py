"""Forces on bodies: virtual work by differences, what they are made of, and what cannot be one."""

import re
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
from pytest import mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import Body, Force, Joint, Mechanism, MechanismError
from dynamics.multibody.algebra.spatial import from_quaternion
from tests.dynamics.mechanisms import FAMILIES, PLAIN, turned_arm
from tests.dynamics.models import Array, at, error, run, states
from tests.slow import slow

ROUNDING = 1e-12  # of the largest entry: two orders of summing the same few terms
DIFFERENCES = 1e-8  # of the largest entry: central differences of positions of size 1 with a step of 1e-5
AGREEMENT = 1e-10  # of the largest entry: rounding of two codes, times the condition number of M
HAND = (0.2, -0.3, 0.5)
VALUE, TORQUE = np.array([3.0, -2.0, 5.0]), np.array([0.7, 1.1, -0.4])


def pushed(mechanism: Mechanism, body: str, frame: str = "world", **given: Any) -> Mechanism:
    value, torque = given.pop("value", tuple(VALUE)), given.pop("torque", tuple(TORQUE))
    return replace(mechanism, forces=[Force(body, value, HAND, frame, torque)], **given)


def generalized(mechanism: Mechanism, state: dict[str, Any]) -> Array:
    """What the forces take from the torque of a motion: (n,) or (count, n)."""
    free = replace(mechanism, forces=(), parameters={})
    return run(dyn.inverse_dynamics(free), state) - run(dyn.inverse_dynamics(mechanism), state)


def points(mechanism: Mechanism, body: str) -> list[cg.Graph]:
    """Where HAND is on the body, its origin, and the tips of its axes."""
    return [mechanism.position(body, point) for point in (HAND, (0, 0, 0), *np.eye(3))]


def pose(graphs: list[cg.Graph], q: Array) -> tuple[Array, Array]:
    """Where HAND is, (3,), and the body's axes, as columns (3, 3), from positions alone."""
    places = [run(graph, {"q": q}) for graph in graphs]
    return places[0], np.column_stack([tip - places[1] for tip in places[2:]])


def work(graphs: list[cg.Graph], q: Array, value: Array, torque: Array, step: float = 1e-5) -> Array:
    """Virtual work along each coordinate, (n,), by central differences: f . dp + torque . dtheta, both in the world."""
    rates, turned = [], pose(graphs, q)[1]
    for unit in np.eye(len(q)):
        (before, old), (after, new) = (pose(graphs, q + sign * step * unit) for sign in (-1.0, 1.0))
        spin = (new - old) @ turned.T  # skew: dR R^T
        turn = 0.5 * np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]])
        rates.append((value @ (after - before) + torque @ turn) / (2.0 * step))
    return np.array(rates)


MODELS: dict[str, Callable[[], Mechanism]] = {name: lambda make=make: make(7) for name, make in FAMILIES.items()} | {
    "a turned slide across two axes": lambda: Mechanism(
        [Body("cart", Joint("prismatic", (1.0, 1.0, 0.0), orientation=from_quaternion([1, 2, 3, 4])), mass=1.0)]
    )
}


@mark.parametrize("frame", ["world", "body"])
@mark.parametrize("name", [*[name for name in MODELS if name not in PLAIN], *slow(*PLAIN)])
def test_a_force_does_the_virtual_work_of_its_point(name: str, frame: str) -> None:
    """Of numbers, and of nodes of the state and the time, whose own dependence is not differentiated."""
    mechanism, (first, speed, t) = MODELS[name](), cg.variables("q0 qd0 t")
    state = at(states(mechanism, 1), 0)
    q, value = state["q"], [VALUE[0] - 0.3 * speed, VALUE[1] + 0.5 * cg.sin(first), VALUE[2] * t]
    pushes = VALUE - [0.3 * state["qd"][0], -0.5 * np.sin(q[0]), (1.0 - state["t"]) * VALUE[2]]
    for body in {
        mechanism.bodies[0].name,
        mechanism.bodies[len(mechanism.bodies) // 2].name,
        mechanism.bodies[-1].name,
    }:
        graphs = points(mechanism, body)
        axes = pose(graphs, q)[1] if frame == "body" else np.eye(3)
        for given, force in ((VALUE, VALUE), (value, pushes)):
            expected = work(graphs, q, axes @ force, axes @ TORQUE)
            ours = generalized(pushed(mechanism, body, frame, value=given), state)
            assert np.abs(ours - expected).max() < DIFFERENCES * np.abs(expected).max(), body


def test_accelerations_take_the_force_that_torques_do() -> None:
    mechanism = pushed(FAMILIES["welded"](4), "b3")
    given = states(mechanism, 5)
    for method in ("auto", "recursive", "dense"):
        qdd = run(dyn.forward_dynamics(mechanism, method), given)
        assert error(run(dyn.inverse_dynamics(mechanism), given | {"qdd": qdd}), given["tau"]) < AGREEMENT


def test_forces_are_tagged_with_their_body() -> None:
    arm = turned_arm(4)
    graph = dyn.inverse_dynamics(pushed(arm, "link 3"))
    tagged = [node for node in graph.nodes if "force" in node.tags]
    assert tagged
    assert all("link 3" in node.tags for node in tagged)
    assert any("adjoint" in node.roles for node in tagged)
    assert not any("force" in node.tags for node in dyn.inverse_dynamics(arm).nodes)


def test_no_force_costs_nothing_and_one_costs_little() -> None:
    """18 nodes a joint on the way, of some 550: a rotation of the force, one of the point, and the lever."""
    arm = turned_arm(30)
    without, with_ = (len(dyn.inverse_dynamics(each).nodes) for each in (arm, pushed(arm, "link 30", torque=(0, 0, 0))))
    assert len(dyn.inverse_dynamics(replace(arm, forces=[])).nodes) == without
    assert with_ - without <= 18 * 30


def test_a_force_on_what_is_welded_to_the_world_does_nothing() -> None:
    base = Body("base", Joint("fixed", position=(1.0, 0.0, 0.0)), mass=1.0)
    arm = Body("arm", Joint("revolute", (0.0, 1.0, 0.0)), "base", mass=1.0, center=(0.5, 0.0, 0.0))
    free = Mechanism([base, arm])
    still = replace(free, forces=[Force("base", (1.0, 2.0, 3.0), torque=(4.0, 5.0, 6.0))])
    assert len(dyn.forward_dynamics(still).nodes) == len(dyn.forward_dynamics(free).nodes)
    assert free.position("base", (0.0, 2.0, 0.0)).evaluate({"q0": 0.3}) == {"x": 1.0, "y": 2.0, "z": 0.0}


def test_bodies_and_forces_may_come_from_iterators() -> None:
    arm = turned_arm(3)
    read = Mechanism(iter(arm.bodies), forces=iter([Force("link 3", VALUE, HAND)]))
    listed = replace(arm, forces=[Force("link 3", VALUE, HAND)])
    given = states(arm, 2)
    for each in (read, replace(read)):
        assert error(run(dyn.inverse_dynamics(each), given), run(dyn.inverse_dynamics(listed), given)) < ROUNDING
    assert len(read.bodies) == 3


ROTOR = Mechanism([Body("rotor", Joint("revolute"), inertia=(1.0, 1.0, 1.0))])
COMPONENT = "the force on body 'rotor': a component of {} must be a finite number, a parameter's name or a node,"
BAD: dict[str, tuple[Any, str]] = {
    "unknown body": ([Force("hand", (1, 0, 0))], "there is a force on the unknown body 'hand'"),
    "the world": ([Force("world", (1, 0, 0))], "there is a force on the unknown body 'world'"),
    "no name": ([Force(3, (1, 0, 0))], "there is a force on the unknown body 3"),
    "no force": ([(1, 0, 0)], "forces must be of the type Force, JointForce or Contact, got tuple: (1, 0, 0)"),
    "one force": (Force("rotor"), "forces must be a sequence of Force, JointForce or Contact, got Force: "),
    "frame": (
        [Force("rotor", (1, 0, 0), frame="local")],
        "the force on body 'rotor': frame must be one of world, body, got 'local'",
    ),
    "point": ([Force("rotor", at=(0, 0))], "the force on body 'rotor': at must be (3,) finite numbers, got (0, 0)"),
    "point NaN": (
        [Force("rotor", at=(0, np.nan, 0))],
        "the force on body 'rotor': at must be (3,) finite numbers, got (0, nan, 0)",
    ),
    "two components": (
        [Force("rotor", (1, 0))],
        "the force on body 'rotor': value must have three components, got (1, 0)",
    ),
    "text": ([Force("rotor", "fxy")], "the force on body 'rotor': value must have three components, got 'fxy'"),
    "a number": ([Force("rotor", torque=2.0)], "the force on body 'rotor': torque must have three components, got 2.0"),
    "infinite": ([Force("rotor", (0, np.inf, 0))], f"{COMPONENT.format('value')} got inf"),
    "none": ([Force("rotor", torque=(0, None, 0))], f"{COMPONENT.format('torque')} got None"),
}


@mark.parametrize("case", BAD)
def test_a_force_that_cannot_be_is_refused(case: str) -> None:
    forces, message = BAD[case]
    with raises(MechanismError, match="^" + re.escape(message)) as caught:
        replace(ROTOR, forces=forces)
    assert "\n" not in str(caught.value)


TWICE = 2.0 * cg.variable("m")


@mark.parametrize(
    ("component", "parameters", "message"),
    [
        ("q0", {}, "parameter 'q0' has the name of a coordinate"),
        ("m", {"m": np.nan}, "parameter 'm' must be a finite number, got nan"),
        ("m", {"n": 1.0}, "the mechanism has no body, joint or force that uses the parameter 'n'"),
        ("a b", {}, "the name of a parameter must be without white space, got 'a b'"),
        (TWICE, {}, "the system uses 'm', which is no coordinate, parameter or t"),
        (TWICE, {"m": 3.0}, ""),
    ],
)
def test_a_parameter_that_cannot_be_is_refused(component: Any, parameters: dict[str, float], message: str) -> None:
    with raises(ValueError, match=re.escape(message)) if message else nullcontext():
        system = replace(ROTOR, forces=[Force("rotor", torque=(0, 0, component))], parameters=parameters).system
        assert system.parameters == parameters


def test_places_of_no_body_and_forces_in_files_are_refused() -> None:
    for call, said in (
        (lambda: ROTOR.position("hand"), "there is no body 'hand' in the mechanism"),
        (lambda: ROTOR.position("roto"), "there is no body 'roto' in the mechanism; did you mean 'rotor'?"),
        (lambda: ROTOR.position("rotor", 1.0), "position on body 'rotor': at must be (3,) finite numbers, got 1.0"),
        (lambda: dyn.to_mjcf(pushed(ROTOR, "rotor")), "MJCF has no forces, there is one on body 'rotor'"),
    ):
        with raises(MechanismError, match=f"^{re.escape(said)}$"):
            call()
