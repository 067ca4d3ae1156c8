"""What the page's script computes, in V8: it is what the library computes, in one state for all versions."""

import math
import re
from functools import cache

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.codegen.python_function import source
from cgraph.extend import Names
from cgraph.operations.table import OPS
from tests.page_script import run_script
from tests.tolerances import SUMS
from viz.animation.panels import surfaces
from viz.inspector.content import State, StateTable, Version
from viz.inspector.record import record
from viz.models.inspection import PAPER, inspection
from viz.pages.operations import graph_data, slopes

pytestmark = pytest.mark.usefixtures("without_graphviz")
JAVASCRIPT_LIBM = 1e-12  # relative: a browser's sin and exp may differ from the C library's in the last bits


@pytest.fixture(scope="module")
def pendulum() -> list[Version]:
    versions = inspection(dyn.scenes.load("triple_pendulum")).versions
    return [versions[name] for name in PAPER]


PLACES = """(record) => {
  const versions = makeState(record).versions, plan = placesOf(record, versions);
  return { place: plan.place, cluster: plan.cluster, clusters: plan.clusters, columns: plan.columns };
}"""


def test_nodes_that_compute_the_same_keep_their_place(pendulum):
    own = run_script(PLACES, record(pendulum, None))["place"]
    assert all(len(set(places)) == len(places) for places in own)
    euler, kinetic, chain = map(set, own)
    assert len(euler & kinetic) > 0.7 * len(euler)
    assert len(euler & chain) > 0.4 * len(chain)  # dL/dq, and what both derivatives are made of


def test_marked_nodes_have_clusters_of_their_own_and_bodies_their_order(pendulum):
    names = {"link 3": None, "link 1": "link 3", "link 2": "link 1"}  # not alphabetical
    data = record(pendulum, None, columns=names)
    plan = run_script(PLACES, data)
    for each, places in zip(data["versions"], plan["place"], strict=True):
        for node, place in enumerate(places):
            cluster = plan["cluster"][place]
            assert cluster < 0 or plan["clusters"][cluster]["marked"] == (node in each["marked"])
    assert plan["columns"][:3] == list(names)
    assert run_script(PLACES, record(pendulum, None))["columns"][:3] == ["link 1", "link 2", "link 3"]


def test_without_tags_nodes_stand_with_the_step_or_with_the_lagrangian_in_all_versions():
    def lagrangian(q, qd, t):
        return 0.5 * (1.0 + cg.cos(q[1]) ** 2) * qd[0] ** 2 + 0.5 * qd[1] ** 2 - cg.sin(q[0] * q[1])

    system = dyn.System(lagrangian, ["x", "y"])
    graphs = [dyn.inverse_dynamics(system, name) for name in ("by_definition", "chain_rule")]
    plan = run_script(PLACES, record([Version(f"{i}", graph) for i, graph in enumerate(graphs)], None))
    assert sorted(plan["columns"]) == ["Euler relation", "lagrangian"]
    euler, chain = map(set, plan["place"])
    assert euler & {place for place in chain if plan["cluster"][place] >= 0}  # dL/dq


def test_a_sum_that_is_a_result_stands_under_it(pendulum):
    """And in no cluster of what it adds last, such as damping."""
    data = record(pendulum, None)
    plan = run_script(PLACES, data)
    for each, places in zip(data["versions"], plan["place"], strict=True):
        used = {arg for node in each["nodes"] if isinstance(node, list) for arg in node[1:]}
        for _, _, node in each["outputs"]:
            assert (plan["cluster"][places[node]] == -2) == (node not in used)


def test_slopes_are_the_differences_of_every_operation():
    for op in OPS.values():
        program = slopes(op)
        for sample in op.samples:
            work = [op.scalar(*sample), *sample]
            for line in program["code"]:
                work.append(line if isinstance(line, float) else OPS[line[0]].scalar(*[work[i] for i in line[1:]]))
            for slot, result in enumerate(program["out"]):
                h = 1e-6
                up, down = [[v + sign * h * (i == slot) for i, v in enumerate(sample)] for sign in (1, -1)]
                difference = (op.scalar(*up) - op.scalar(*down)) / (2 * h)
                assert work[result] == pytest.approx(difference, abs=SUMS), op.name


POINT = """(record) => {
  const state = makeState(record);
  return state.versions.map((version) => {
    const values = state.evaluate(version), slopes = slopesAt(version, values);
    const out = version.outputs[0][2], bars = adjoints(version, slopes, out);
    const each = (f) => version.inputs.map(([, node]) => (node < 0 ? null : f(node)));
    return { values: version.outputs.map(([, , node]) => values[node]), bars: each((node) => bars[node]),
      paths: each((node) => pathCount(version, node, out).toString()),
      heaviest: each((node) => heaviest(version, slopes, node, out, 3).map((path) => path.product)) };
  });
}"""


