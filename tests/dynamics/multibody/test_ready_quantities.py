"""Frames and the whole of random trees: against MuJoCo, against differences, and by what is conserved."""

from dataclasses import replace

import numpy as np
from pytest import importorskip, mark, raises

import cgraph as cg
import dynamics as dyn
from tests.dynamics.models import Array
from tests.dynamics.multibody.test_ball_and_free import near, random_tree
from tests.slow import slow
from tests.tolerances import CONDITIONED, EQUATIONS, LONG_SUM

STEP = 1e-6  # s, of central differences along the motion
POINT = (0.3, -0.2, 0.5)
BASES = ["free", "ball", "free (body axes)", "revolute"]
SEEDS = [*range(2), *slow(*range(2, 200))]


def state(mechanism: dyn.Mechanism, seed: int) -> dict[str, Array]:
    rng, system = np.random.default_rng(seed), mechanism.system
    return {"q": rng.normal(size=system.nq), "qd": rng.normal(size=system.n), "qdd": rng.normal(size=system.n)}


def moved(mechanism: dyn.Mechanism, at: dict[str, Array], h: float) -> dict[str, Array]:
    """The state h later, to second order, at constant qdd."""
    system = mechanism.system
    graph = cg.Graph([*system.q, *system.qd], {f"r{i}": x for i, x in enumerate(system.q_dot)})

    def rate(q: Array, qd: Array) -> Array:
        return dyn.arrays_at(mechanism, graph, q, qd)["r"]

    middle = at["qd"] + 0.5 * h * at["qdd"]
    halfway = at["q"] + 0.5 * h * rate(at["q"], at["qd"])
    return {"q": at["q"] + h * rate(halfway, middle), "qd": at["qd"] + h * at["qdd"]}


def slope(values: list[Array]) -> Array:
    return (values[1] - values[0]) / (2.0 * STEP)


@mark.parametrize("base", BASES)
@mark.parametrize("axes", ["world", "body"])
def test_a_frame_s_quantities_are_rates_of_one_another(base: str, axes: str) -> None:
    mechanism = random_tree(5, base)
    at, body = state(mechanism, 1), mechanism.bodies[-1].name
    frame = (mechanism, body, POINT)
    ahead = [moved(mechanism, at, h) for h in (-STEP, STEP)]
    velocity, jacobian = dyn.frame_velocity(*frame, axes), dyn.frame_jacobian(*frame, axes)
    now = {name: dyn.arrays_at(mechanism, graph, **at) for name, graph in (
        ("placed", dyn.frame_placement(*frame)), ("velocity", velocity), ("jacobian", jacobian),
        ("rate", dyn.frame_jacobian_rate(*frame, axes)), ("bias", dyn.frame_bias_acceleration(*frame, axes)),
        ("acceleration", dyn.frame_acceleration(*frame, axes)))}  # fmt: skip
    v, j, rate = now["velocity"]["V"], now["jacobian"]["J"], now["rate"]["Jdot"]
    assert j.shape == rate.shape == (6, mechanism.system.n)
    assert near(j @ at["qd"], v)
    assert near(rate @ at["qd"], now["bias"]["a"])
    assert near(j @ at["qdd"] + now["bias"]["a"], now["acceleration"]["a"])
    turn = now["placed"]["R"]
    assert np.abs(turn @ turn.T - np.eye(3)).max() < LONG_SUM
    placed = [dyn.arrays_at(mechanism, dyn.frame_placement(*frame), each["q"]) for each in ahead]
    spin = slope([each["R"] for each in placed]) @ turn.T
    twist = np.array([*slope([each["p"] for each in placed]), spin[2, 1], spin[0, 2], spin[1, 0]])
    in_world = np.concatenate([turn @ v[:3], turn @ v[3:]]) if axes == "body" else v
    assert np.abs(twist - in_world).max() < CONDITIONED * np.abs(v).max()
    for graph, name, derivative in ((velocity, "V", now["acceleration"]["a"]), (jacobian, "J", rate)):
        difference = slope([dyn.arrays_at(mechanism, graph, **each)[name] for each in ahead])
        assert np.abs(difference - derivative).max() < CONDITIONED * max(np.abs(derivative).max(), 1.0)


