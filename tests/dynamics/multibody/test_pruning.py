"""Pruning: what a scene does not need is not in its graph, and the account of it adds up."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph import structure_hash
from dynamics.equations.formulations.lagrange_terms import torques
from dynamics.equations.mass_matrix.accelerations import accelerations
from tests.dynamics.linkage_by_numpy import energies
from tests.dynamics.mechanisms import FAMILIES, random_inertia, random_rotation, turned_arm
from tests.dynamics.models import error, run
from tests.dynamics.multibody.test_reconfiguration import arm
from tests.dynamics.tree_in_digits import tree_in_digits
from tests.slow import slow
from tests.tolerances import EQUATIONS, SHORT_SUM

BOTH = (dyn.inverse_dynamics, dyn.forward_dynamics)
PAPER = dyn.scenes.load("triple_pendulum").model
AGREEMENT = 1e-11  # of the largest value: rounding of two codes

Equations = Callable[[Any], cg.Graph]


def nodes(graph: cg.Graph) -> int:
    return len(graph.nodes)


def at_random(graph: cg.Graph, seed: int = 0) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name: float(rng.uniform(-1.5, 1.5)) for name in graph.input_names}


def assert_alike(left: cg.Graph, right: cg.Graph) -> None:
    """The same outputs at ten states."""
    for seed in range(10):
        given = at_random(right, seed)
        expected = np.array(list(right.evaluate(given).values()))
        found = np.array(list(left.evaluate({name: given[name] for name in left.input_names}).values()))
        assert found == approx(expected, abs=AGREEMENT * max(1.0, np.abs(expected).max()))


def in_planes(seed: int) -> dyn.Mechanism:
    """A tree of hinges and slides, most along one axis, some against it, some across; gravity any, along, or none."""
    rng = np.random.default_rng(seed)
    bodies: list[dyn.Body] = []
    for i in range(6):
        axis = ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))[int(rng.integers(0, 3 + (i > 3)))]
        kind = "prismatic" if rng.random() < 0.3 else "revolute"
        first = random_rotation(rng) if i == 0 else np.eye(3)
        joint = dyn.Joint(kind, axis, 0.4 * rng.normal(size=3), first, armature=0.1)
        parent = f"b{rng.integers(max(0, i - 2), i)}" if i else "world"
        bodies.append(dyn.Body(f"b{i}", joint, parent, rng.uniform(0.5, 2.0), 0.2 * rng.normal(size=3),
                               random_inertia(rng)))  # fmt: skip
    along = 9.81 * np.asarray(bodies[0].joint.orientation)[:, 2]
    return dyn.Mechanism(bodies, (rng.normal(size=3), along, np.zeros(3))[seed % 3])


@mark.parametrize("seed", [*range(3), *slow(*range(3, 18))])
@mark.parametrize("regrouped", [False, True])
def test_the_lagrangian_is_the_energy_in_the_world_s_axes(seed: int, regrouped: bool) -> None:
    mechanism = replace(in_planes(seed), base_parameters=regrouped)
    system = mechanism.system
    graph = cg.Graph([*system.q, *system.qd], {"L": system.lagrangian})
    energy = dyn.energy(mechanism)
    for each in range(3):
        state = at_random(graph, each)
        kinetic, potential = energies(mechanism, *np.reshape([*state.values()], (2, -1)))
        scale = abs(kinetic) + abs(potential)
        assert graph.evaluate(state)["L"] == approx(kinetic - potential, abs=AGREEMENT * scale)
        assert energy.evaluate(state)["E"] == approx(kinetic + potential, abs=AGREEMENT * scale)


@mark.parametrize("family", ["mixed", "welded", *slow("serial", "branched")])
@mark.parametrize("equations", BOTH)
def test_regrouped_inertia_moves_alike_in_no_more_nodes(family: str, equations: Equations) -> None:
    mechanism = FAMILIES[family](5)
    whole, pruned = equations(mechanism), dyn.prune(mechanism, equations, regroup=True)
    assert_alike(pruned.graph, whole)
    assert nodes(pruned.graph) <= nodes(whole)
    kept = dyn.prune(mechanism, equations)
    assert structure_hash(kept.graph) == structure_hash(whole)
    assert sum(each.nodes for each in kept.remains) == nodes(kept.graph) - nodes(pruned.graph)


@mark.parametrize("n", [10, *slow(40)])
def test_by_default_pruning_costs_no_digit(n: int) -> None:
    """Nothing is switched off, so the graph is that of the model; regrouped, it has lost some."""
    rng = np.random.default_rng(n)
    model = dyn.planar_arm(rng.uniform(0.5, 1.5, n).tolist(), rng.uniform(0.5, 1.5, n).tolist())
    q, qd, tau = rng.uniform(-3.0, 3.0, n), rng.normal(size=n), 5.0 * rng.normal(size=n)
    exact = tree_in_digits(model, q, qd, tau, tau)["accelerations"]
    kept, regrouped = (dyn.prune(model, dyn.forward_dynamics, regroup=each).graph for each in (False, True))
    assert structure_hash(dyn.prune(model, dyn.forward_dynamics).graph) == structure_hash(kept)
    errors = [error(run(graph, {"q": q, "qd": qd, "tau": tau}), exact) for graph in (kept, regrouped)]
    assert errors[0] < SHORT_SUM
    assert errors[0] < errors[1]


def test_what_regrouping_saves() -> None:
    """Seven numbers of a body in place of ten; in a plane two in place of three. No mass, where all joints turn.

    Inverse dynamics has them so inside.
    """
    counts = {name: [(nodes(each(model)), nodes(dyn.prune(model, each, regroup=True).graph)) for each in BOTH]
              for name, model in (("paper", PAPER), ("arm of 7", turned_arm(7)))}  # fmt: skip
    assert counts == {"paper": [(97, 97), (160, 141)], "arm of 7": [(774, 774), (1427, 1427)]}
    assert all(link.mass == 0.0 for link in replace(turned_arm(7), base_parameters=True).links)


@mark.parametrize("model", [PAPER, arm(3), turned_arm(3)], ids=["paper", "arm", "turned arm"])
@mark.parametrize("equations", BOTH)
def test_without_gravity_and_damping_the_kinetic_energy_is_all(model: Any, equations: Equations) -> None:
    """No more nodes than from a Lagrangian that is the kinetic energy alone."""
    system = model.system
    kinetic = dyn.System(lambda q, qd, t: system.kinetic, system.coordinates)
    by_hand = cg.simplify(torques(kinetic)) if equations is BOTH[0] else accelerations(kinetic)  # as written
    pruned = dyn.prune(model, equations, effects=["springs"])
    if equations is BOTH[0]:
        assert nodes(pruned.graph) <= nodes(by_hand)
    else:  # the bias that bodies give themselves takes fewer
        assert nodes(pruned.graph) < nodes(by_hand)
    assert_alike(pruned.graph, by_hand)
    assert not {"potential", "damping"} & {tag for node in pruned.graph.nodes for tag in node.tags}


def test_without_gravity_the_base_s_angle_is_gone() -> None:
    """The paper's arm by the chain rule: 109 nodes, where a Lagrangian in angles from the vertical has 158."""
    counts = [nodes(dyn.prune(PAPER, each, effects=[]).graph) for each in BOTH]
    regrouped = [nodes(dyn.prune(PAPER, each, effects=[], regroup=True).graph) for each in BOTH]
    assert (counts, regrouped) == ([70, 104], [70, 91])
    graph = dyn.prune(PAPER, effects=[], regroup=True).graph
    assert "q0" not in {node.name for node in graph.nodes}
    assert_alike(graph, dyn.prune(PAPER, effects=[]).graph)


