"""The live motion: its script in V8 computes what the library does; the page is one small strict file."""

import json
import math
import re
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from py_mini_racer import MiniRacer

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.core.node import apply
from cgraph.extend import OPS, Op
from dynamics.integrators import TABLEAUS
from dynamics.scenes.scenes import of_model
from tests.each_row import each_row
from tests.viz.page_elements import data_of
from viz.lessons.screens.energy_and_step import energy_and_step
from viz.lessons.subject import subject_of
from viz.live_page.live_panel import SCRIPTS, Live, functions, page_text
from viz.models.live_motion import live_of
from viz.pages.html import asset

ROUNDING = 1e-12  # relative: a few hundred steps of sines that differ in the last bit
PENDULUM = dyn.scenes.load("triple_pendulum")


@pytest.fixture(scope="module")
def live():
    return live_of(PENDULUM)


class Script:
    """The panel's script in V8, without a page: a machine and a run on data."""

    def __init__(self, live: Live) -> None:
        self.engine = MiniRacer()
        self.engine.eval(
            f'"use strict";\n{functions(live)}{asset("viz.live_page", *SCRIPTS)}\n'
            f"var data = {json.dumps(live.to_dict())}, machine = liveMachine(data, LIVE), run = liveRun(machine, data);"
        )

    def __call__(self, program: str) -> object:
        """The value of an expression, through JSON."""
        return json.loads(self.engine.eval(f"JSON.stringify({program})"))


@pytest.fixture(scope="module")
def engine(live):
    started = Script(live)
    yield started
    started.engine.close()


@pytest.fixture
def script(engine):
    engine.engine.eval("run.reset()")
    return engine


def states(motion):
    return [*motion.q[-1], *motion.qd[-1]]


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_steps_in_a_page_are_those_of_the_library(method, script, live):
    """Half a second; the library's dopri5 chooses its steps, so this one is compared with a solution."""
    reference = {"rk4": "rk4", "dopri5": "dop853"}[method]
    options = {"dt": 0.001, "backend": "python"} if method == "rk4" else {"rtol": 1e-12}
    motion = dyn.simulate(PENDULUM, PENDULUM.q, PENDULUM.qd, 0.5, reference, **options)
    assert motion.stats.success
    script.engine.eval(f"run.state.method = '{method}'; run.state.dt = 0.001; run.steps(500)")
    tolerance = ROUNDING if method == "rk4" else 1e-9
    np.testing.assert_allclose(script("[...machine.run].slice(0, 6)"), states(motion), rtol=0, atol=tolerance * 10)
    assert script("run.state.time") == pytest.approx(0.5)


def test_meters_and_points_are_those_of_the_library(script, live):
    values = {name: value + 0.1 * k for k, (name, value) in enumerate(live.start.items())}
    script.engine.eval(f"{json.dumps(list(values.values()))}.forEach((value, i) => run.set(i, value))")
    expected = live.shown.evaluate(values)
    np.testing.assert_allclose(script("[...run.now().values]"), list(expected.values()), rtol=ROUNDING)
    arm = dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], damping=0.1)
    (energy,) = dyn.energy(arm).evaluate({name: live.start[name] for name in dyn.energy(arm).input_names}).values()
    script.engine.eval("run.reset()")
    assert script("run.now().values[data.energy]") == pytest.approx(energy, abs=ROUNDING * 30)


def test_a_meter_says_which_side_holds():
    block = dyn.System(lambda q, qd, t: qd[0] ** 2 / 2, "x", forces=lambda q, qd, t: [-2.0 * cg.sign(qd[0] - 0.5)])
    for model, name in ((block, "qd.x - 0.5"), (dyn.OdeSystem(lambda x, t: [cg.sign(0.5 - x[0])], "x"), "x - 0.5")):
        script = Script(live_of(of_model(model)))
        (k,) = [k for k, each in enumerate(script("data.meters")) if each["called"] == name]
        assert script("data.notes.side").startswith("which side of each surface holds")
        assert [script(f"(run.set({'qd' in name:d}, {v}), run.now().meters[{k}])") for v in (0, 1)] == [-1, 1]
        script.engine.close()


