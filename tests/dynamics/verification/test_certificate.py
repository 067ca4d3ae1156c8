"""The certificate: it passes for what is right, finds what is wrong, and names the term that two models differ in."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
import dynamics as dyn
from cgraph.operations.operation import OPS
from dynamics.equations.constraints.constraints import multiplier_outputs
from dynamics.equations.mass_matrix import accelerations
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.io.write_mjcf import to_mjcf
from dynamics.systems.constraints import Constraints
from dynamics.verification import certificate
from dynamics.verification.certificate import certify
from dynamics.verification.held_states import Held, new_rows, random_states
from dynamics.verification.residual import ROUNDING, Certificate, Residual
from tests.dynamics.equations.test_constraints import moving_wall, pulleys, sleigh
from tests.dynamics.io.test_urdf import joint, link, robot
from tests.dynamics.linkages import bar, four_bar, peaucellier
from tests.dynamics.mechanisms import FAMILIES
from tests.dynamics.models import MODELS
from tests.dynamics.multibody.test_rolling import disk
from tests.dynamics.tilted_linkages import random_linkage
from tests.dynamics.units import Units, in_units
from tests.each_row import each_row
from viz import cli

FEW = 5  # states


def failed(found: Certificate) -> dict[str, str]:
    return {each.equation: each.note for each in found.residuals if not each.passed}


PASSING = {name: partial(dyn.scenes.load, name) for name in dyn.scenes.names()} | MODELS
PASSING |= {"welded": lambda: FAMILIES["welded"](5)}
FORCE = {"forces": [dyn.Force("b2", (1.0, 2.0, "f"))], "parameters": {"f": 3.0}}  # which peers are not asked for
PASSING |= {"pushed": lambda: replace(FAMILIES["serial"](3), **FORCE)}


@each_row("name", PASSING)
def test_every_scene_and_every_kind_of_model_passes(name: str) -> None:
    found = certify(PASSING[name](), FEW, speed=1.0 if name in dyn.scenes.names() else 0.5)
    assert failed(found) == {}
    assert len(found.residuals) >= 10
    assert str(found).count("ok  ") == len(found.residuals)


PAIRS = ({"b0": 1.0, "b1": 1.5}, {"b1": 1.0, "b2": 3.5})
ENDS: Any = {  # limits whose ends are the loops: of which side a state is, is rounding
    "forces": [dyn.JointLimit(pair, 0.0, 1.0, stiffness=1e4) for pair in PAIRS],
    "loops": [dyn.Loop("coupling", pair, coefficients=[0.0]) for pair in PAIRS],
}
HELD = {
    "ends": lambda: replace(FAMILIES["serial"](3), **ENDS),
    "four-bar": four_bar,
    "hinges": lambda: four_bar("hinge"),
    "blade": sleigh,
    "disk": disk,
    "wall": moving_wall,
    "rope": pulleys,
}


@pytest.mark.parametrize("name", HELD)
def test_every_kind_of_constraint_passes_and_a_wrong_one_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    model = HELD[name]()
    found = certify(model, 2)
    assert failed(found) == {}
    rows = [each for each in found.residuals if "constraints" in each.equation or "lambda" in each.equation]
    assert len(rows) == 5
    changes = Constraints.rate_changes
    monkeypatch.setattr(Constraints, "rate_changes", lambda *a: [1.001 * node + 0.001 for node in changes(*a)])
    assert set(failed(certify(model, 2))) >= {"constraints: J qdd + (dz/dt at qdd = 0) = 0, all rows"}
    monkeypatch.undo()
    monkeypatch.setattr(accelerations, "multiplier_outputs", lambda *a: scaled(multiplier_outputs(*a), 2.0))
    assert set(failed(certify(model, 2))) >= {"inverse dynamics of forward dynamics = tau + J^T lambda"}


def scaled(nodes: Mapping[str, cg.Node], factor: float) -> dict[str, cg.Node]:
    return {name: factor * node for name, node in nodes.items()}


def test_loops_are_those_of_pinocchio() -> None:
    pytest.importorskip("pinocchio")
    for model in (four_bar(), peaucellier()):
        found = certify(model, 3)
        assert [each.value < 1e-11 for each in found.residuals if "constraintDynamics" in each.equation] == [True]
        assert "inverse dynamics = Pinocchio's" in [each.equation for each in found.residuals]


@pytest.mark.filterwarnings("ignore::dynamics.ConstraintWarning")
@pytest.mark.parametrize("count", [2, pytest.param(150, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])])
def test_random_linkages_with_more_rows_than_they_need_pass(count: int) -> None:
    """Newton's method is drawn to singular positions of theirs; tilted, some are so everywhere, or held."""
    models = {}
    for k in range(count):
        models[f"{k} exact"], models[f"{k} tilted"], *_ = random_linkage(k)
    found = {}
    for name, model in models.items():
        with suppress(dyn.ConstraintError):  # tilted so far that its loops cannot be closed
            found[name] = certify(model, 3)
    assert {name: failed(each) for name, each in found.items() if not each.passed} == {}
    judged = [name for name, each in found.items() if any("linearization" in row.equation for row in each.residuals)]
    assert len(judged) > 0.9 * len(models)