@mark.parametrize(
    ("model", "found", "hand", "ready"),
    [(PAPER, 16, 19, 16), (arm(3), 88, 88, 86), (turned_arm(4), 51, 52, 51)],
    ids=["paper", "arm", "turned arm"],
)
def test_at_rest_the_gravity_force_is_all(model: Any, found: int, hand: int, ready: int) -> None:
    """tau at qd = qdd = 0, of springs and gravity, is -dL/dq of the Lagrangian at rest, node for node.

    Of base numbers it takes fewer, but for what constants the weight of the whole arm takes.
    """
    pruned = dyn.prune(model, values={"qd": 0.0, "qdd": 0.0})
    system = model.system
    rest = cg.specialize(
        cg.Graph([*system.q, *system.qd], {"L": system.lagrangian}), {qd.name: 0.0 for qd in system.qd}
    )
    slopes = cg.gradient(rest).outputs.values()
    by_hand = cg.simplify(cg.Graph(system.q, {f"tau{i}": -slope for i, slope in enumerate(slopes)}))
    assert (nodes(pruned.graph), nodes(by_hand)) == (found, hand)
    assert nodes(dyn.gravity_force(model)) == ready <= found + 1
    assert_alike(pruned.graph, by_hand)
    assert pruned.graph.input_names == tuple(q.name for q in system.q)