def test_too_long_a_step_shows_its_error_at_once(script):
    """Nothing has moved yet; the error ahead grows with the order of the method, and is small at the page's dt."""
    errors = []
    for dt in (0.005, 0.01, 0.02, 0.04, 0.2):
        script.engine.eval(f"run.state.dt = {dt}")
        errors.append(script("run.now().ahead.share"))
        assert script("run.now().since.most") == 0.0
    assert errors[0] < 1e-6
    assert errors == sorted(errors)
    assert math.log2(errors[2] / errors[1]) == pytest.approx(4.0, abs=1.0)
    assert errors[-1] > 1e-2


def test_the_error_since_the_start_is_the_distance_from_the_solution(script):
    script.engine.eval("run.state.dt = 0.05; run.steps(20)")
    motion = dyn.simulate(PENDULUM, PENDULUM.q, PENDULUM.qd, 1.0, "dop853", rtol=1e-12)
    assert motion.stats.success
    off = np.abs(np.array(script("[...machine.run].slice(0, 6)")) - states(motion))
    found = script("run.now().since")
    assert found["most"] == pytest.approx(off[found["index"]], rel=0.05)


def test_an_error_is_large_or_small_in_any_unit_and_a_link_keeps_parameters_of_any_name():
    """A spring of a micrometer and a megameter, whose parameters are called as what a link holds besides."""
    shares = []
    for size in (1e-6, 1.0, 1e6):
        spring = dyn.System(
            lambda q, qd, t, p: 0.5 * p["time"] * qd[0] ** 2 - 0.5 * p["method"] * q[0] ** 2,
            ["x"],
            {"time": 2.0, "method": 3.0},
        )
        script = Script(live_of(dyn.Scene("spring", "bounces", spring, (size,), (0.0,), 1.0)))
        script.engine.eval("run.state.dt = 0.3; run.steps(4)")
        shares.append(script("[run.now().since.share, run.now().ahead.share]"))
        script.engine.eval(
            "var link = run.link(), at = [run.state.time, run.state.method, ...machine.run]; run.reset()"
        )
        script.engine.eval("run.open(link)")
        assert script("[run.state.time, run.state.method, ...machine.run]") == script("at")
        script.engine.close()
    assert shares == [pytest.approx(shares[1], rel=1e-9)] * 3
    assert min(shares[1]) > 1e-6


def test_the_course_to_come_is_the_motion_that_comes(script):
    """Of a System without places the picture shows it before anything runs; looking ahead moves nothing."""
    before = script("Array.from(machine.run)")
    rows = "(({run, fine}) => [run, fine].map((all) => all.map(({time, state}) => [time, [...state]])))"
    run, fine = script(f'{rows}(machine.course("rk4", data.dt))')
    assert script("Array.from(machine.run)") == before
    assert len(run) == len(fine) == 301
    script.engine.eval("run.steps(200)")
    assert run[200][1] == script("Array.from(machine.run.subarray(0, data.states))")
    assert fine[200][1] == script("Array.from(machine.fine.subarray(0, data.states))")
    assert run[200][0] == pytest.approx(script("run.state.time"))


def test_a_clock_that_goes_back_makes_no_step(script):
    """The first frame's time may lie before the moment in which its run was asked for."""
    before = script("Array.from(machine.run)")
    assert script("run.advance(-10 * data.dt)") == 0
    assert (script("run.state.time"), script("Array.from(machine.run)")) == (0, before)
    assert script("run.advance(1.5 * data.dt)") == 1


@each_row("dt", [1e-6, 1e-2, 0.1, 10.0])
def test_the_course_to_come_is_short_and_smooth_whatever_dt_is(dt, script):
    """A picture takes no longer with a shorter dt, and the reference keeps its corners small with a longer one."""
    count, fine, end = script(
        f'(({{run, fine}}) => [run.length, fine.length, run.at(-1).time])(machine.course("rk4", {dt}))'
    )
    assert count <= 301
    assert 100 <= fine <= 301
    assert end >= 0.9 * 300 * script("data.dt")


def test_a_motion_that_leaves_the_numbers_says_so_and_comes_back(script):
    script.engine.eval("run.state.method = 'euler'; run.state.dt = 1e3; run.steps(60)")
    found = script("(({ finite, since }) => ({ finite, most: String(since.most) }))(run.now())")
    assert found == {"finite": False, "most": "NaN"}
    script.engine.eval("run.reset()")
    assert script("run.now().finite") is True
    assert script("[run.state.dt, run.state.time]") == [script("data.dt"), 0]