def test_states_of_a_linkage_are_no_singular_positions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Peaucellier's linkage folds, long bar on long bar, at most states that Newton's method finds."""
    linkage = peaucellier()
    system = linkage.system
    folded, _ = nearest_state(system, [-1.3, -1.4, -1.3, 4.9, 4.5, -0.2, -0.2], [0.0] * 7)
    assert abs(math.remainder(folded[0] - folded[2], 2.0 * math.pi)) < 1e-12
    assert new_rows(system, folded, 0.0) == 0.0
    for seed in range(3):
        states = random_states(system, 5, 0.0, 1.0, np.random.default_rng(seed))
        assert min(new_rows(system, q, 0.0) for q in states["q"]) > 0.02
    assert failed(certify(linkage, 3)) == {}
    right = dyn.state_space(system)
    wrong = cg.Graph(right.inputs, scaled(right.outputs, 1.0 + 1e-6))
    monkeypatch.setattr(certificate, "state_space", lambda system: wrong)
    (found,) = failed(certify(linkage, 3))
    assert found.startswith("derivatives: A and B of the linearization")


@pytest.mark.filterwarnings("ignore::dynamics.ConstraintWarning")
def test_where_all_states_are_singular_the_slopes_of_accelerations_are_left_out() -> None:
    """The bars of a parallelogram that has to lie flat: its loop closes at one position, a singular one."""
    bars = [bar("crank", "world", 0.4, (0, 0, 0)), bar("table", "crank", 0.6, (0.4, 0, 0))]
    stretched = dyn.Mechanism(bars, loops=[dyn.Loop("point", "table", at=(0.6, 0, 0), to_at=(1.0, 0, 0))])
    found = certify(stretched, 2)
    assert failed(found) == {}
    assert not [each for each in found.residuals if "linearization" in each.equation]
    assert [each[:43] for each in found.left_out if "slopes" in each] == ["slopes of accelerations: at 2 of 2 states a"]


def test_what_was_not_compared_of_loops_is_said() -> None:
    said = [each for each in certify(four_bar("hinge"), 1).left_out if "loop" in each or "constraintDynamics" in each]
    assert said[0].startswith("MuJoCo: its equality constraints are soft")
    assert re.search("no loop of the kind 'hinge'|not installed", said[1])


def test_the_same_seed_gives_the_same_certificate() -> None:
    arm = dyn.scenes.load("triple_pendulum")
    first, again, other = (certify(arm, FEW, seed) for seed in (1, 1, 2))
    assert first == again
    assert first.residuals != other.residuals


def test_a_wrong_rule_of_differentiation_is_found() -> None:
    """All derivatives agree with each other then; differences do not."""
    rule = OPS["cos"].partials
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.7])
    object.__setattr__(OPS["cos"], "partials", lambda y, x: tuple([1.01 * each for each in rule(y, x)]))
    try:
        found = failed(certify(arm, FEW))
    finally:
        object.__setattr__(OPS["cos"], "partials", rule)
    assert {"AD: slope of L along a line = differences", "AD: slope of tau along a line = differences"} <= set(found)
    assert "energy: dE/dqd = M qd" not in found


@each_row("away", [-1e-4, 1e-4, 7e-4])
def test_slopes_beside_a_kink_and_a_jump_are_those_of_their_side(away: float) -> None:
    """Joint limits and dry friction that begin nearer to a state than the steps of differences."""
    rng = np.random.default_rng(0)
    model = partial(dyn.System, lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"])
    at = random_states(model(), 1, rng.uniform(), 1.0, rng)
    stop, turn = (float(at[name][0, 0]) + away for name in ("q", "qd"))
    pushed = model(forces=lambda q, qd, t: [-1e4 * cg.maximum(q[0] - stop, 0.0) - cg.sign(qd[0] - turn)])
    assert failed(certify(pushed, 1)) == {}


def wheels() -> dyn.Mechanism:
    """A turntable of three bodies in balance: M is constant, and no force acts in a world without weight."""
    turned = ((0.8, 0.0, 0.6), (0.0, 1.0, 0.0), (-0.6, 0.0, 0.8))
    table = dyn.Joint("revolute", (0, 1, 0), orientation=turned)
    bodies = [dyn.Body("table", table, mass=1.0, center=(0.27, -0.46, -0.92), inertia=(0.1, 0.1, 0.1))]
    for name, axis, position in (("disk", (0, 1, 0), (0.97, 0.63, 0.08)), ("top", (0, 0, 1), (0.46, 0.09, -0.38))):
        wheel = dyn.Joint("revolute", axis, position)
        bodies.append(dyn.Body(name, wheel, "table", mass=0.7, inertia=(0.01, 0.01, 0.01)))
    return dyn.Mechanism(bodies, gravity=(0.0, 0.0, 0.0))


@each_row(("model", "speed"), [(disk(), 0.5), (wheels(), 1.0)])
def test_terms_that_cancel_are_measured_by_the_inertia_that_moves(model: dyn.Mechanism, speed: float) -> None:
    """Such as sums of squares of sines and cosines, of which a constant M is made."""
    for seed in (0, 8, 12):
        assert failed(certify(model, 20, seed, speed=speed)) == {}


@pytest.mark.parametrize(
    ("function", "found"),
    [
        ("bias", {"coriolis: C qd + gravity = bias"}),
        ("mass_matrix", {"M: d2L/dqd2 = columns of inverse dynamics", "energy: dE/dqd = M qd"}),
        ("energy", {"energy: dE/dt = qd . (tau + forces - damping)", "energy: dE/dqd = M qd"}),
        ("forward_dynamics", {"inverse dynamics of forward dynamics = tau"}),
        ("coriolis", {"coriolis: C qd + gravity = bias", "coriolis: dM/dt - 2 C is skew"}),
        ("torque_by_link", {"links: partial torques add up to tau"}),
        ("torque_by_joint_motion", {"motion: torques by motion add up to tau"}),
        ("inverse_dynamics", {"inverse dynamics of forward dynamics = tau"}),
    ],
)
def test_a_wrong_graph_is_found(function: str, found: set[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """One part in a million on the graph's first output."""
    right = getattr(certificate, function)

    def bent(graph: cg.Graph) -> cg.Graph:
        outputs = dict(graph.outputs)
        first = next(iter(outputs))
        return cg.Graph(graph.inputs, outputs | {first: outputs[first] * (1.0 + 1e-6)})

    def wrong(*arguments):
        made = right(*arguments)
        return bent(made) if isinstance(made, cg.Graph) else replace(made, graph=bent(made.graph))

    monkeypatch.setattr(certificate, function, wrong)
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.7], damping=0.1)
    assert found <= set(failed(certify(arm, FEW)))