def test_each_effect_that_a_joint_has_not_leaves_no_node() -> None:
    """Of one joint with an effect and two without, the nodes are those of the one."""
    base = dyn.prune(arm(3), effects=["gravity"])
    for number in ("damping", "stiffness", "armature"):
        bodies = [replace(body, joint=replace(body.joint, damping=0.0)) for body in arm(3).bodies]
        bodies[1] = replace(bodies[1], joint=replace(bodies[1].joint, **{number: 0.3}))
        grown = nodes(dyn.inverse_dynamics(dyn.Mechanism(bodies))) - nodes(base.graph)
        assert grown == 3  # a constant, a product and a sum


def test_a_constant_mass_matrix_is_factored_once_and_for_all() -> None:
    """Four slides one on the other: no product but the springs', and a division for each mass but one of 1 kg."""
    slides = dyn.Mechanism([
        dyn.Body(f"b{i}", dyn.Joint("prismatic", (1, 0, 0), stiffness=2.0), f"b{i - 1}" if i else "world", mass=1.0 + i)
        for i in range(4)
    ])  # fmt: skip
    counts = dyn.forward_dynamics(slides).counts()
    assert counts.by_operation == {"variable": 8, "add": 4, "sub": 6, "constant": 4, "mul": 4, "div": 3}


def test_bodies_without_mass_and_welds_leave_nothing() -> None:
    bare = turned_arm(3)
    frames = [dyn.Body("flange", dyn.Joint("fixed", position=(0.0, 0.1, 0.0)), "link 3"), dyn.Body("sensor",
              dyn.Joint("fixed", position=(0.2, 0.0, 0.0)), "flange")]  # fmt: skip
    framed = dyn.Mechanism([*bare.bodies, *frames])
    for equations in BOTH:
        assert structure_hash(equations(framed)) == structure_hash(equations(bare))
    cross = dyn.Body("cross", dyn.Joint("revolute", (1.0, 0.0, 0.0)), "link 3")
    tool = dyn.Body("tool", dyn.Joint("revolute", (0.0, 1.0, 0.0)), "cross", 0.5, (0.0, 0.0, 0.2), (0.01, 0.01, 0.01))
    wrist = dyn.Mechanism([*bare.bodies, cross, tool])
    assert "cross" not in {tag for node in wrist.system.partial_lagrangians[3].args for tag in node.tags}
    rows = {each.what: each for each in dyn.prune(wrist).absent}
    assert rows["mass of cross"].nodes > 0


def test_a_locked_joint_leaves_the_shorter_arm_s_nodes() -> None:
    """Of ten links, the last, one in the middle, and the first: as many as the arm of nine has, within 1.03."""
    for equations, ten, nine, middle, first in ((BOTH[0], 1616, 1433, 1437, 1431), (BOTH[1], 4234, 3666, 3772, 3747)):
        counts = [nodes(dyn.prune(arm(10), equations, lock={f"link {k}": 0.3}).graph) for k in (10, 5, 1)]
        assert (nodes(equations(arm(10))), nodes(equations(arm(9)))) == (ten, nine)
        assert counts == [nine, middle, first]
        assert max(middle, first) <= 1.03 * nine


def test_the_account_adds_up() -> None:
    push = dyn.Force("link 3", (1.0, "push", 0.0))
    bodies = [replace(body, joint=replace(body.joint, armature=0.1, stiffness=2.0)) for body in arm(4).bodies]
    model = dyn.Mechanism(bodies, forces=[push], parameters={"push": 2.0})
    asked = {"lock": {"link 4": 0.2}, "values": {"qd": 0.0}, "outputs": ["tau1"]}
    pruned = dyn.prune(model, effects=[], regroup=True, **asked)
    assert [each.what for each in pruned.omitted] == [
        "gravity", "damping", "springs", "armature", "forces", "joint of link 4", "input qd", "other outputs",
        "unobservable inertial numbers"]  # fmt: skip
    assert all(each.nodes > 0 and each.edges > 0 for each in pruned.omitted)
    assert sum(each.nodes for each in pruned.omitted) == nodes(pruned.full) - nodes(pruned.graph)
    assert sum(each.edges for each in pruned.omitted) == len(pruned.full.edges) - len(pruned.graph.edges)
    assert list(pruned.graph.outputs) == ["tau1"]
    assert nodes(pruned.full) == nodes(dyn.inverse_dynamics(model))
    assert pruned.absent == ()  # what was switched off has its row above
    bare = replace(
        model,
        bodies=[replace(body, joint=replace(body.joint, armature=0, stiffness=0, damping=0)) for body in bodies],
        gravity=(0, 0, 0),
        forces=(),
        parameters={},
    )
    never = dyn.prune(bare, regroup=True, **asked)
    assert [each.what for each in never.absent] == [
        "gravity", "damping of link 1, link 2, link 3", "springs of link 1, link 2, link 3",
        "armature of link 1, link 2, link 3"]  # fmt: skip
    assert [each.nodes for each in never.absent] == [19, 0, 3, 3]  # where nothing moves, damping is nothing
    text = str(pruned)
    assert "damping: switched off (" in text
    assert f"{nodes(pruned.graph)} nodes" in text