def test_a_link_brings_back_the_whole_state_to_the_last_bit(script):
    script.engine.eval("run.set(0, 0.1 + 0.2); run.state.method = 'dopri5'; run.state.dt = 0.0125; run.steps(7)")
    script.engine.eval("var link = run.link(), kept = [...machine.run], at = { ...run.state }; run.reset()")
    assert re.fullmatch("[-A-Za-z0-9_.!~*'()%]*", script("link"))
    assert script("[...machine.run]") != script("kept")
    assert script("run.open(link)") is True
    assert script("[...machine.run]") == script("kept")
    assert script("[run.state.dt, run.state.method, run.state.time]") == script("[at.dt, at.method, at.time]")
    assert script("run.now().since.most") == 0.0


@each_row(
    "link",
    ["", "%", "null", "[1]", "{", '{"dt":-1,"q0":"a","method":"x","time":null,"zz":3,"values":{"q0":"a","zz":3}}'],
)
def test_a_link_that_says_nothing_changes_nothing(link, script):
    before = script("[[...machine.run], run.state.dt, run.state.method]")
    script.engine.eval(f"run.open({json.dumps(link)})")
    assert script("[[...machine.run], run.state.dt, run.state.method]") == before


@pytest.mark.parametrize("seconds", [[0.016] * 50, [0.1, 0.0, 0.7]])
def test_the_clock_keeps_up_with_real_time_and_says_where_it_cannot(seconds, script):
    for each in seconds:
        script.engine.eval(f"run.advance({each})")
    assert abs(script("run.state.time") - sum(seconds)) <= script("data.dt") * 1.01
    assert script("run.state.slow") is False
    script.engine.eval("run.state.dt = 1e-6; run.advance(0.1)")
    assert script("run.state.slow") is True


@each_row("dt", [1e-7, 1e-3, 0.1, 10.0, 1e6])
def test_a_frame_takes_so_many_steps_at_most_whatever_dt_is(dt, script):
    counted = "{ ...machine, step: (inputs, method, h, count) => { steps += count; } }"
    script.engine.eval(f"var steps = 0, counting = liveRun({counted}, data); counting.state.dt = {dt}")
    script.engine.eval("counting.advance(0.1); counting.advance(10)")
    assert script("steps") <= 2 * 4500


def test_a_value_that_is_no_number_is_not_taken(script):
    assert script("[run.set(0, NaN), run.set(0, Infinity), machine.run[0] === data.inputs[0].value]") == [
        False,
        False,
        True,
    ]


@each_row("name", ["spring_mass", "triple_pendulum", "chain"])
def test_the_graphs_of_a_scene_say_what_the_library_says(name):
    scene = dyn.scenes.load(name) if name != "chain" else dyn.scenes.load(name, n=3)
    found = live_of(scene)
    assert len(found.meters) + 2 * len(found.parents) == len(found.shown.outputs)
    assert set(found.start) == set(found.rate.input_names) == set(found.scales)
    rate = dyn.state_equation(scene)
    expected = rate.evaluate({name: found.start[name] for name in rate.input_names})
    assert list(found.rate.evaluate(found.start).values()) == pytest.approx(
        list(expected.values()), rel=ROUNDING, abs=1e-9
    )
    shown = found.shown.evaluate(found.start)
    assert shown["energy"] == pytest.approx(shown["kinetic"] + shown["potential"])


@each_row("name", ["spring_mass", "triple_pendulum"])
def test_in_momentum_form_the_state_is_of_momenta_and_moves_alike(name):
    scene = dyn.scenes.load(name)
    found, usual = live_of(scene, momentum=True), live_of(scene)
    n = scene.system.n
    assert found.rate.input_names[: 2 * n] == (*[f"q{i}" for i in range(n)], *[f"p{i}" for i in range(n)])
    assert set(found.start) == set(found.rate.input_names) == set(found.scales)
    moving = {f"p{i}": 0.3 * found.scales[f"p{i}"] for i in range(n)}
    shown, rates = found.shown.evaluate(found.start | moving), found.rate.evaluate(found.start | moving)
    assert {each: shown[each] for each in rates} == pytest.approx(rates)
    beside = usual.shown.evaluate(usual.start | {f"qd{i}": rates[f"q{i}_dot"] for i in range(n)})
    for each in ("kinetic", "energy", "p0_dot"):
        assert shown[each] == pytest.approx(beside[each])
    assert {each: beside[each] for each in moving} == pytest.approx(moving)
    groups = {each["group"] for each in live_of(scene, momentum=True).to_dict()["inputs"]}
    assert {"positions", "momenta", "torques"} <= groups
    assert "velocities" not in groups