@mark.parametrize("seed", SEEDS)
def test_mujoco_finds_the_same(seed: int) -> None:
    mujoco = importorskip("mujoco")
    from tests.bench.peers.mujoco import MujocoPeer
    from tests.bench.peers.peer import PeerModel

    mechanism = random_tree(300 + seed)
    at, n = state(mechanism, seed), mechanism.system.n
    peer = MujocoPeer(PeerModel("tree", mechanism))
    model, data = peer.twin.model, peer.twin.data
    data.qpos[:], data.qvel[:] = at["q"][peer.q_at], at["qd"][peer.at]
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    name = mechanism.bodies[-1].name
    number = model.body(name).id
    placed = dyn.arrays_at(mechanism, dyn.frame_placement(mechanism, name, POINT), at["q"])
    turn = data.xmat[number].reshape(3, 3)
    point = data.xpos[number] + turn @ POINT
    assert near(placed["R"], turn)
    assert near(placed["p"], point)
    theirs = {"J": np.zeros((6, n)), "Jdot": np.zeros((6, n))}
    mujoco.mj_jac(model, data, theirs["J"][:3], theirs["J"][3:], point, number)
    mujoco.mj_jacDot(model, data, theirs["Jdot"][:3], theirs["Jdot"][3:], point, number)
    for graph, key in ((dyn.frame_jacobian, "J"), (dyn.frame_jacobian_rate, "Jdot")):
        ours = dyn.arrays_at(mechanism, graph(mechanism, name, POINT), at["q"], at["qd"])[key]
        assert near(ours, theirs[key][:, peer.order])
    center = dyn.arrays_at(mechanism, dyn.center_of_mass(mechanism), at["q"], at["qd"])
    assert near(center["c"], data.subtree_com[0])
    assert near(center["v"], data.subtree_linvel[0])
    of_center = np.zeros((3, n))
    mujoco.mj_jacSubtreeCom(model, data, of_center, 0)
    ours = dyn.arrays_at(mechanism, dyn.center_of_mass_jacobian(mechanism), at["q"])["J"]
    assert near(ours, of_center[:, peer.order])
    momentum = dyn.arrays_at(mechanism, dyn.spatial_momentum(mechanism, "center of mass"), at["q"], at["qd"])["h"]
    assert near(momentum[:3], sum([body.mass for body in mechanism.bodies]) * data.subtree_linvel[0])
    assert near(momentum[3:], data.subtree_angmom[0])


@mark.parametrize("base", ["free", "free (body axes)"])
def test_momentum_of_a_free_tree_changes_by_weight_alone(base: str) -> None:
    """dp/dt = m g and dL/dt = c x m g, whatever the joints do inside; about the center of mass L is constant."""
    tree = random_tree(10, base)
    bodies = [replace(body, joint=replace(body.joint, armature=0.0, damping=0.0)) for body in tree.bodies]
    mechanism = dyn.Mechanism(bodies, tree.gravity)
    at = state(mechanism, 3)
    tau = np.random.default_rng(4).normal(size=mechanism.system.n)
    tau[:6] = 0.0  # of the base
    at["qdd"] = dyn.arrays_at(mechanism, dyn.forward_dynamics(mechanism), at["q"], at["qd"], tau=tau)["qdd"]
    ahead = [moved(mechanism, at, h) for h in (-STEP, STEP)]
    weight = sum([body.mass for body in bodies]) * np.asarray(mechanism.gravity)
    center = dyn.arrays_at(mechanism, dyn.center_of_mass(mechanism), at["q"])["c"]
    for about, torque in (("origin", np.cross(center, weight)), ("center of mass", np.zeros(3))):
        graph = dyn.spatial_momentum(mechanism, about)
        rate = slope([dyn.arrays_at(mechanism, graph, **each)["h"] for each in ahead])
        size = np.abs(at["qdd"]).max() + np.abs(weight).max()
        assert np.abs(rate - [*weight, *torque]).max() < CONDITIONED * size


