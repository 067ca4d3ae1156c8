"""What there is to inspect in a scene, and where its joints are."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from cgraph import Graph
from dynamics.multibody.trees.joint_positions import skeleton
from dynamics.scenes.scenes import Scene
from tests.each_row import each_row
from tests.early_end import stops
from tests.sources import ROOT
from tests.tolerances import EQUATIONS
from viz.models.inspection import DT, FORMULATIONS, Inspection, carried, inspection

ARM = cache(lambda: inspection(dyn.scenes.load("triple_pendulum")))
INTEGRATED = 1e-9  # N m: the state is one that the equations hold at, whatever the error of the motion


def values_of(found: Inspection, graph: Graph) -> dict[str, Any]:
    """The inputs of a version along the motion, derived ones too."""
    known = dict(found.at)
    if found.derived is not None:
        known |= found.derived.evaluate({name: known[name] for name in found.derived.input_names})
    return {name: known[name] for name in graph.input_names}


def test_the_free_motion_takes_no_torque_by_the_chain_rule_alone():
    found = ARM()
    assert tuple(found.versions)[:4] == FORMULATIONS
    wrong = []
    for each in [found.versions[name] for name in FORMULATIONS]:
        tau = np.stack(list(each.graph.evaluate(values_of(found, each.graph)).values()))
        wrong.append(np.abs(tau).max())
        assert bool(each.marked) == (wrong[-1] > INTEGRATED)
        assert ("Spurious: " in each.about) == bool(each.marked)
    assert wrong[0] > 1.0
    assert max(wrong[2:]) < INTEGRATED


def test_the_embedded_step_ends_in_the_state_of_the_others():
    found = ARM()
    at = values_of(found, found.versions["by_definition"].graph)
    for i in range(3):
        qd = at[f"qd{i}_old"] + DT * at[f"qdd{i}"]
        assert np.allclose(qd, found.at[f"qd{i}"], rtol=0, atol=EQUATIONS)
        assert np.allclose(at[f"q{i}_old"] + DT * qd, found.at[f"q{i}"], rtol=0, atol=EQUATIONS)


def test_shares_of_the_torque_add_up():
    found = ARM()
    parts, graph = found.shares.header, found.shares.graph
    assert parts == ("link 1", "link 2", "link 3", "damping", "all")
    values = graph.evaluate(values_of(found, graph))
    shares = np.array(
        [
            [np.broadcast_to(values[name], found.motion.t.shape) for name in found.shares.rows[f"tau{i}"]]
            for i in range(3)
        ]
    )
    assert np.abs(shares[:, :-1].sum(axis=1) - shares[:, -1]).max() < EQUATIONS
    assert np.abs(shares[:, 3, 0]).max() < EQUATIONS  # no damping at rest
    assert np.abs(shares[1:, 0]).max() < EQUATIONS  # the first link does not load the others' joints


def test_forward_dynamics_and_a_system_without_places():
    found = inspection(dyn.scenes.load("spring_mass"), t_end=np.pi)
    version = found.versions["forward dynamics"]
    assert found.motion.points is found.shares is None
    qdd = version.graph.evaluate(values_of(found, version.graph))["qdd0"]
    assert np.allclose(qdd, -np.cos(found.motion.t), atol=1e-5)  # I = k = 1, let go at 1


@each_row("name", ["spring_mass", "triple_pendulum"])
def test_both_forms_are_in_one_state_of_coordinates_and_momenta(name):
    scene = dyn.scenes.load(name)
    found = inspection(scene, t_end=0.3)
    hamilton, lagrange = [each for each in found.versions.values() if each.group == "momentum"]
    n = scene.system.n
    assert {f"p{i}" for i in range(n)} <= found.derived.outputs.keys()
    rates, expected = (each.graph.evaluate(values_of(found, each.graph)) for each in (hamilton, lagrange))
    for i in range(n):
        moved = np.gradient(found.at[f"q{i}"], found.motion.t, edge_order=2)
        assert np.allclose(rates[f"q{i}_dot"], expected[f"q{i}_dot"], rtol=EQUATIONS, atol=EQUATIONS)
        assert np.allclose(rates[f"q{i}_dot"], moved, atol=0.05 * np.abs(moved).max())
    rows = [*hamilton.rows]
    assert rows == [*lagrange.rows] == ["of positions", "bias", "eliminated", "back out", "rates"]
    for each in (hamilton, lagrange):  # every node stands in one row, on what it is made of
        at = {node: k for k, nodes in enumerate(each.rows.values()) for node in nodes}
        assert sum(map(len, each.rows.values())) == len(at) == len(each.graph.nodes)
        assert all(at[edge.source] <= at[edge.target] for edge in each.graph.edges)
    assert not hamilton.rows["bias"]
    assert not lagrange.rows["rates"]
    assert sorted(step.joint for step in hamilton.steps) == sorted(3 * [*range(n)])


def test_joints_of_a_planar_arm_are_a_link_apart():
    q = np.random.default_rng(0).uniform(-3, 3, (5, 3))
    points, parents, graph, joints, turns, *_ = skeleton(dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]), q)
    assert joints == (0, 1, 2)
    assert turns == (1, 1, 1)
    again = graph.evaluate({f"q{i}": q[:, i] for i in range(3)})
    assert np.stack(list(again.values()), axis=1) == pytest.approx(points[..., :].reshape(5, -1))
    assert parents == (-1, 0, 1, 2)
    assert np.linalg.norm(np.diff(points, axis=1), axis=2) == pytest.approx(np.tile([1.0, 0.8, 0.7], (5, 1)))
    assert points[:, 1] == pytest.approx(np.stack([np.sin(q[:, 0]), -np.cos(q[:, 0])], axis=1))


def test_contacts_are_seen_where_they_touch():
    """Spheres and planes, of the world and of bodies that move, each once; in the picture at any state, too."""
    balls = [dyn.Body(name, dyn.Joint("free"), mass=1.0, inertia=(1.0, 1.0, 1.0)) for name in "ab"]
    tray = dyn.Body("tray", dyn.Joint("revolute", axis=(0.0, 1.0, 0.0)), mass=1.0, inertia=(1.0, 1.0, 1.0))
    floor = {"to_at": (7.0, 0.0, -0.5), "radius": 0.2, "stiffness": "k"}
    contacts = [
        dyn.Contact("a", **floor),
        dyn.Contact("b", **floor | {"to_at": (0.0, 3.0, -0.5)}),
        dyn.Contact("a", "b", radius=0.2, to_radius=0.2, stiffness=1.0),
        dyn.Contact("a", "tray", at=(0.1, 0.0, 0.0), normal=(0.0, 0.0, 2.0), stiffness=1.0),
    ]
    model = dyn.Mechanism([*balls, tray], forces=contacts, parameters={"k": 1.0})
    q = np.array([[0.5, 0.0, -0.3, 1.0, 0.0, 0.0, 0.0, 0.9, 0.0, -0.3, 1.0, 0.0, 0.0, 0.0, 0.25]] * 2)
    q[1, [2, 9]] += 0.1
    seen = skeleton(model.bind(), q)
    assert seen.radii == (0.2, 0.2, 0.0)
    (a, mark, b, _, c, _), floor_plane, tilted = np.split(seen.surfaces[0], [6, 9])
    assert [*a, *b, *c] == pytest.approx([0.5, -0.3, 0.9, -0.3, 0.6, -0.3])  # from the side, as all moves in a plane
    assert np.linalg.norm(mark - a) == pytest.approx(0.2 * np.sqrt(2.0 / 3.0))
    assert floor_plane.tolist() == [[0.0, -0.5], [1.0, -0.5], [0.0, -0.5]]
    assert tilted == pytest.approx(np.array([[0.0, 0.0], [np.cos(0.25), -np.sin(0.25)], [0.0, 0.0]]))
    again = seen.graph.evaluate({name: q[:, int(name[1:])] for name in seen.graph.input_names})
    places = np.stack([np.broadcast_to(each, 2) for each in again.values()], axis=1).reshape(2, -1, 2)
    assert places == pytest.approx(np.concatenate([seen.points, seen.surfaces], axis=1))


@each_row(("axis", "turns"), [((0, 1, 0), (-1,)), ((0, -1, 0), (1,)), ((1, 0, 0), (1,)), ((0, 0, 1), (1,))])
def test_a_joint_turns_the_picture_one_way_or_the_other(axis, turns):
    """About y, x goes to the right and z up, so that a positive turn is clockwise; the others as they are seen."""
    hinge = dyn.Joint("revolute", axis=axis)
    body = dyn.Body("a", hinge, mass=1.0, center=0.3 * (1.0 - np.abs(axis)), inertia=(0.1, 0.1, 0.1))
    model = dyn.Mechanism([body], gravity=(0.0, 0.0, 0.0))
    q = np.linspace(0.0, 1.0, 5)[:, None]
    found = skeleton(model, q)
    assert found.turns == turns
    slide = dyn.Mechanism([dyn.Body("a", dyn.Joint("prismatic", axis=(1, 0, 0)), mass=1.0)])
    assert skeleton(slide, q).turns == (0,)


@stops
def test_a_motion_that_does_not_begin_is_told():
    weightless = dyn.System(lambda q, qd, t, p: p["m"] * qd[0] ** 2 - q[0] ** 2, ["x"], {"m": 0.0})
    with pytest.raises(ValueError, match=r"accelerations that are not finite: the motion stopped at t = 0 s: "):
        inspection(Scene("weightless", "", weightless, (1.0,), (0.0,), 1.0))


def test_what_ad_of_the_energy_carries_is_counted_by_link_and_by_what_it_is() -> None:
    arm = dyn.scenes.load("triple_pendulum")
    table = carried(arm)
    assert table is not None
    counts = {
        row[0]: dict(zip(table.header[1:], [int(cell or 0) for cell in row[1:]], strict=True)) for row in table.rows
    }
    rates = next(head for head in table.header if "cancels" in head)
    text = (ROOT / "docs" / "explanation.md").read_text(encoding="utf-8")
    told = "Of the 139 that only the chain rule has, 49 are rates of\nslopes"
    assert told in text
    assert (counts["all"]["all"], counts["all"][rates]) == (139, 49)
    assert [counts[f"link {k}"][rates] for k in (1, 2, 3)] == [1, 26, 21]
    for row in counts.values():
        assert sum([count for head, count in row.items() if head != "all"]) == row["all"]
    for head in table.header[1:]:
        assert sum([row[head] for part, row in counts.items() if part != "all"]) == counts["all"][head]
    whole, lean = (len(dyn.inverse_dynamics(arm, name).nodes) for name in ("chain_rule", "newton_euler"))
    assert f"of its {whole}." in table.caption
    assert f"have {lean} nodes in all" in table.caption


def test_a_rotor_carries_nothing_that_cancels() -> None:
    assert carried(dyn.scenes.load("spring_mass")) is None
    content = inspection(dyn.scenes.load("spring_mass"), t_end=0.1)
    assert content.carried is None