def test_a_usual_speed_may_be_none_that_a_system_can_have():
    fast = dyn.System(lambda q, qd, t: -cg.sqrt(1.0 - qd[0] ** 2) - q[0] ** 2, "x")  # at 1 its momentum has no bound
    found = live_of(dyn.Scene("fast", "", fast, (0.2,), (0.1,), 0.1), momentum=True)
    assert 0.0 < found.scales["p0"] < 10.0


def test_masses_and_gravity_of_a_small_mechanism_are_parameters(live):
    assert {"g", "mass.link_1", "mass.link_2", "mass.link_3"} <= set(live.start)
    large = live_of(dyn.scenes.load("chain", n=5))
    assert "g" not in large.start


def test_a_denser_body_is_the_same_body():
    """Its inertia grows with its mass: twice the masses, the same motion."""
    found = live_of(dyn.scenes.load("chain", n=2))
    heavy = {name: 2.0 * value if name.startswith("mass.") else value for name, value in found.start.items()}
    assert list(found.rate.evaluate(heavy).values()) == pytest.approx(list(found.rate.evaluate(found.start).values()))


HOSTILE = "</script><script>alert(1)</script>"


def test_names_stay_texts():
    x, v = cg.variables(["x", "v"])
    rate = cg.Graph([x, v], {"a": v, "b": -x})
    energies = cg.Graph([x, v], {"K": v * v / 2, "P": x * x / 2, "E": (v * v + x * x) / 2})
    meters = [(HOSTILE, HOSTILE, HOSTILE), ("P", "J", "energy"), ("E", "J", "energy")]
    live = Live(rate, {"x": 1.0, "v": 0.0}, energies, meters, dt=0.1, methods=TABLEAUS, names={"x": HOSTILE})
    page = page_text(live, title=HOSTILE, about=HOSTILE)
    assert page.count("<script") == 2
    assert data_of(page, "live-data")["inputs"][0]["called"] == HOSTILE
    assert page._repr_html_().count('"') == 8


def test_a_start_that_is_no_number_is_told():
    x, v = cg.variables(["x", "v"])
    graph = cg.Graph([x, v], {"a": v, "b": -x})
    with pytest.raises(ValueError, match="has none of v"):
        Live(graph, {"x": 1.0, "v": math.nan}, graph, [])


def test_a_center_that_attracts_has_a_page():
    """Its state at 0 has no rates, and no weight that sliders could be as long as."""
    planet = dyn.System(lambda q, qd, t: qd[0] ** 2 + qd[1] ** 2 + 1.0 / cg.hypot(q[0], q[1]), "x y")
    assert "const LIVE = {" in viz.live(planet)
    assert "const LIVE = {" in viz.live(planet, start=[0.0, 0.0, 0.0, 0.0])


def test_an_operation_of_ones_own_works_in_pages_and_one_without_javascript_is_told():
    """A spring whose potential is such an operation."""
    values = lambda x: x * x, lambda x: x * x, lambda y, x: (2.0 * x,)
    bowl = Op("bowl", 1, *values, samples=((0.6,),), javascript="(x) => { return x * x; }")

    def spring(op):
        return dyn.System(lambda q, qd, t: qd[0] ** 2 - apply(op, q[0]), ["x"])

    with patch.dict(OPS, bowl=bowl):
        script = Script(live_of(of_model(spring(bowl))))
        script.engine.eval("run.set(0, 0.3)")
        potential = [each["called"] for each in script("data.meters")].index("potential")
        assert script(f"run.now().values[{potential}]") == pytest.approx(0.09)
        script.engine.close()
        assert bowl.javascript in energy_and_step(subject_of(spring(bowl))).play["modules"]
    bare = replace(bowl, javascript="")
    with patch.dict(OPS, bowl=bare):
        for made in (viz.live, lambda system: energy_and_step(subject_of(system))):
            with pytest.raises(ValueError, match=r"'bowl' has no text in JavaScript, .* the column `javascript`"):
                made(spring(bare))