def test_values_adjoints_and_paths_of_the_script_are_those_of_the_library(pendulum):
    rng = np.random.default_rng(1)
    at = {name: rng.uniform(-1, 1) for name in dict.fromkeys(n for each in pendulum for n in each.graph.input_names)}
    for version, found in zip(pendulum, run_script(POINT, record(pendulum, None, state=State(at))), strict=True):
        graph = version.graph
        own = {name: at[name] for name in graph.input_names}
        values = graph.evaluate(own)
        scale = max(abs(value) for value in values.values())
        assert found["values"] == pytest.approx(list(values.values()), abs=JAVASCRIPT_LIBM * scale)
        step = 1e-6
        for i, name in enumerate(graph.input_names):
            up, down = [graph.evaluate(own | {name: own[name] + sign * step})["tau0"] for sign in (1, -1)]
            assert found["bars"][i] == pytest.approx((up - down) / (2 * step), abs=1e-6 * max(1.0, scale))
            why = cg.why(graph, "tau0", name, at=own, k=3)
            assert int(found["paths"][i]) == why.count
            assert [abs(p) for p in found["heaviest"][i]] == pytest.approx(
                [abs(path.value) for path in why.paths], rel=SUMS
            )


CAUSES = """(record) => {
  const state = makeState(record);
  return state.versions.map((version) => {
    const values = state.evaluate(version), app = { state, version, partials: () => slopesAt(version, values) };
    const node = new Map([...Object.entries(version.names).map(([node, [name]]) => [name, +node]), ...version.inputs]);
    return version.outputs.map(([name, , out]) => ["", "q1", "qd0", "qdd2"].map((by) => {
      const whole = by ? adjoints(version, app.partials(), out)[node.get(by)] : values[out];
      return { whole, parts: causesOf(app, name, by ? node.get(by) : -1, whole) };
    }));
  });
}"""


def test_causes_add_up_and_are_those_of_the_library():
    scene = dyn.scenes.load("triple_pendulum")
    content = inspection(scene)
    rng = np.random.default_rng(2)
    at = {name: rng.uniform(-1, 1) for name in content.at} | {"dt": 1e-9}
    graphs, state = [*content.versions.values()], State(at, content.derived)
    found = dict(
        zip(content.versions, run_script(CAUSES, record(graphs, None, state=state, causes=content.causes)), strict=True)
    )
    table = dyn.torque_by_cause(scene)
    values = table.at(*[[at[f"{kind}{i}"] for i in range(3)] for kind in ("q", "qd", "qdd")]).values
    slopes = cg.jacobian(table.graph, ["q1", "qd0", "qdd2"]).evaluate(
        {name: at[name] for name in table.graph.input_names}
    )
    for name in (*PAPER, "newton_euler"):
        outputs, excess = found[name], content.versions[name].excess
        assert (excess is None) == (name not in ("by_definition", "kinetic_only"))
        for i, (value, *by) in enumerate(outputs):
            for k, cause in enumerate(table.rows):
                assert value["parts"][k] == [cause, pytest.approx(values[k, i], abs=1e-7, rel=1e-9)]
            for one, each in zip(("q1", "qd0", "qdd2"), by, strict=True):
                parts = dict(each["parts"])
                expected = [slopes[f"dtau{i}_{k}/d{one}"] for k in range(len(table.rows))]
                assert [parts[cause] for cause in table.rows] == pytest.approx(expected, abs=1e-7, rel=1e-9)
            for each in (value, *by):
                parts = dict(each["parts"])
                size = sum(map(abs, parts.values()))
                assert sum(parts.values()) == pytest.approx(each["whole"], abs=1e-12 * size)
                if excess:  # at dt = 1e-9 s the step leaves what rounding does to a difference over it
                    assert abs(parts["step of dt"]) < 1e-6 * size


def test_infinities_and_the_negative_zero_reach_the_page():
    x, values = cg.variable("x"), (math.inf, -math.inf, -0.0)
    graph = cg.Graph([x], {str(i): cg.minimum(x, value) for i, value in enumerate(values)})
    program = "(graph) => [...evaluator(graph)([0.5])].map((value) => String(value === 0 ? 1 / value : value))"
    found = run_script(program, graph_data(graph))
    assert [found[node] for _, node in graph_data(graph)["outputs"]] == ["0.5", "-Infinity", "-Infinity"]


def test_huge_numbers_of_paths_are_exact():
    x = y = cg.variable("x")
    for _ in range(200):
        y = y * y
    [found] = run_script(POINT, record([Version("squares", cg.Graph([x], {"y": y}))], None, state=State({"x": 1.0})))
    assert int(found["paths"][0]) == 2**200


