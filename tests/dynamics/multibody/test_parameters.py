"""Parameters in place of numbers of bodies, joints and gravity: the same mechanism, with more inputs."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph import Graph
from dynamics import Body, Joint, Mechanism, MechanismError
from dynamics.multibody.algebra.spatial import from_quaternion
from tests.dynamics.mechanisms import FAMILIES, random_tree
from tests.dynamics.models import run as values
from tests.dynamics.multibody import test_ball_and_free
from tests.dynamics.multibody.test_ball_and_free import near
from tests.dynamics.multibody.test_random_joints import GRAPHS
from tests.dynamics.parametrized import parametrized
from tests.each_row import each_row
from tests.slow import slow

LIGHT = ("inverse dynamics", "forward dynamics", "mass matrix", "bias", "gravity", "momentum", "energy")
HEAVY = ("chain_rule_literal", "derivatives", "state space", "coriolis", "regressor")
OF_FRAMES = ("motion", "placement")


def state(mechanism: Mechanism, seed: int = 0) -> dict[str, float]:
    return test_ball_and_free.state(mechanism.system, seed, qdd=1, tau=1) | mechanism.parameter_values


def same(a: Graph, b: Graph) -> bool:
    comparison = cg.compare(a, b)
    return not (comparison.only_left or comparison.only_right or comparison.other_outputs)


SEEDS = [("revolute", 1), *[(base, seed) for base in ("revolute", "ball", "free") for seed in range(4, 40)]]


@mark.parametrize(("base", "seed"), [("revolute", 0), ("free", 2), *slow(*SEEDS)])
def test_every_graph_is_that_of_the_numbers(base: str, seed: int) -> None:
    """Welded bodies among them: masses, centers and parallel axes are then nodes."""
    numbers = random_tree(seed, 3 if seed < 4 else 5, base=base)
    mechanism = parametrized(numbers, seed, 0.7)
    at = state(mechanism, seed)
    for name in (*LIGHT, *HEAVY, *OF_FRAMES):
        if name in HEAVY and base == "free" and seed < 4:
            continue
        graph, _ = GRAPHS[name]
        mine = graph(mechanism)
        assert near(values(mine, at), values(graph(numbers), at)), name
        if name not in OF_FRAMES:
            assert set(mechanism.parameters) <= set(mine.input_names)


# Each number of a body alone, each with another, and all but one; xx, yx, yy, zx, zy and zz of the inertia
INERTIAL = ("mass", "x", "y", "z", "xx", "yx", "yy", "zx", "zy", "zz")
MIXTURES = [{a, b} for i, a in enumerate(INERTIAL) for b in INERTIAL[i:]] + [{*INERTIAL} - {a} for a in INERTIAL]


def test_any_numbers_of_a_body_may_be_parameters() -> None:
    """Beside numbers: a parameter in any place of mass, center and inertia."""
    at = dict(zip(INERTIAL, (1.3, 0.2, -0.1, 0.4, 0.31, 0.02, 0.27, -0.03, 0.01, 0.24), strict=True))

    def arm(names: Any) -> Mechanism:
        n = {name: name if name in names else value for name, value in at.items()}
        inertia = [[n["xx"], n["yx"], n["zx"]], [n["yx"], n["yy"], n["zy"]], [n["zx"], n["zy"], n["zz"]]]
        shoulder = Body("a", Joint("revolute"), "world", n["mass"], (n["x"], n["y"], n["z"]), inertia)
        elbow = Body("b", Joint("revolute", (1.0, 0.0, 0.0), (0.0, 0.0, 0.5)), "a", 0.7, (0.0, 0.2, 0.1))
        return Mechanism([shoulder, elbow], parameters={name: at[name] for name in INERTIAL if name in names})

    state_ = state(arm(()))
    right = values(dyn.inverse_dynamics(arm(())), state_)
    for names in MIXTURES:
        mixed = arm(names)
        assert near(values(dyn.inverse_dynamics(mixed), state_ | mixed.parameter_values), right), names


@mark.parametrize("family", ["mixed", "welded"])
def test_base_parameters_are_nodes_too(family: str) -> None:
    numbers = replace(FAMILIES[family](4), base_parameters=True)
    mechanism = parametrized(numbers, 1)
    at = state(mechanism)
    for graph in (dyn.inverse_dynamics, dyn.forward_dynamics, dyn.energy):
        assert near(values(graph(mechanism), at), values(graph(numbers), at))


def test_numbers_alone_keep_their_graphs() -> None:
    """Values of parameters bound to a mechanism give the very graph of the numbers; so do nodes of constants."""
    arm = dyn.planar_arm([1.0, 0.8, 0.5], [1.0, 0.5, 0.3], damping=0.1)
    mass, length = cg.variable("m"), cg.variable("l")
    bodies = [replace(arm.bodies[0], mass=mass), *arm.bodies[1:]]
    bodies[1] = replace(bodies[1], joint=replace(bodies[1].joint, position=(0.0, 0.0, -length)))
    whole = replace(arm, bodies=bodies, parameters={"m": 1.0, "l": 1.0})
    constants = replace(arm, gravity=[0.0, 0.0, 0.0 - cg.constant(9.81)])
    for back in (whole.bind(), whole.bind({"m": 1.0}).bind({"l": 1.0}), constants):
        assert same(dyn.inverse_dynamics(back), dyn.inverse_dynamics(arm))
        assert back.parameters == {}


def test_the_regressor_keeps_its_names_apart() -> None:
    """A parameter may be called as the regressor calls its own."""
    rod = Body("rod", Joint("revolute", (0.0, 1.0, 0.0), ("m_0", 0, 0)), mass=1.0, center=("mx_0", 0.0, 0.0))
    mechanism = Mechanism([rod], parameters={"m_0": 0.3, "mx_0": 0.4})
    at = state(mechanism)
    assert near(values(dyn.regressor(mechanism), at), values(dyn.regressor(mechanism.bind()), at))


@mark.parametrize("quantity", ["length", "center", "mass", "damping", "g"])
def test_slopes_of_accelerations_by_any_number_are_differences(quantity: str) -> None:
    """Differences of eighth order."""
    arm = pendulums()
    slopes = cg.jacobian(dyn.forward_dynamics(arm), [quantity])
    at, h = state(arm), 1e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    graph = dyn.forward_dynamics(arm)
    difference = sum(
        w * sign * values(graph, at | {quantity: at[quantity] + sign * k * h}) / h
        for k, w in weights.items()
        for sign in (1, -1)
    )
    assert values(slopes, at) == approx(difference, rel=1e-9)


def pendulums(**more: float) -> Mechanism:
    """Two links and a load welded to the second, of one parameter each."""
    length, center = cg.variable("length"), cg.variable("center")
    hinge = Joint("revolute", (0.0, -1.0, 0.0), damping="damping")
    lower = replace(hinge, position=(0.0, 0.0, -length), stiffness="k", spring_reference="rest", armature="rotor")
    bodies = [
        Body("upper", hinge, mass="mass", center=(0.0, 0.0, -center), inertia=(0.1, "inertia", 0.01)),
        Body("lower", lower, "upper", mass=0.5, center=(0.1, 0.0, -0.5 * length), inertia=(0.1, 0.1, 0.01)),
        Body("load", Joint("fixed", position=(0.0, 0.0, -length)), "lower", mass="load"),
    ]
    chosen = {"mass": 1.0, "center": 0.4, "length": 0.8, "damping": 0.1, "inertia": 0.1, "load": 0.0, "g": 9.81}
    chosen |= {"k": 0.3, "rest": 0.2, "rotor": 0.01}
    return Mechanism(bodies, (0.0, 0.0, -cg.variable("g")), parameters=chosen | more)


def test_a_load_of_no_mass_on_a_frame_of_none_is_none() -> None:
    """No quotient of masses is in the graph."""
    frame = Body("frame", Joint("fixed"), "rod")
    rod = Body("rod", Joint("revolute", (0.0, 1.0, 0.0), armature=1.0))
    loads = [Body(name, Joint("fixed", position=(1.0, 0.0, 0.0)), "frame", mass=name) for name in ("a", "b")]
    mechanism = Mechanism([rod, frame, *loads], parameters={"a": 0.0, "b": 0.0})
    assert values(dyn.forward_dynamics(mechanism), state(mechanism) | {"tau0": 2.0}).tolist() == [2.0]


def test_a_force_at_a_place_of_parameters_does_its_work() -> None:
    """Q = J^T f of a body welded on where a parameter says."""
    wind = dyn.Force("load", ("wind", 0.0, 1.0))
    arm = replace(pendulums(), forces=[wind], parameters=pendulums().parameters | {"wind": 2.0})
    at = state(arm)
    for graph in (dyn.inverse_dynamics, dyn.forward_dynamics):
        assert near(values(graph(arm), at), values(graph(arm.bind()), at))
        assert near(values(graph(arm.bind({"length": 0.8})), at), values(graph(arm), at))


PLAIN: dict[str, Any] = {"method": "rk4", "dt": 0.05, "backend": "python"}


def test_dry_friction_may_be_one() -> None:
    """A motion that slides is slower by loss t / m, by which its place is off by loss t^2 / 2 m."""
    cart = Body("cart", Joint("prismatic", (1.0, 0.0, 0.0)), mass=2.0)
    rough = Mechanism([cart], forces=[dyn.JointFriction("cart", loss="c", velocity=0.001)], parameters={"c": 4.0})
    numbers = replace(rough, forces=[dyn.JointFriction("cart", loss=4.0, velocity=0.001)], parameters={})
    assert same(dyn.forward_dynamics(rough.bind()), dyn.forward_dynamics(numbers))
    found = dyn.gradient(rough, lambda q, qd, t: q[0], [0.0], [1.0], 0.2, dt=0.02, wrt="c", backend="python")
    assert (found.value, found["c"]) == (approx(0.2 - 0.04), approx(-0.01))
    with raises(MechanismError, match="loss has the parameter 'c', which needs a value"):
        replace(rough, parameters={})
    with raises(MechanismError, match=r"loss must be finite and at least 0, got -1\.0, where c = -1\.0"):
        replace(rough, parameters={"c": -1.0})
    with raises(MechanismError, match=r"uses the parameter 'cc': put its name .* or have `components` of a JointForce"):
        replace(rough, parameters={"c": 4.0, "cc": 1.0})


def test_pruning_takes_their_parameters_away() -> None:
    result = dyn.prune(pendulums(), effects=["armature", "forces"], values={"load": 0.0})
    kept = {"mass", "center", "length", "inertia", "load", "rotor"}
    assert set(result.model.parameters) == kept
    assert {term.what for term in result.omitted} == {"gravity", "damping", "springs", "input load"}
    regrouped = dyn.prune(pendulums(), regroup=True)
    at = state(pendulums())
    assert near(values(regrouped.graph, at), values(dyn.inverse_dynamics(pendulums()), at))


def test_they_go_with_their_bodies() -> None:
    arm = pendulums()
    assert set(arm.detach("lower").parameters) == {"mass", "center", "damping", "inertia", "g"}
    assert set(arm.subtree("load").parameters) == {"length", "load"}
    again = arm.detach("load").attach(arm.subtree("load"))
    assert dict(again.parameters) == dict(arm.parameters)
    assert same(dyn.inverse_dynamics(again), dyn.inverse_dynamics(arm))
    locked = arm.lock("lower", 0.4)
    assert dict(locked.parameters) == dict(arm.parameters)
    at = state(locked)
    assert near(
        values(dyn.inverse_dynamics(locked), at), values(dyn.inverse_dynamics(arm.bind().lock("lower", 0.4)), at)
    )
    with raises(
        MechanismError, match=r"^the parameter 'length' is 0\.8 in the mechanism and 2\.0 in what it takes on$"
    ):
        arm.attach(
            dyn.Subtree((Body("c", Joint("fixed", position=("length", 0, 0))),), "load", parameters={"length": 2.0})
        )


def test_what_takes_numbers_takes_the_values() -> None:
    arm = pendulums(load=0.3)
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 2))
    at = {f"{name}{i}": float(x) for name, row in (("q", q), ("qd", qd), ("qdd", qdd)) for i, x in enumerate(row)}
    tau = values(dyn.inverse_dynamics(arm), at | dict(arm.parameters))
    assert dyn.Rows(arm).inverse(q, qd, qdd) == approx(tau)
    assert dyn.to_mjcf(arm) == dyn.to_mjcf(arm.bind())
    assert dyn.inertial_parameters(arm) == approx(dyn.inertial_parameters(arm.bind()))
    assert arm.joint_positions(q) == approx(arm.bind().joint_positions(q))
    caught, numbers = (
        dyn.attach_with_impact(model.detach("load"), q, qd, load, velocity=(1.0, 0.0, 0.0))
        for model, load in ((arm, replace(arm.bodies[2], mass=0.3)), (arm.bind(), arm.bind().bodies[2]))
    )
    assert caught.qd == approx(numbers.qd)
    assert caught.energy == approx(numbers.energy)
    assert dyn.release(arm, q, qd, "load").body.velocity == approx(dyn.release(arm.bind(), q, qd, "load").body.velocity)


ROD: dict[str, Any] = {"joint": Joint("revolute"), "inertia": (1.0, 1.0, 1.0)}
BAD = [
    ({"mass": "m"}, {}, "body 'rod': mass has the parameter 'm', which needs a value in `parameters`"),
    (
        {"mass": 1.0 - cg.variable("m")},
        {"m": 3.0},
        "body 'rod': mass must be finite and at least 0, got -2.0 kg, where",
    ),
    (
        {"inertia": ("a", "b", 2.0)},
        {"a": -1.0, "b": 2.0},
        "body 'rod': inertia must not be negative, its principal moments are [-1.0, 2.0, 2.0], where a = -1.0, b = 2.0",
    ),
    (
        {"center": (0.0, 1.0 / cg.variable("a"), 0.0)},
        {"a": 0.0},
        "body 'rod': center must be (3,) finite numbers, got [0.0, inf, 0.0], where a = 0.0",
    ),
    (
        {"joint": Joint("revolute", damping="c")},
        {"c": -1.0},
        "body 'rod': damping must be finite and at least 0, got -1.0, where c = -1.0",
    ),
    ({"joint": Joint("free", stiffness="k")}, {"k": 1.0}, "body 'rod': a joint of the kind 'free' has no spring"),
    ({"center": ("a", 0.0)}, {"a": 1.0}, "body 'rod': center must be (3,) finite numbers, got"),
    ({"mass": "a b"}, {}, "the name of a parameter of body 'rod': mass must be without white space"),
    ({"mass": "m"}, {"m": 1.0, "n": 1.0}, "the mechanism has no body, joint or force that uses"),
    ({"mass": "m", "inertia": (0, 0, 0)}, {"m": 0.0}, "body 'rod' has no mass, carries no mass"),
]


@each_row(("fields", "parameters", "message"), BAD)
def test_a_parameter_that_cannot_be_is_refused(fields: Any, parameters: dict[str, float], message: str) -> None:
    with raises(ValueError, match=f"^{re.escape(message)}"):
        Mechanism([Body("rod", **(ROD | fields))], parameters=parameters)


def test_values_are_checked_wherever_they_are_bound() -> None:
    arm = pendulums()
    message = r"^body 'upper': mass must be finite and at least 0, got -1\.0 kg, where mass = -1\.0( of trajectory 1)?$"
    q, bad = np.zeros(2), {"mass": -1.0}
    for bind in (
        lambda: arm.bind(bad),
        lambda: dyn.simulate(arm, q, q, 0.1, parameters=bad),
        lambda: dyn.simulate_many(arm, q, q, 0.1, parameters={"mass": [1.0, -1.0]}),
        lambda: dyn.linearize(arm, q, q, parameters=bad),
        lambda: dyn.prune(arm, values=bad),
        lambda: replace(arm, parameters={**arm.parameters, **bad}),
    ):
        with raises(ValueError, match=message):
            bind()


def test_a_planar_arm_takes_them() -> None:
    numbers = dyn.planar_arm([1.5, 0.8], [1.2, 0.5], [0.1, 0.2])
    given = {"m": 1.5, "l": 0.5, "c": 0.1, "g": 9.81}
    arm = dyn.planar_arm(["m", 0.8], [1.2, cg.variable("l")], ["c", 0.2], gravity="g", parameters=given)
    assert same(dyn.forward_dynamics(arm.bind()), dyn.forward_dynamics(numbers))
    at = state(arm)
    assert near(values(dyn.forward_dynamics(arm), at), values(dyn.forward_dynamics(numbers), at))
    with raises(ValueError, match=r"^link 1: mass must be positive and finite, got -1\.0 kg$"):
        dyn.planar_arm(["m"], [1.0], parameters={"m": -1.0})
    with raises(ValueError, match="'link 1': mass has the parameter 'm', which needs a value"):
        dyn.planar_arm(["m"], [1.0])


def test_orientations_are_numbers() -> None:
    with raises(MechanismError, match="orientation must be"):
        Mechanism(
            [Body("a", Joint("revolute", orientation=from_quaternion([1, 0, 0, 0]).astype(object) * cg.variable("a")))]
        )


def test_damping_of_a_system_may_be_a_node() -> None:
    def make(damping: Any, **more: Any) -> dyn.System:
        return dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - q[0] ** 2, ["x"], damping=damping, **more)

    known, named = make(0.3), make(cg.variable("c"), parameters={"c": 0.3})
    runs = [dyn.simulate(model, [1.0], [0.0], 1.0, **PLAIN).q for model in (named, known)]
    assert runs[0] == approx(runs[1])
    with raises(ValueError, match="damping uses 'q0', which is no parameter"):
        make(cg.variable("q0"))
