"""Contacts: their laws, beside closed forms; action and reaction; units; smoothness; and what cannot be one."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.multibody.parameters import vanishes
from tests.dynamics.mechanisms import random_rotation, random_state, random_tree
from tests.each_row import each_row
from tests.tolerances import EQUATIONS, SHORT_SUM, SOLVED

STEPS = 1e-7  # of motions at rtol 1e-10 through touches, where only N and its slope are continuous
DIFFERENCES = 1e-5  # of slopes of such motions, whose chosen steps count as constants
MATERIAL: dict[str, Any] = {"stiffness": 1e5, "dissipation": 0.3, "friction": 0.4, "velocity": 0.01}
RADIUS, MASS, GRAVITY = 0.1, 2.0, 9.81


def ball(name: str = "ball", **others: Any) -> dyn.Body:
    moment = 0.4 * MASS * RADIUS**2
    return dyn.Body(name, dyn.Joint("free"), mass=MASS, inertia=(moment, moment, moment), **others)


def on_ground(**material: Any) -> dyn.Mechanism:
    return dyn.Mechanism([ball()], forces=[dyn.Contact("ball", radius=RADIUS, **(MATERIAL | material))])


def falling(**contact: Any) -> dyn.Mechanism:
    """A mass on a vertical slide, without gravity, on the ground."""
    slide = dyn.Body("mass", dyn.Joint("prismatic", (0.0, 0.0, 1.0)), mass=MASS)
    return dyn.Mechanism([slide], (0.0, 0.0, 0.0), [dyn.Contact("mass", **contact)])


def trees() -> list[dyn.Mechanism]:
    """Random trees whose bodies touch, pairwise and on the ground, by both kinds of contact."""
    found = []
    for seed in range(4):
        rng, tree = np.random.default_rng(seed), random_tree(seed, 4)
        contacts = [
            dyn.Contact(
                *pair,
                at=rng.normal(size=3),
                to_at=rng.normal(size=3),
                normal=rng.normal(size=3),
                radius=float(rng.uniform(0.5, 5.0)),
                to_radius=to_radius,
                **MATERIAL,
            )
            for pair in (("b3", "world"), ("b1", "b3"), ("b2", "b0"))
            for to_radius in (None, 3.0)
        ]
        found.append(replace(tree, forces=contacts))
    return found


def evaluated(mechanism: dyn.Mechanism, contact: dyn.Contact, q: Any, qd: Any) -> dict[str, Any]:
    return dyn.arrays_at(mechanism, mechanism.contact(contact), q=q, qd=qd)


@each_row("d, unit", [(d, unit) for d in (0.1, 1.0, 5.0) for unit in (1.0, 1e-9)])
def test_a_body_is_thrown_back_as_hunt_and_crossley_say(d: float, unit: float) -> None:
    """d v (1 + e) = log((1 + d v) / (1 - d e v)), in meters and nanometers."""
    model = falling(stiffness=1e5 / math.sqrt(unit), dissipation=d / unit)
    run = dyn.simulate(model, [0.001 * unit], [-unit], 1.0, rtol=1e-10, atol=1e-13 * unit)
    e = run.qd[-1, 0] / unit
    assert 0.0 < e < 1.0
    assert d * (1.0 + e) == approx(math.log((1.0 + d) / (1.0 - d * e)), rel=STEPS)


def test_a_ball_that_slips_rolls_at_five_sevenths_of_its_speed() -> None:
    """It slips for 2 v / (7 friction g), and, but for the creep, not after."""
    mu, slow, speed = 0.2, 1e-4, 1.0
    model = on_ground(friction=mu, velocity=slow)
    height = RADIUS - (MASS * GRAVITY / MATERIAL["stiffness"]) ** (2.0 / 3.0)
    slipping = 2.0 * speed / (7.0 * mu * GRAVITY)
    times = [0.5 * slipping, 0.9 * slipping, 2.0 * slipping]
    start = [0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0], [speed, 0.0, 0.0, 0.0, 0.0, 0.0]
    run = dyn.simulate(model, *start, times[-1], "rodas", t_eval=times)
    sliding = run.qd[:, 0] - RADIUS * run.qd[:, 4]
    for k, t in enumerate(times[:2]):
        assert run.qd[k, 0] == approx(speed - mu * GRAVITY * t, abs=slow)
        assert sliding[k] == approx(speed - 3.5 * mu * GRAVITY * t, abs=slow)
    assert run.qd[-1, 0] == approx(5.0 / 7.0 * speed, rel=1e-6)
    assert abs(sliding[-1]) < slow


def on_slope(slope: float, **material: Any) -> tuple[dyn.Mechanism, float]:
    """A block, in axes turned with the slope, and the height at which it rests."""
    pull = (GRAVITY * math.sin(slope), 0.0, -GRAVITY * math.cos(slope))
    slide = dyn.Body("rail", dyn.Joint("prismatic", (0.0, 0.0, 1.0)))
    block = dyn.Body("block", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), "rail", mass=MASS)
    sink = (MASS * GRAVITY * math.cos(slope) / MATERIAL["stiffness"]) ** (2.0 / 3.0)
    return dyn.Mechanism([slide, block], pull, [dyn.Contact("block", **(MATERIAL | material))]), -sink


def test_on_a_slope_a_block_creeps_as_stated() -> None:
    """Under a load of s friction N with s / sqrt(1 - s^2) of the velocity."""
    s, mu, slow = 0.8, 0.5, 1e-3
    model, height = on_slope(math.atan(s * mu), friction=mu, velocity=slow)
    run = dyn.simulate(model, [height, 0.0], [0.0, 0.0], 1.0, "rodas")
    assert run.qd[-1] == approx([0.0, slow * s / math.sqrt(1.0 - s * s)], abs=1e-6 * slow)


RK4 = {"dt": 1e-3, "estimate_error": False}
THROWS = [(0.0, 3.0, "radau", {}), (0.0, -3.0, "rk4", RK4), (0.9, -2.0, "dop853", {}), (0.9, 0.0, "rk4", RK4)]


@mark.parametrize(("load", "speed", "method", "options"), [*THROWS, (1.1, 0.0, "dop853", {})])
def test_true_friction_stops_a_block_and_lets_it_go_at_its_angle(
    load: float, speed: float, method: str, options: dict[str, Any]
) -> None:
    """On tan(slope) = load mu it stops after v^2 / 2 a and stays for load < 1, and accelerates for load > 1."""
    mu = 0.5
    slope = math.atan(load * mu)
    model, height = on_slope(slope, friction=mu, velocity=0.0)
    run = dyn.simulate(model, [height, 0.0], [0.0, speed], 1.0, method, **options)
    drive, brake = GRAVITY * math.sin(slope), mu * GRAVITY * math.cos(slope)
    stops = math.copysign(speed * speed, speed) / 2.0 / (brake - math.copysign(drive, speed)) if load < 1.0 else 0.0
    slips = max(drive - brake, 0.0)
    assert [run.q[-1, 1], run.qd[-1, 1]] == approx([stops + 0.5 * slips, slips], rel=STEPS, abs=1e-15)


def test_a_foot_that_lands_sticks_whichever_way_it_slips() -> None:
    """Before it touches its slip has no sign; mirrored throws end mirrored, and a straight drop nowhere else."""
    model, _ = on_slope(0.0, friction=0.5, velocity=0.0, dissipation=1.0)
    ends = [dyn.simulate(model, [0.02, 0.0], [0.0, speed], 0.3) for speed in (0.4, -0.4, 0.0)]
    x = [float(run.q[-1, 1]) for run in ends]
    assert 0.0 < x[0] < 0.4 * 0.3
    assert x == approx([x[0], -x[0], 0.0], rel=STEPS, abs=1e-15)
    assert np.abs([run.qd[-1, 1] for run in ends]).max() < 1e-15


def test_sticking_friction_in_space_acts_along_two_tangents() -> None:
    """The axis of `to` nearest to the plane, and the normal times it."""
    normal = np.array([0.1, 0.6, 0.7])
    normal /= np.linalg.norm(normal)
    first = np.eye(3)[0] - normal[0] * normal
    lines = [first / np.linalg.norm(first), np.cross(normal, first / np.linalg.norm(first))]
    model = dyn.Mechanism([ball()], forces=[dyn.Contact("ball", normal=normal, stiffness=1e5, friction=0.4)])
    slip = 0.3 * lines[0] - 0.1 * lines[1]
    found = evaluated(model, model.forces[0], [*(-0.01 * normal), 1.0, 0.0, 0.0, 0.0], [*slip, 0.0, 0.0, 0.0])
    force = float(found["normal"]) * (normal - 0.4 * lines[0] + 0.4 * lines[1])
    assert [float(found[f"f{axis}"]) for axis in "xyz"] == approx(force.tolist(), rel=SOLVED)


def test_the_force_never_pulls_and_friction_stays_below_its_bound() -> None:
    touched = 0
    for tree in trees():
        for seed, contact in enumerate(tree.forces):
            assert isinstance(contact, dyn.Contact)
            q, qd, *_ = random_state(tree, seed)
            found = {name: float(value) for name, value in evaluated(tree, contact, q, 5.0 * qd).items()}
            normal, force = found["normal"], np.array([found[f"f{axis}"] for axis in "xyz"])
            assert normal >= 0.0
            assert normal == 0.0 or found["depth"] > 0.0
            across = math.sqrt(max(force @ force - normal**2, 0.0))
            assert across <= MATERIAL["friction"] * normal * (1.0 + SHORT_SUM) + SOLVED * normal
            touched += normal > 0.0
    assert touched >= 8


def test_the_force_acts_where_the_surfaces_touch() -> None:
    """Of spheres of any radii, each way around, and of a sphere on a plane."""
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    place, still = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0] * 12
    model = dyn.Mechanism([ball("first"), ball("second")])
    q = [*place, *(0.4 * direction), 1.0, 0.0, 0.0, 0.0]
    rows = [("first", "second", 0.1, 0.3), ("second", "first", 0.3, 0.1), ("first", "second", 0.1, None)]
    for body, to, radius, to_radius in rows:
        to_at = (0.0, 0.0, 0.0) if to_radius else -0.3 * direction
        contact = dyn.Contact(body, to, to_at=to_at, normal=-direction, radius=radius, to_radius=to_radius, **MATERIAL)
        found = evaluated(model, contact, q, still)
        assert [float(found[axis]) for axis in "xyz"] == approx((0.1 * direction).tolist(), rel=SHORT_SUM)
        assert abs(found["depth"]) < SHORT_SUM


def test_generalized_forces_have_the_power_of_the_contacts() -> None:
    """Q . qd is the sum of f . v."""
    for tree in trees():
        q, qd, _, tau = random_state(tree, 5)
        free = replace(tree, forces=())
        state = {"q": q, "qd": qd, "tau": tau}
        rates = [dyn.arrays_at(each, dyn.forward_dynamics(each), **state)["qdd"] for each in (tree, free)]
        mass = dyn.arrays_at(tree, dyn.mass_matrix(tree), q=q)["M"]
        power = float(qd @ mass @ (rates[0] - rates[1]))
        parts = []
        for contact in tree.forces:
            assert isinstance(contact, dyn.Contact)
            found = evaluated(tree, contact, q, qd)
            parts.append(sum([float(found[f"f{axis}"]) * float(found[f"v{axis}"]) for axis in "xyz"]))
        assert power == approx(sum(parts), rel=SOLVED, abs=SOLVED * max(map(abs, parts)))


def test_action_is_reaction() -> None:
    """Bodies on nothing that hit one another, eccentric, with friction: momentum and angular momentum stay."""
    rng = np.random.default_rng(3)
    first, second = ball("first"), ball("second")
    for to_radius in (0.07, None):
        offset = rng.normal(size=(2, 3)) * 0.02
        contact = dyn.Contact(
            "first", "second", at=offset[0], to_at=offset[1], normal=(0.2, 0.1, 1.0), radius=RADIUS,
            to_radius=to_radius, **MATERIAL,
        )  # fmt: skip
        model = dyn.Mechanism([first, second], (0.0, 0.0, 0.0), [contact])
        q = [0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0, 0.01, 0.02, 0.0, 1.0, 0.0, 0.0, 0.0]
        run = dyn.simulate(model, q, [0.3, 0.0, -2.0, 1.0, 2.0, 3.0, *[0.0] * 6], 0.2, rtol=1e-10, atol=1e-12)
        momenta = dyn.arrays_at(model, dyn.spatial_momentum(model), q=run.q, qd=run.qd)["h"]
        assert evaluated(model, contact, run.q, run.qd)["normal"].max() > 10.0
        assert np.abs(momenta - momenta[0]).max() < SOLVED * np.abs(momenta).max()
        assert (run.energy[-1]) < 0.99 * run.energy[0]


def test_in_a_turned_frame_a_contact_is_the_same() -> None:
    """A plane given in the world, and in the axes of a body welded to it."""
    rng = np.random.default_rng(1)
    turn, place, normal, point = random_rotation(rng), rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    table = dyn.Body("table", dyn.Joint("fixed", position=place, orientation=turn))
    given = {"at": rng.normal(size=3), "radius": 20.0, **MATERIAL}
    in_world = dyn.Contact("ball", to_at=point, normal=normal, **given)
    on_table = dyn.Contact("ball", "table", to_at=turn.T @ (point - place), normal=3.0 * turn.T @ normal, **given)
    models = [dyn.Mechanism([ball(), table], forces=[each]) for each in (in_world, on_table)]
    q, qd, _, tau = random_state(models[0], 2)
    first, second = (dyn.arrays_at(each, dyn.forward_dynamics(each), q=q, qd=qd, tau=tau)["qdd"] for each in models)
    assert np.abs(first).max() > 1e3
    assert np.abs(first - second).max() < EQUATIONS * np.abs(first).max()


def test_slopes_are_there_at_the_touch_and_apart() -> None:
    """First and second, forward and reverse: 0 apart and at the touch, and never NaN."""
    model = on_ground()
    forward = dyn.forward_dynamics(model)
    slopes = cg.jacobian(forward, ["q2", "qd0", "qd2"])
    second = cg.jacobian(slopes, ["q2", "qd2"])
    for height in (2.0 * RADIUS, RADIUS):
        state = dict.fromkeys(forward.input_names, 0.0) | {"q2": height, "q3": 1.0, "qd0": 1.0, "qd2": -1.0}
        assert set(slopes.evaluate(state).values()) == {0.0}
        assert set(second.evaluate(state).values()) == {0.0}


@mark.parametrize("method", ["dop853", "radau"])
def test_a_motion_from_the_touch_itself_has_slopes(method: str) -> None:
    model = falling(stiffness=1e5)
    pushed = replace(model, gravity=(0.0, 0.0, -GRAVITY))
    found = dyn.gradient(pushed, lambda q, qd, t: q[0], [0.0], [0.0], 0.02, method, wrt=["q"]).gradients["q"][0]
    exact = {"rtol": 1e-11, "atol": 1e-14}
    low, high = (float(dyn.simulate(pushed, [sign * 1e-6], [0.0], 0.02, **exact).q[-1, 0]) for sign in (-1.0, 1.0))
    assert found == approx((high - low) / 2e-6, rel=1e-3)  # the slope has a kink at the touch


def test_a_gradient_through_a_landing_is_that_of_differences() -> None:
    """Of where a spinning ball is after its first bounce, by the start and by the material."""
    contact = dyn.Contact("ball", radius=RADIUS, stiffness="k", dissipation="d", friction="mu", velocity="slow")
    values = {"k": 1e5, "d": 0.3, "mu": 0.4, "slow": 0.01}
    model = dyn.Mechanism([ball()], forces=[contact], parameters=values)
    q, qd, exact = [0.0, 0.0, 0.15, 1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], {"rtol": 1e-11, "atol": 1e-14}

    def end(q: Any, qd: Any, values: dict[str, float]) -> float:
        run = dyn.simulate(model, q, qd, 0.15, parameters=values, **exact)
        return float(run.q[-1, 0] + run.q[-1, 2] + 0.1 * run.qd[-1, 4])

    found = dyn.gradient(
        model, lambda q, qd, t: q[0] + q[2] + 0.1 * qd[4], q, qd, 0.15, wrt=["q", "qd", *values], **exact
    )
    assert found.value == approx(end(q, qd, values), rel=STEPS)
    for name, value in values.items():
        h = 1e-4 * value
        low, high = (end(q, qd, values | {name: value + sign * h}) for sign in (-1.0, 1.0))
        assert float(found.gradients[name]) * value == approx((high - low) / 2e-4, abs=DIFFERENCES)
    low, high = (end([0.0, 0.0, 0.15 + sign * 1e-5, 1.0, 0.0, 0.0, 0.0], qd, values) for sign in (-1.0, 1.0))
    assert found.gradients["q"][2] == approx((high - low) / 2e-5, abs=DIFFERENCES)


def test_parameters_of_a_contact_are_inputs_and_are_bound() -> None:
    named = {"stiffness": "k", "dissipation": "d", "friction": "mu", "velocity": "slow"}
    values = {name: MATERIAL[what] for what, name in named.items()}
    opened = dyn.Mechanism([ball()], forces=[dyn.Contact("ball", radius=RADIUS, **named)], parameters=values)
    state = {f"q{i}": x for i, x in enumerate([0.0, 0.0, 0.09, 1.0, 0.0, 0.0, 0.0])}
    state |= {f"{kind}{i}": 0.3 for kind in ("qd", "tau") for i in range(6)}
    results = [
        dyn.forward_dynamics(each).evaluate(state | dict(each.parameters))
        for each in (opened, opened.bind(), on_ground())
    ]
    assert results[0] == approx(results[1], rel=SHORT_SUM)
    assert results[1] == results[2]
    assert opened.bind().forces[0].stiffness == 1e5
    softer = opened.bind({"k": 1.0})
    assert set(softer.parameters) == {"d", "mu", "slow"}
    assert vanishes(replace(softer.forces[0], friction=0.0).friction)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "nobody": ({"body": "nobody"}, "there is a contact on the unknown body 'nobody'"),
    "no other": ({"to": "nobody"}, "there is a contact on the unknown body 'nobody'"),
    "the world": ({"body": "world", "to": "ball"}, "there is a contact on the unknown body 'world'"),
    "itself": ({"to": "ball"}, "contact of body 'ball' with 'ball': a contact needs two bodies"),
    "points": ({"radius": 0.0, "to_radius": 0.0}, "contact of body 'ball' with 'world': two points do not touch"),
    "a radius": (
        {"radius": -1.0},
        "contact of body 'ball' with 'world': radius must be finite and at least 0, got -1.0 m",
    ),
    "no normal": ({"normal": (0, 0, 0)}, "contact of body 'ball' with 'world': normal must not be zero"),
    "soft": (
        {"stiffness": -1.0},
        "contact of body 'ball' with 'world': stiffness must be finite and at least 0, got -1.0",
    ),
    "sticky": ({"friction": math.nan}, "contact of body 'ball' with 'world': friction must be finite and at least 0"),
    "a jump": (
        {"friction": 0.5, "to_radius": 0.1},
        "contact of body 'ball' with 'world': velocity must be positive where spheres rub",
    ),
    "no value": (
        {"stiffness": "k"},
        "contact of body 'ball' with 'world': stiffness has the parameter 'k', which needs",
    ),
}


@mark.parametrize("case", BAD)
def test_a_contact_that_cannot_be_is_refused(case: str) -> None:
    given, message = BAD[case]
    contact = dyn.Contact(**({"body": "ball", "radius": RADIUS, "stiffness": 1e5} | given))
    with raises(dyn.MechanismError, match="^" + re.escape(message)):
        dyn.Mechanism([ball()], forces=[contact])


def test_a_value_that_makes_no_contact_is_refused() -> None:
    contact = dyn.Contact("ball", radius=RADIUS, stiffness=1e5, friction=0.5, velocity="slow")
    model = dyn.Mechanism([ball()], forces=[contact], parameters={"slow": 0.01})
    with raises(dyn.MechanismError, match=r"velocity must be positive .* where slow = 0\.0"):
        model.bind({"slow": 0.0})
    with raises(dyn.MechanismError, match="a contact is a Contact, got str"):
        model.contact("ball")  # type: ignore[arg-type]