def test_inertia_that_is_negative_is_found() -> None:
    system = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + 1.5 * qd[0] * qd[1] + 0.5 * qd[1] ** 2, ["a", "b"])
    assert set(failed(certify(system, FEW))) == {"M: positive definite"}


def test_nan_fails() -> None:
    assert not Residual("x", math.nan, ROUNDING).passed


# What is changed in MuJoCo's model of a mechanism, the mass of its bodies, and what is said of it.
TWINS = [
    (('armature="', 'armature="1'), 1.0, "armature"),
    (('damping="', 'damping="1'), 1.0, "damping"),
    (('stiffness="', 'stiffness="1'), 1.0, "joint springs"),
    (('mass="', 'mass="1'), 1.0, "mass and its place"),
    (('mass="', 'mass="1'), 1e-11, "mass and its place"),  # as light as MuJoCo can hold
    (('gravity="', 'gravity="1'), 1.0, "gravity"),
    (('diaginertia="0.12', 'diaginertia="0.13'), 1.0, "inertia about the centers of mass"),
    (('integrator="RK4"', 'density="1000"'), 1.0, "fluid"),
    (('armature="', 'armature="1', 'damping="', 'damping="1'), 1.0, "damping and armature"),
]


@each_row(("changes", "mass", "terms"), TWINS)
def test_the_terms_that_a_twin_differs_in_are_named(changes: tuple[str, ...], mass: float, terms: str) -> None:
    pytest.importorskip("mujoco")
    mechanism = in_units(FAMILIES["mixed"](2), Units(mass=mass))
    text = to_mjcf(mechanism)
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        text = text.replace(old, new, 1)
    found = failed(certify(mechanism, FEW, twin=text))
    assert found == {"inverse dynamics = MuJoCo's": f"they agree without {terms}"}


