"""Pickles of models: the same equations in another process, and a sentence where a function cannot be found there."""

import copy
import pickle
import subprocess
import sys
from typing import Any

import pytest

import cgraph as cg
import dynamics as dyn

m = cg.variable("m")
SHARED = 2.0 * m  # of two bodies


def rods() -> dyn.Mechanism:
    """Two rods whose masses are one node, under an actuator, on a base that slides."""
    base = dyn.Body("base", dyn.Joint("prismatic"), mass=1.0, inertia=(0.1, 0.2, 0.3))
    upper = dyn.Body("upper", dyn.Joint("ball"), "base", SHARED, (0.0, 0.0, -0.5), (0.1, 0.2, 0.3))
    lower = dyn.Body(
        "lower", dyn.Joint("revolute", (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)), "upper", SHARED + 1.0, (0.0, 0.0, -0.5)
    )
    force = dyn.Force("lower", (m * cg.variable("qd0"), 0.0, "push"))
    motor = dyn.Actuator("lower", "current")
    return dyn.Mechanism([base, upper, lower], forces=[force, motor], parameters={"m": 0.5})


def held() -> dyn.System:
    """A mass on a circle that is driven, as lambdas that nobody can find again."""
    return dyn.System(
        lambda q, qd, t, p: [p["m"] * (qd[0] ** 2 + qd[1] ** 2), -p["m"] * 9.81 * q[1]],
        "x y",
        {"m": 2.0},
        forces=lambda q, qd, t: [cg.sin(t), 0.0],
        damping=[0.1, 3.0 * m],
        constraints=lambda q, t: {"circle": q[0] ** 2 + q[1] ** 2 - 1.0},
    )


MODELS: dict[str, dyn.Mechanism | dyn.System | dyn.OdeSystem] = {
    "bodies": rods(),
    "system of bodies": rods().system,
    "system": held(),
    "first order": dyn.OdeSystem(lambda x, t, p: [x[1], -p["k"] * x[0] + t], ["x", "v"], {"k": 2.0}),
}
COPIES = [lambda model: pickle.loads(pickle.dumps(model)), copy.copy, copy.deepcopy]


def equations(model: Any) -> str:
    return cg.structure_hash(model.graph if model.ode else dyn.forward_dynamics(model))


@pytest.mark.parametrize("name", MODELS)
def test_a_model_pickles_before_and_after_it_was_used(name: str) -> None:
    model = MODELS[name]
    before = [copied(model) for copied in COPIES]
    needed = equations(model)
    assert [equations(each) for each in before + [copied(model) for copied in COPIES]] == [needed] * 6
    assert [dict(each.parameters) for each in before] == [dict(model.parameters)] * 3


def test_a_scene_and_its_motion_pickle() -> None:
    scene = dyn.scenes.load("spring_mass")
    assert equations(pickle.loads(pickle.dumps(scene))) == equations(scene)
    motion = dyn.prepare(scene, varied="k", tau=applied)
    there = pickle.loads(pickle.dumps(motion))
    ends = [each.end([1.0], [0.0], 1.0, parameters={"k": 3.0}) for each in (motion, there)]
    assert ends[0].q == ends[1].q


def applied(q: Any, qd: Any, t: Any) -> list[Any]:
    return [-0.1 * qd[0]]


def test_nodes_that_are_shared_stay_shared() -> None:
    arm = pickle.loads(pickle.dumps(rods()))
    assert arm.bodies[2].mass.args[0] is arm.bodies[1].mass
    assert arm.bodies[1].mass.args[1] is m


def test_another_process_has_the_same_equations() -> None:
    code = (
        "import sys, pickle, cgraph as cg, dynamics as dyn\n"
        "print(cg.structure_hash(dyn.forward_dynamics(pickle.load(sys.stdin.buffer))))"
    )
    done = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(held()), capture_output=True, check=True)
    assert done.stdout.decode().strip() == equations(held())


def test_a_function_that_nobody_finds_is_a_sentence() -> None:
    spin = dyn.QuasiVelocities(["w"], lambda q, u: [2.0 * u[0]])
    turning = dyn.System(lambda q, u, t: 0.5 * u[0] ** 2, "angle", quasi_velocities=spin)
    scene = dyn.scenes.Scene("wheel", "turns", turning, (0.0,), (1.0,), 1.0)
    motion = dyn.prepare(held(), tau=lambda q, qd, t: [0.0, 0.0])
    event, hold = dyn.Event("up", lambda q, qd, t: q[0]), dyn.SampledController(lambda q, qd, t: q, 0.1)
    rows = (turning, "a System"), (scene, "a System"), (motion, "a Run"), (event, "an Event")
    for given, name in (*rows, (hold, "a SampledController")):
        with pytest.raises(
            pickle.PicklingError, match=rf"^{name} does not pickle: .*lambda.*; give it functions .* in a module by def"
        ):
            pickle.dumps(given)