def test_what_is_locked_and_bound_computes_the_rest_as_before() -> None:
    model = arm(4)
    pruned = dyn.prune(model, lock={"link 4": 0.2}, values={"qd": 0.0, "qdd1": 0.5}, outputs=["tau2", "tau0"])
    given = at_random(pruned.graph) | {f"qd{i}": 0.0 for i in range(3)} | {"qdd1": 0.5}
    full = dyn.inverse_dynamics(model).evaluate(given | {"q3": 0.2, "qd3": 0.0, "qdd3": 0.0})
    found = pruned.graph.evaluate({name: given[name] for name in pruned.graph.input_names})
    assert found == {name: approx(full[name], rel=EQUATIONS) for name in ("tau2", "tau0")}


def test_damping_and_forces_of_any_lagrangian_can_be_left_out() -> None:
    system = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"],
                        forces=lambda q, qd, t: [cg.sin(t)], damping=0.3)  # fmt: skip
    whole = ["gravity", "springs", "armature"]
    pruned = dyn.prune(system, dyn.forward_dynamics, effects=whole)
    assert [each.what for each in pruned.omitted] == ["damping", "forces"]
    assert pruned.graph.evaluate({"q0": 0.5, "qd0": 1.0, "tau0": 3.0}) == {"qdd0": approx(1.0)}
    kept = dyn.prune(system, dyn.forward_dynamics, effects=[*whole, "forces"]).graph
    assert kept.evaluate({"q0": 0.5, "qd0": 1.0, "tau0": 3.0, "t": 0.7}) == {"qdd0": approx(1.0 + np.sin(0.7))}
    with raises(ValueError, match="gravity cannot be told apart"):
        dyn.prune(system, effects=[])


def test_wrong_use() -> None:
    with raises(ValueError, match="effects are gravity, damping, springs, armature, forces, got 'friction'"):
        dyn.prune(PAPER, effects=["friction"])
    with raises(ValueError, match="can be locked of a Mechanism, got System"):
        dyn.prune(dyn.scenes.load("spring_mass"), lock={"rotor": 0.0})
    with raises(dyn.MechanismError, match="there is no body 'nobody'"):
        dyn.prune(arm(2), lock={"nobody": 0.0})
    with raises(cg.GraphError, match="no input 'w'"):
        dyn.prune(PAPER, values={"w": 1.0})
    with raises(cg.GraphError, match="no output g"):
        dyn.prune(PAPER, outputs=["g"])


@mark.parametrize("effect", ["gravity", "damping", "springs", "armature"])
def test_what_was_switched_off_is_not_said_to_be_missing(effect: str) -> None:
    """A tree in which one joint alone has each effect: of the others it is absent, as before the switch."""
    first, *others = dyn.tree([-1, 0, 1]).bodies
    first = replace(first, joint=replace(first.joint, damping=0.1, stiffness=2.0, armature=0.3))
    model = dyn.Mechanism([first, *others])
    pruned = dyn.prune(model, effects=[each for each in dyn.EFFECTS if each != effect])
    assert (pruned.omitted[0].what, pruned.omitted[0].why) == (effect, "switched off")
    rows = {each.what: each.nodes for each in pruned.absent}
    assert list(rows) == [f"{each} of link 2, link 3" for each in ("damping", "springs", "armature")]
    if effect == "springs":  # counted at those two joints alone: one more number, and k (q - 0) in two torques
        bodies = [first, *(replace(each, joint=replace(each.joint, stiffness=0.3)) for each in others)]
        with_springs = dyn.Mechanism([replace(first, joint=replace(first.joint, stiffness=0.0)), *bodies[1:]])
        assert rows["springs of link 2, link 3"] == nodes(dyn.inverse_dynamics(with_springs)) - nodes(
            dyn.inverse_dynamics(dyn.Mechanism([replace(first, joint=replace(first.joint, stiffness=0.0)), *others]))
        )