def test_a_center_of_mass_beside_the_origin_is_compared() -> None:
    """MuJoCo by itself takes frames that are less than 1e-6 apart for one."""
    pytest.importorskip("mujoco")
    joint = dyn.Joint("revolute", (0.0, 1.0, 0.0))
    wheel = dyn.Mechanism([dyn.Body("wheel", joint, mass=1.0, center=(5e-7, 0.0, 0.0), inertia=(0.01, 0.01, 0.01))])
    for twin in (None, to_mjcf(wheel)):
        assert failed(certify(wheel, FEW, twin=twin)) == {}


TWO_LINKS = dyn.planar_arm([1.0, 1.0], [1.0, 1.0])
OF_ONE = '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'


@each_row(
    ("model", "given", "said"),
    [
        (TWO_LINKS, {"twin": OF_ONE}, "the twin has 1 degrees of freedom, the model 2"),
        (TWO_LINKS, {"twin": "/nowhere/arm.xml"}, "there is no file '/nowhere/arm.xml'"),
        (dyn.scenes.load("spring_mass"), {"twin": OF_ONE}, "a twin is compared with rigid bodies"),
    ],
)
def test_what_cannot_be_certified_is_an_error(model: dyn.Model, given: dict[str, Any], said: str) -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(ValueError, match=re.escape(said)):
        certify(model, **given)


def urdf(parents: list[int]) -> str:
    """Links on hinges, each on another, -1 for the world."""
    names, inside = [f"b{k}" for k in range(len(parents))], '<origin xyz="0.1 0 -1"/><axis xyz="0 1 0.2"/>'
    links = [link(name, 1.0, np.diag([0.2, 0.2, 0.1]), '<origin xyz="0 0.1 -0.5"/>') for name in names]
    carriers = [names[on] if on >= 0 else "world" for on in parents]
    joints = [joint(f"j{name}", "continuous", on, name, inside) for name, on in zip(names, carriers, strict=True)]
    return robot(link("world"), *links, *joints)


def test_a_urdf_file_is_a_twin_whatever_the_order_of_its_joints(tmp_path) -> None:
    """MuJoCo goes down each branch before the next. Shapes are not read, so a mesh that is not there is no reason."""
    pytest.importorskip("mujoco")
    file, text = tmp_path / "arm.urdf", urdf([-1, 0, 0, 1, 2, 1])
    mesh = '<visual><geometry><mesh filename="nowhere.stl"/></geometry></visual><inertial>'
    file.write_text(text.replace("<inertial>", mesh))
    found = certify(dyn.load_urdf(text), FEW, twin=file)
    assert failed(found) == {}
    assert "inverse dynamics = MuJoCo's" in [each.equation for each in found.residuals]