def test_a_node_has_one_number_everywhere(pendulum):
    """In the listing, in what explains, in drawings, in C and Python, and on the page."""
    numbers = run_script("(record) => makeState(record).versions.map((each) => each.number)", record(pendulum, None))
    for version, found in zip(pendulum[1:], numbers[1:], strict=True):
        graph = version.graph
        lines, tooltips = graph.listing().splitlines(), viz.to_dot(graph).source
        names, c, python = Names(graph), cg.to_c(graph).source, source(graph, lambda op: op.python)
        for node, number in zip(graph.nodes, found, strict=True):
            assert bool(number) == bool(node.args)
            if number:
                assert lines[number].startswith(f"%{number} = {node.op.name} ")
                assert names.line(node).startswith(f"%{number} = ")
                assert f'tooltip="%{number}: {node.op.name}' in tooltips
                assert f"v{number} = " in python
        assert set(re.findall(r"const double v([0-9]+) = ", c)) <= {str(each) for each in found if each}


@cache
def spring() -> tuple[list[Version], State]:
    found = inspection(dyn.scenes.load("spring_mass"))
    at = dict(found.at) | {"q0": 0.3, "qd0": 0.2, "qdd0": 0.1, "tau0": 0.3}
    return list(found.versions.values()), State(at, found.derived)


@pytest.mark.parametrize(
    ("change", "said"),
    [({"q0_old": 1.0}, "follows from q0, qd0"), ({"nobody": 1.0}, "no input nobody"), ({"q0": "x"}, "finite number")],
)
def test_a_change_that_means_nothing_is_one_sentence_and_changes_nothing(change, said):
    versions, state = spring()
    program = """(record, change) => {
      const state = makeState(record), before = JSON.stringify(state.values());
      try { state.set({ dt: 0.5, ...change }); }
      catch (error) { return [error.message, before === JSON.stringify(state.values())]; }
      return ["", false];
    }"""
    message, same = run_script(program, record(versions, None, state=state), change)
    assert said in message
    assert "\n" not in message
    assert same


def test_a_state_and_its_tables_are_checked():
    versions, state = spring()
    for changed, said in (
        (State({"q0_old": 1.0}, state.derived), "q0_old"),
        (State({}, cg.Graph(cg.variables("q0"), {"nobody": cg.variable("q0")})), "nobody"),
    ):
        with pytest.raises(ValueError, match=said):
            record(versions, None, state=changed)
    graph = cg.Graph(cg.variables("w"), {"a": cg.variable("w")})
    with pytest.raises(ValueError, match="'w' is not an input"):
        record(versions, None, state=state, tables=[StateTable("t", graph, ["a"], {"tau0": ["a"]})])
    graph = cg.Graph(cg.variables("q0"), {"a": cg.variable("q0")})
    with pytest.raises(ValueError, match="row 'tau0'"):
        record(versions, None, state=state, tables=[StateTable("t", graph, ["a"], {"tau0": ["a", "b"]})])


def test_what_rounding_leaves_is_told_from_what_is_small():
    """A difference of equal sums is noise, in any unit; a small number is not."""
    x, y = cg.variables("x y")
    graph = cg.Graph(
        [x, y], {"zero": (x + y) - y - x, "small": x * 1e-9 * y, "sine": cg.sin(x) ** 2 + cg.cos(x) ** 2 - 1.0}
    )
    program = """(record) => {
      const state = makeState(record), [version] = state.versions, values = state.evaluate(version);
      const noise = errorBounds(version, slopesAt(version, values), ownErrors(version, values, []), 0);
      return version.outputs.map(([, , node]) => [brief(values[node], noise[node]), values[node], noise[node]]);
    }"""
    for unit in (1.0, 1e-9, 1e12):
        found = run_script(
            program, record([Version("v", graph)], None, state=State({"x": 0.1 * unit, "y": 0.7 * unit}))
        )
        assert found[0][0] == "0"
        assert found[1][0] != "0"
        assert found[2][0] == "0"
        assert abs(found[0][1]) <= found[0][2] < 1e-14 * unit