@mark.parametrize("base", BASES)
def test_kinetic_and_potential_energy_are_the_energy(base: str) -> None:
    mechanism = random_tree(6, base)
    at = state(mechanism, 2)
    total, kinetic, potential = (
        dyn.arrays_at(mechanism, graph(mechanism), at["q"], at["qd"])
        for graph in (dyn.energy, dyn.kinetic_energy, dyn.potential_energy)
    )
    assert abs(kinetic["K"] + potential["P"] - total["E"]) < EQUATIONS * abs(total["E"])
    mass = dyn.arrays_at(mechanism, dyn.mass_matrix(mechanism), at["q"])["M"]
    assert abs(kinetic["K"] - 0.5 * at["qd"] @ mass @ at["qd"]) < EQUATIONS * kinetic["K"]
    loose = [replace(body, joint=replace(body.joint, stiffness=0.0)) for body in mechanism.bodies]
    unsprung = dyn.Mechanism(loose, mechanism.gravity)
    height = dyn.arrays_at(unsprung, dyn.potential_energy(unsprung), at["q"])["P"]
    weight = sum([body.mass for body in mechanism.bodies]) * np.asarray(mechanism.gravity)
    center = dyn.arrays_at(mechanism, dyn.center_of_mass(mechanism), at["q"])["c"]
    assert abs(height + weight @ center) < EQUATIONS * abs(height)


def test_terms_of_a_lagrangian_that_are_linear_in_velocities_are_no_energy() -> None:
    system = dyn.System(lambda q, qd, t: 0.5 * (qd[0] + 3.0 * q[1]) ** 2 + 0.5 * qd[1] ** 2 + 2.0 * qd[1], ["x", "y"])
    at = {"q": [0.4, 0.7], "qd": [1.1, -0.6]}
    energies = dyn.arrays_at(system, dyn.energy(system), **at) | dyn.arrays_at(system, dyn.kinetic_energy(system), **at)
    energies |= dyn.arrays_at(system, dyn.potential_energy(system), **at)
    assert abs(energies["K"] - 0.5 * (1.1**2 + 0.6**2)) < EQUATIONS
    assert abs(energies["P"] + 0.5 * (3.0 * 0.7) ** 2) < EQUATIONS
    assert abs(energies["K"] + energies["P"] - energies["E"]) < EQUATIONS


def test_base_parameters_move_no_mass_in_space() -> None:
    plain = random_tree(6, "revolute")
    regrouped = replace(plain, base_parameters=True)
    at = state(plain, 5)
    for graph in (dyn.center_of_mass, dyn.center_of_mass_jacobian, dyn.spatial_momentum):
        ours, theirs = (dyn.arrays_at(each, graph(each), at["q"], at["qd"]) for each in (regrouped, plain))
        assert all(near(ours[name], theirs[name]) for name in theirs)


def test_arrays_have_the_shape_that_names_of_outputs_say() -> None:
    arm = random_tree(1, "revolute")
    n = arm.system.n
    states = np.random.default_rng(0).normal(size=(7, n + arm.system.nq))
    q, qd = states[:, : arm.system.nq], states[:, arm.system.nq :]
    many = dyn.arrays_at(arm, dyn.frame_jacobian(arm, "b0"), q, qd)
    assert many["J"].shape == (7, 6, n)
    one = dyn.arrays_at(arm, dyn.frame_jacobian(arm, "b0"), q[3], qd[3])
    assert np.array_equal(many["J"][3], one["J"])
    linear = dyn.arrays_at(arm, dyn.state_space(arm), q[0], qd[0])
    assert {name: each.shape for name, each in linear.items()} == {"A": (2 * n, 2 * n), "B": (2 * n, n)}
    assert dyn.arrays_at(arm, dyn.forward_dynamics(arm, check=True), q, qd)["info"].shape == (7,)
    assert dyn.arrays_at(arm, arm.motion("b0"), q, qd)["R"].shape == (7, 3, 3)


def test_what_is_wrong_is_said() -> None:
    arm = random_tree(1, "revolute")
    with raises(dyn.MechanismError, match="there is no body 'hand'"):
        dyn.frame_velocity(arm, "hand")
    with raises(dyn.MechanismError, match=r"the point of body 'b0': at must be \(3,\) finite numbers"):
        dyn.frame_jacobian(arm, "b0", (0.0, 1.0))
    with raises(dyn.MechanismError, match="takes rigid bodies"):
        dyn.center_of_mass(dyn.System(lambda q, qd, t: qd[0] ** 2, ["x"]))  # type: ignore[arg-type]
    rotor = dyn.Mechanism([dyn.Body("rotor", dyn.Joint("revolute", armature=1.0))])
    with raises(dyn.MechanismError, match="needs mass that moves"):
        dyn.center_of_mass(rotor)
    with raises(ValueError, match="has the input 'q1', which is no state"):
        dyn.arrays_at(rotor, dyn.energy(random_tree(2, "free")))