def test_the_command_translates_what_mujoco_cannot_read(tmp_path, capsys: pytest.CaptureFixture[str]) -> None:
    """Such as a link without mass between two joints."""
    pytest.importorskip("mujoco")
    model = tmp_path / "model.urdf"
    model.write_text(re.sub("<inertial>.*?</inertial>", "", urdf([-1, 0]), count=1))
    assert cli.main(["certify", str(model), "--states", "3"]) == 0
    printed = capsys.readouterr()
    assert "inverse dynamics = MuJoCo's" in printed.out
    assert printed.err.startswith("cgraph: compared is the model that was read, not the file: MuJoCo cannot read ")


def test_a_body_that_pinocchio_does_not_take_is_named() -> None:
    """Moments below rounding, as programs write those of a point mass that they have moved about."""
    pytest.importorskip("pinocchio")
    hinge = dyn.Joint("revolute", (0.0, 1.0, 0.0))
    certificate = certify(dyn.Mechanism([dyn.Body("a", hinge, "world", 0.5, (0, 0, 0.03), (-5e-20, -5e-20, 0.0))]), FEW)
    assert failed(certificate) == {}
    assert "Pinocchio: does not take body 'a'" in str(certificate)


def test_the_command_prints_a_certificate(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["certify", "triple_pendulum", "--states", "3", "--seed", "4", "--json"]) == 0
    given = json.loads(capsys.readouterr().out)
    assert (given["scene"], given["passed"], given["states"], given["seed"]) == ("triple_pendulum", True, 3, 4)
    assert all(each["value"] <= each["bound"]["value"] and each["bound"]["reason"] for each in given["residuals"])


@pytest.mark.filterwarnings("always::dynamics.MechanismWarning")
def test_the_command_finds_what_was_left_out(tmp_path: Any, capsys: Any) -> None:
    pytest.importorskip("mujoco")
    body = '<body name="a"><joint type="free" stiffness="1"/><geom size="0.1" pos="0.2 0 0"/></body>'
    model = tmp_path / "model.xml"
    model.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    assert cli.main(["certify", str(model), "--ignore", "--states", "3"]) == 1
    printed = capsys.readouterr()
    assert "(they agree without joint springs)" in printed.out
    assert printed.err.endswith("cgraph: model: 1 residual(s) exceed their bound: inverse dynamics = MuJoCo's\n")


@each_row("unit", [1e-12, 1e-3, 1.0, 1e6])
def test_the_admitted_motions_of_any_units_are_scaled_to_their_kinetic_energy(unit: float) -> None:
    """By the diagonal of M: what is left has the eigenvalues of M beside it, of the motions that a row admits."""
    masses = np.array([2.0, 3.0 * unit, 0.5])

    def energy(q: Any, qd: Any, t: Any) -> Any:
        return 0.5 * sum(m * x * x for m, x in zip(masses.tolist(), qd, strict=True))

    def row(q: Any, qd: Any, t: Any) -> Any:
        return {"joined": qd[0] - 0.7 * qd[1]}

    def value(graph: cg.Graph) -> np.ndarray:
        return np.array([[*graph.evaluate(dict.fromkeys(graph.input_names, 0.3)).values()]])

    size = np.sqrt(masses)
    inertia = np.outer(size, size) * [[1.0, 0.5, 0.1], [0.5, 1.0, -0.3], [0.1, -0.3, 1.0]]
    basis = np.array([[0.7, 0.0], [1.0, 0.0], [0.0, 1.0]])
    whole, diagonal = (basis.T @ each @ basis for each in (inertia, np.diag(masses)))
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(diagonal, whole)))
    held = Held(dyn.System(energy, "x y z", velocity_constraints=row), value)
    assert np.linalg.eigvalsh(held.admitted(inertia[None])[0]) == approx(expected, rel=1e-12)