def test_a_velocity_of_a_long_arm_is_no_noise_and_what_cancels_is():
    """Along an elimination the sizes of all ways add up to more than any value; with their signs they do not."""
    arm, x = dyn.scenes.load("chain", n=12), cg.variable("q0")
    graph, momenta = dyn.hamilton_equations(arm), dyn.momentum(arm)
    zero = cg.Graph(graph.inputs, graph.outputs | {"zero": (x + 0.1) - 0.1 - x})
    at = {name: 1e-7 if name[1] == "d" else float(np.sin(3.0 * i)) for i, name in enumerate(momenta.input_names)}
    at["qd0"] = 1.0  # it turns as one
    at |= momenta.evaluate(at)
    program = """(record) => {
      const state = makeState(record), [version] = state.versions;
      const values = state.evaluate(version), slopes = slopesAt(version, values);
      const own = ownErrors(version, values, state.errorsOf(version)), bounds = errorBounds(version, slopes, own, 0);
      const sharp = sharpened(version, slopes, values, bounds, own);
      return [state.solved(version), ...version.outputs.map(([, , node]) => [values[node], bounds[node], sharp[node]])];
    }"""
    state = State({name: at.get(name, 0.0) for name in graph.input_names})
    data = record([Version("momenta", zero)], None, state=state)
    solved, *outputs = run_script(program, data)
    assert not solved
    assert any(abs(value) <= bound for value, bound, _ in outputs[:-1])
    assert all(abs(value) > sharp for value, _, sharp in outputs[:-1])
    assert abs(outputs[-1][0]) <= outputs[-1][2]


SURFACES = """(radii, points, box) => {
  const svg = document.createElement("svg"), grid = surfaceView(svg, radii, points.length)(points, ...box);
  return [grid, svg.inside.map(({ at }) => at.d.match(/-?[0-9.]+(e-?[0-9]+)?/g).map(Number))];
}"""


@pytest.mark.parametrize("edge_on", [True, False])
def test_page_and_film_draw_the_same_surfaces(edge_on):
    """A plane is a line, the tangent of a sphere that rests on it, or a grid."""
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) if edge_on else np.random.default_rng(0).normal(size=(2, 3))
    points = np.array([[0.3, 0.2, 0.1], [0.35, 0.2, 0.1], *np.eye(3)[[2, 0, 1]] * [1.0, 1.0, 0.0]]) @ axes.T
    center, half, step = np.array([0.1, 0.2]), 0.7, 0.5
    lines = surfaces(points, [0.1], center, half, step)
    grid, (plane, ball) = run_script(SURFACES, [0.1], points.tolist(), [*center, half, step])
    ends = np.array(plane).reshape(-1, 2, 2) * [1.0, -1.0]
    assert grid == bool(lines.grids) == (not edge_on)
    ((ring, spoke),) = lines.spheres
    assert np.linalg.norm(ring - points[0], axis=1) == pytest.approx(0.1)
    assert [ball[0] + 0.1, -ball[1], *ball[-2:]] == pytest.approx([*points[0], spoke[1, 0], -spoke[1, 1]])
    if grid:
        assert ends == pytest.approx(np.array(lines.grids))
    else:
        assert ends[..., 1].tolist() == lines.edges[0][:, 1:].T.tolist() == [[0.0, 0.0]]
        assert ring[:, 1].min() == pytest.approx(0.0, abs=1e-3)


STICKS = """(motions) => motions.map((motion) => {
  const svg = document.createElement("svg"), { show, words } = armView(svg, motion);
  return [words, motion.points.map((_, frame) => { show(frame); return svg.at.viewBox.split(" ").map(Number); })];
})"""


def test_every_frame_of_a_motion_has_the_whole_mechanism_in_it_and_large_enough_to_see():
    """Whatever the size, falling, flying or held: the points are inside, and take a tenth of the frame."""
    t = np.linspace(0.0, 3.0, 20)[:, None, None]
    body = np.array([[[0.0, 0.0], [0.3, -0.2], [-0.3, -0.2]]])
    falling = body + np.concatenate([0.0 * t, -4.905 * t**2], axis=-1)
    turning = np.concatenate([np.zeros((20, 1, 2)), np.concatenate([np.sin(t), -np.cos(t)], axis=-1)], axis=1)
    motions = [1e-3 * falling, falling, 1e3 * falling + 7e3, turning, 1e-9 * turning, np.zeros((3, 2, 2))]
    given = [{"points": each.tolist(), "parents": [-1, *[0] * (each.shape[1] - 1)]} for each in motions]
    for points, (words, boxes) in zip(motions, run_script(STICKS, given), strict=True):
        for frame, (x, y, width, height) in zip(points, boxes, strict=True):
            assert (frame[:, 0] >= x).all()
            assert (frame[:, 0] <= x + width).all()
            assert (-frame[:, 1] >= y).all()
            assert (-frame[:, 1] <= y + height).all()
            assert np.ptp(frame, axis=0).max() >= 0.1 * width or np.ptp(frame) == 0.0
        assert bool(words) == bool(np.ptp(points[:, 0], axis=0).max() > 2.0 * np.ptp(points[0]))
