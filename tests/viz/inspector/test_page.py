"""The inspector's page: self-contained, and its script computes what the library does."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
import shutil
import subprocess
from html.parser import HTMLParser
from itertools import product

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.core.ops import OPS
from dynamics.scenes.inspection import FORMULATIONS, inspection
from tests.tolerances import SUMS
from viz import cli, theme
from viz.inspector import Motion, Table, Version
from viz.inspector.page import scripts
from viz.inspector.record import record, slopes

JAVASCRIPT_LIBM = 1e-12  # relative: a browser's sin and exp may differ from the C library's in the last bits


def data_of(text: str) -> dict:
    """The JSON that the script of a page reads."""
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)[1])


def versions(scene: str = "triple_pendulum") -> list[Version]:
    return [Version(*each[:4]) for each in inspection(dyn.scenes.load(scene)).versions]


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory) -> str:
    out = tmp_path_factory.mktemp("page") / "page.html"
    assert cli.main(["inspect", "triple_pendulum", "--out", str(out)]) == 0
    return out.read_text(encoding="utf-8")


# What the file is.


def test_a_page_is_one_small_file_that_loads_nothing(pendulum):
    assert len(pendulum.encode()) < 1.5e6
    assert set(re.findall(r"https?://[^\s\"'<]+", pendulum)) == {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1998/Math/MathML",
    }  # names, not addresses
    assert "default-src 'none'" in pendulum
    assert re.findall(r'(?:src|href)="([^"]*)"', pendulum) == ["data:,"]
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|import\(|localStorage", pendulum)


def test_it_has_all_formulations_with_their_counts_and_spurious_nodes(pendulum):
    data = data_of(pendulum)
    assert [each["name"] for each in data["versions"]] == [name.replace("_", " ") for name in FORMULATIONS]
    for name, each in zip(FORMULATIONS, data["versions"], strict=True):
        graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), name)
        assert each["counts"] == [graph.counts().nodes, graph.counts().edges]
        assert len(each["marked"]) == len(dyn.spurious_nodes(graph))
        assert len(each["rows"]) == len(data["motion"]["t"])
    table = pendulum.partition("Torques and forces that each part takes at t = 0")[2].partition("</table>")[0]
    assert "<th></th><th>link 1</th><th>link 2</th>" in table
    assert re.search(r"<td>τ.joint 1 \[N m\]</td><td>[^<]*</td><td>[^<]*</td>", table)
    assert "<td>−0.9391</td>" in table
    assert "<td>≈0</td>" in table  # what is left of the difference that damping is
    assert "e-1" not in table


def test_text_of_a_graph_stays_text():
    with cg.tag("</script><b>"):
        node = cg.with_name(cg.sin(cg.variable("x<y")), "<i>&")
    text = viz.page(
        cg.Graph(cg.variables(["x<y"]), {"<u>": node}), title="<s>", tables=[Table("<q>", ["<a>"], [["<c>"]])]
    )
    assert not any(f"<{letter}>" in text for letter in "iusqac")
    assert "</script><b>" not in text
    assert data_of(text)["versions"][0]["outputs"][0][0] == "<u>"


HOSTILE = [
    "</script><script>alert(1)</script>",
    'x"onpointerover="alert(1)',
    "x'onload='alert(1)",
    "<img/src=x/onerror=alert(1)>",
    "{tables}",
    "{title}",
    "$tables",
    "<!--",
    "]]>",
    "&lt;b&gt;",
    "javascript:alert(1)",
]


class Elements(HTMLParser):
    """The elements of a page with their attributes, and the texts inside each kind."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self._open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, name: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((name, dict(attributes)))
        if name not in ("meta", "link", "input", "br", "img"):
            self._open.append(name)
            self.texts.setdefault(name, []).append("")

    def handle_endtag(self, name: str) -> None:
        while self._open and self._open.pop() != name:
            pass

    def handle_data(self, data: str) -> None:
        if self._open:
            self.texts[self._open[-1]][-1] += data


def hostile_page(text: str) -> str:
    name = text.replace(" ", "_")
    x = cg.variable(name)
    with cg.tag(text):
        node = cg.with_name(cg.sin(x) * 2.0, text)
    graph = cg.Graph([x], {text: node})
    tables = [Table(text, [text, text], [[text, text]])]
    return viz.page([Version(text, graph, text, [node]), Version("b", graph)], title=text, about=text, tables=tables)


@pytest.mark.parametrize("text", HOSTILE)
def test_no_text_of_a_graph_becomes_markup_or_script(text):
    plain = Elements(viz.page(cg.Graph([], {"y": 1.0}), tables=[Table("c", ["a", "b"], [["c", "d"]])]))
    page = hostile_page(text)
    found = Elements(page)
    assert [name for name, _ in found.elements] == [name for name, _ in plain.elements]
    assert not [key for _, attributes in found.elements for key in attributes if key.startswith("on")]
    assert found.texts["title"] == found.texts["h1"] == [text]
    assert found.texts["caption"] == [text]
    assert found.texts["td"] == [text, text]
    assert data_of(page)["versions"][0]["names"]["0"][0] == text.replace(" ", "_")


def test_the_policy_lets_no_script_and_no_style_run_but_the_page_s_own(pendulum):
    found = Elements(pendulum)
    (policy,) = [each["content"] for name, each in found.elements if "http-equiv" in each]
    assert "unsafe" not in policy
    run = [text for text in found.texts["script"] if not text.startswith("{")]  # the data are no script
    assert len(run) == len(found.texts["style"]) == 1
    for kind, (text,) in (("script", run), ("style", found.texts["style"])):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy
    assert not re.search(r"(inner|outer|insertAdjacent)HTML|document\.write|\beval\(|new Function", scripts())
    assert not any(key.startswith("on") or key == "style" for _, attributes in found.elements for key in attributes)


def test_a_notebook_shows_it_in_a_frame():
    graph = cg.Graph(cg.variables("x y"), {"z": cg.variable("x") * cg.variable("y")})
    shown = viz.page(graph)._repr_html_()
    assert shown.startswith("<iframe srcdoc=")
    assert shown.count('"') == 8  # the page's own are escaped


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda graph: viz.page([]), "versions"),
        (lambda graph: viz.page([Version("a", graph)] * 2), "names of their own"),
        (lambda graph: viz.page(graph, at={"w": 1.0}), "'w'"),
        (lambda graph: viz.page(graph, at={"x": math.nan}), "finite"),
        (lambda graph: viz.page(graph, at={"x": [1.0, 2.0]}), "one finite number"),
        (lambda graph: viz.page(graph, marked=[cg.variable("w")]), "not in its graph"),
        (lambda graph: viz.page(graph, motion=Motion(np.zeros(0))), "motion"),
        (lambda graph: viz.page(graph, motion=Motion(np.zeros(2), np.zeros((2, 1, 3)), (-1,))), "(2, 1, 2)"),
        (lambda graph: viz.page(graph, motion=Motion(np.zeros(2), np.zeros((2, 1, 2)), (0,))), "parents"),
    ],
)
def test_a_mistake_is_told_in_one_line(make, said):
    graph = cg.Graph([cg.variable("x")], {"y": cg.sin(cg.variable("x"))})
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        make(graph)
    assert "\n" not in str(caught.value)


def test_the_command_tells_sizes(tmp_path, capsys):
    out = tmp_path / "page.html"
    assert cli.main(["inspect", "spring_mass", "--forward", "--json", "--out", str(out)]) == 0
    found = json.loads(capsys.readouterr().out)
    counts = dyn.forward_dynamics(dyn.scenes.load("spring_mass")).counts()
    assert found["versions"] == {"forward dynamics": {"nodes": counts.nodes, "edges": counts.edges, "spurious": 0}}
    assert found["bytes"] == out.stat().st_size
    assert data_of(out.read_text(encoding="utf-8"))["motion"]["points"] is None


def test_the_command_refuses_what_is_no_page(tmp_path, capsys):
    assert cli.main(["inspect", "spring_mass", "--out", str(tmp_path / "page.png")]) == 2
    assert capsys.readouterr().err.startswith("cgraph: error: --out must end in .html")
    assert list(tmp_path.iterdir()) == []


# Where nodes are.


def test_nodes_that_compute_the_same_keep_their_place():
    data = record(versions(), None)
    own = [each["place"] for each in data["versions"]]
    assert all(len(set(places)) == len(places) for places in own)
    euler, kinetic, chain = map(set, own)
    assert len(euler & kinetic) > 0.7 * len(euler)
    assert len(euler & chain) > 0.4 * len(chain)  # dL/dq, and what both derivatives are made of


def test_marked_nodes_have_clusters_of_their_own():
    data = record(versions(), None)
    for each in data["versions"]:
        for node, place in enumerate(each["place"]):
            cluster = data["places"][place][0]
            assert cluster < 0 or data["clusters"][cluster]["marked"] == (node in each["marked"])


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


# What the script computes, in Node where it is installed.


def run_script(program: str, given: object) -> object:
    """The value that a program prints as JSON, after the page's scripts."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node on PATH")
    text = "\n".join([scripts(), f"const given = {json.dumps(given)};", program])
    done = subprocess.run([node, "-"], input=text, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_script_knows_every_operation():
    cases = [[op.name, list(sample)] for op in OPS.values() for sample in op.samples]
    found = run_script("console.log(JSON.stringify(given.map(([op, args]) => VALUE[op](...args))));", cases)
    for (name, sample), value in zip(cases, found, strict=True):
        assert value == pytest.approx(OPS[name].scalar(*sample), rel=JAVASCRIPT_LIBM), name


SPECIAL = [0.0, -0.0, 1.0, -1.0, 0.5, -2.0, math.inf, -math.inf, math.nan, 1e300]


def test_the_script_agrees_where_numbers_are_special():
    cases = [[op.name, [*a]] for op in OPS.values() for a in product(SPECIAL, repeat=op.arity)]
    texts = [[name, [repr(each).replace("inf", "Infinity").replace("nan", "NaN") for each in a]] for name, a in cases]
    program = """console.log(JSON.stringify(given.map(([op, args]) => String(VALUE[op](...args.map(Number))))));"""
    for (name, args), text in zip(cases, run_script(program, texts), strict=True):
        expected = OPS[name].scalar(*args)
        value = float(text.replace("Infinity", "inf"))
        assert value == pytest.approx(expected, rel=JAVASCRIPT_LIBM, nan_ok=True), (name, args)


STATES = """
const result = given.versions.map((each) => {
  const version = prepare(each);
  return each.rows.map((row) => {
    const values = evaluate(version, row), slopes = slopesAt(version, given.slopes, values);
    const out = version.outputs[0][2];
    const bars = adjoints(version, slopes, out);
    return { values: version.outputs.map(([, , node]) => values[node]),
      bars: version.inputs.map(([, node]) => (node < 0 ? 0 : bars[node])),
      paths: version.inputs.map(([, node]) => (node < 0 ? "0" : pathCount(version, node, out).toString())),
      heaviest: version.inputs.map(([, node]) => (node < 0 ? []
        : heaviest(version, slopes, node, out, 3).map((path) => path.product))) };
  });
});
console.log(JSON.stringify(result));
"""


def test_values_adjoints_and_paths_of_the_script_are_those_of_the_library():
    rng = np.random.default_rng(1)
    given = []
    for each in versions():
        at = {name: rng.uniform(-1, 1) for name in each.graph.input_names}
        given.append(Version(each.name, each.graph, marked=each.marked, at=at))
    for version, [found] in zip(given, run_script(STATES, record(given, None)), strict=True):
        graph, at = version.graph, {name: float(value) for name, value in version.at.items()}
        values = graph.evaluate(at)
        scale = max(abs(value) for value in values.values())
        assert found["values"] == pytest.approx(list(values.values()), abs=JAVASCRIPT_LIBM * scale)
        step = 1e-6
        for i, name in enumerate(graph.input_names):
            up, down = [graph.evaluate(at | {name: at[name] + sign * step})["tau0"] for sign in (1, -1)]
            assert found["bars"][i] == pytest.approx((up - down) / (2 * step), abs=1e-6 * max(1.0, scale))
            why = cg.why(graph, "tau0", name, at=at, k=3)
            assert int(found["paths"][i]) == why.count
            assert [abs(p) for p in found["heaviest"][i]] == pytest.approx(
                [abs(path.value) for path in why.paths], rel=SUMS
            )


def test_huge_numbers_of_paths_are_exact():
    x = y = cg.variable("x")
    for _ in range(200):
        y = y * y
    given = record([Version("squares", cg.Graph([x], {"y": y}), at={"x": 1.0})], None)
    [[found]] = run_script(STATES, given)
    assert int(found["paths"][0]) == 2**200


STICKS = """
globalThis.document = { createElementNS: (_, name) => ({
  at: {}, setAttribute(key, value) { this.at[key] = value; }, appendChild() {} }) };
const boxes = given.map((motion) => {
  const svg = { at: {}, setAttribute(key, value) { this.at[key] = value; }, appendChild() {}, replaceChildren() {} };
  const { show, words } = armView(svg, motion);
  return [words, motion.points.map((_, frame) => { show(frame); return svg.at.viewBox.split(" ").map(Number); })];
});
console.log(JSON.stringify(boxes));
"""


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


def test_a_page_of_coordinates_with_names_shows_these_and_their_units():
    hinge, ball = dyn.Joint("revolute", (0, 1, 0), name="hip_" * 20), dyn.Joint("ball", (0, 0, 0.1), name="knee")
    model = dyn.Mechanism([dyn.Body("thigh", hinge, mass=1.0, center=(0.0, 0.0, -0.2)),
                           dyn.Body("shank", ball, "thigh", 1.0, (0.0, 0.0, -0.2), (0.1, 0.2, 0.2))])  # fmt: skip
    found = inspection(dyn.scenes.Scene("leg", "", model, (0.1, 1.0, 0.0, 0.0, 0.0), (0.0,) * 4, 0.1))
    data = record([Version(*found.versions[2][:4])], None, dyn.display_names(model), found.units)
    called, units = dict(data["called"]), dict(data["units"])
    (version,) = data["versions"]
    names = [name for name, *_ in version["inputs"] + version["outputs"]]
    assert set(names) <= set(called)
    assert set(names) <= set(units)
    assert (called["q1"], units["q1"]) == ("q.knee.qw", "1")
    assert (called["qd1"], units["qd1"]) == ("q\u0307.knee.wx", "rad/s")
    assert (called["tau0"], units["tau0"]) == ("\u03c4." + "hip_" * 20, "N m")


def test_a_page_of_loops_shows_where_they_close_and_does_not_promise_torques_of_zero():
    rod = {"mass": 1.0, "center": (0.5, 0.0, 0.0), "inertia": (0.0, 0.1, 0.1)}
    first = dyn.Body("a", dyn.Joint("revolute", (0, 1, 0)), **rod)
    bars = [first, dyn.Body("b", dyn.Joint("revolute", (0, 1, 0), (1.0, 0, 0)), "a", **rod)]
    pin = dyn.Loop("point", "b", "world", at=(1.0, 0, 0), to_at=(1.0, 0, 0))
    q, qd = dyn.consistent_state(model := dyn.Mechanism(bars, loops=[pin]), [0.5, 1.0], [1.0, 0.0])
    found = inspection(dyn.scenes.Scene("truss", "", model, tuple(q), tuple(qd), 0.1))
    assert "should be 0" not in found.versions[-1].about
    assert "constraints" in found.versions[-1].about
    assert np.ptp(found.skeleton.points[:, -1], axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)


# The page in a browser, where Playwright and a Chromium are installed.


@pytest.fixture(scope="module")
def browser():
    api = pytest.importorskip("playwright.sync_api", reason="the browser extra has it")
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("there is no Chromium on PATH")
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def opened(browser, pendulum, tmp_path):
    """The page of the triple pendulum, open; it must neither ask for anything nor complain."""
    (tmp_path / "page.html").write_text(pendulum, encoding="utf-8")
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    said, asked = [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto((tmp_path / "page.html").as_uri())
    yield page
    assert said == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    page.close()


def test_the_spurious_branch_is_seen_at_once_and_gone_by_the_chain_rule(opened):
    data = json.loads(opened.evaluate("document.getElementById('data').textContent"))
    wrong = {data["places"][data["versions"][0]["place"][node]][0] for node in data["versions"][0]["marked"]}
    assert opened.locator(".item.box.wrong").count() == len(wrong)
    assert opened.locator(".item.wrong .label").first.inner_html().count("spurious") == 1
    opened.keyboard.press("u")
    assert opened.locator(".item.wrong").count() == 55
    opened.keyboard.press("3")
    assert opened.locator(".item.wrong").count() == 0
    assert opened.locator("#results td.off").count() > 0  # the others' torques, beside it


def test_hostile_names_stay_texts_in_the_browser(browser, tmp_path):
    """Every panel is filled, wide and narrow, light and dark; nothing runs, and the policy has nothing to refuse."""
    said = []
    page = browser.new_page()
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("dialog", lambda dialog: (said.append(dialog.message), dialog.dismiss()))
    for text, width, scheme in ((HOSTILE[0], 1400, "light"), (HOSTILE[1], 390, "dark"), (HOSTILE[3], 390, "light")):
        (tmp_path / "page.html").write_text(hostile_page(text), encoding="utf-8")
        page.set_viewport_size({"width": width, "height": 800})
        page.emulate_media(color_scheme=scheme)
        page.goto((tmp_path / "page.html").as_uri())
        page.click("#unfold")
        for group in page.locator("g.item").all():
            group.dispatch_event("click")
            group.dispatch_event("pointerover")
        assert page.locator("#node math mi, #node math msub").count() > 0
        assert text in page.locator("#why").text_content() + page.locator("#node").text_content()
        assert page.locator("#inputs td").first.text_content() == text
        assert page.locator("#results th").nth(1).text_content() == text
        assert page.locator("img, body script:not([type]) ~ script, [onpointerover], [onload], [onerror]").count() == 0
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")
    page.close()
    assert said == []


def test_clusters_fold_and_unfold(opened):
    opened.click("#unfold")
    assert opened.locator(".item.box").count() == 0
    nodes = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), "euler_embedded").nodes
    assert opened.locator(".item.node, .item.leaf").count() == sum(node.value is None for node in nodes)
    opened.keyboard.press("f")
    assert opened.locator(".item.node").count() == 0
    opened.locator(".item.box").first.click()
    assert opened.locator(".frame").count() == 1


def test_two_clicks_ask_why(opened):
    opened.keyboard.press("3")
    opened.locator('[aria-label$=", q.joint 1"]').click()
    opened.locator("#otau0").click()
    graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"))
    at = dict.fromkeys(graph.input_names, 0.5)
    assert f": {cg.why(graph, 'tau0', 'q0', at=at).count} paths" in opened.inner_text("#why")
    assert opened.locator(".onpath").count() > 2
    assert opened.locator("#otau0.onpath.picked").count() == 1  # the output that was clicked, and the line to it
    assert opened.locator('.line.onpath[data-to="otau0"]').count() == 1
    assert opened.locator("#node math").count() == 1
    opened.keyboard.press("Escape")
    assert opened.locator(".onpath").count() == 0


def test_a_hover_shows_what_a_node_needs(opened):
    opened.locator("#otau1").hover()
    assert opened.locator(".item[data-part=ancestor]").count() > 10
    assert opened.locator(".item[data-part=descendant]").count() == 0


def test_search_finds_by_name_and_tag(opened):
    opened.keyboard.press("/")
    opened.keyboard.type("link 2")
    graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), "euler_embedded")
    tagged = sum("link 2" in node.tags and node.value is None for node in graph.nodes)
    assert opened.inner_text("#trail") == f"{tagged} nodes found"


def test_sweeps_step_forward_and_back(opened):
    opened.keyboard.press("]")
    assert opened.inner_text("#step") == "Before the first node."
    opened.keyboard.press("]")
    opened.keyboard.press("]")
    assert opened.inner_text("#step").startswith("forward, 2 of 249: ")
    opened.keyboard.press("[")
    assert opened.inner_text("#step").startswith("forward, 1 of 249: ")


def test_the_reverse_sweep_goes_from_the_chosen_output_to_its_derivatives(opened):
    graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), "euler_embedded")
    move = "(slider, to) => { slider.value = to; slider.oninput(); }"
    last = graph.nodes[-1]
    assert last is graph.outputs["tau2"]
    for output, adjoint in (("tau2", "1"), ("tau0", "0")):  # tau0 does not depend on tau2
        opened.select_option("#from", output)
        opened.eval_on_selector("#sweep", move, len(graph.nodes) + 1)
        assert opened.inner_text("#step") == f"reverse, 1 of 249: τ.joint 3 (+) has adjoint {adjoint}"
    opened.eval_on_selector("#sweep", move, 2 * len(graph.nodes))
    shown = opened.inner_text("#step").partition("reverse, 249 of 249: q̈.joint 1 has adjoint ")[2]
    given = dict(
        opened.eval_on_selector_all("#inputs input", "(all) => all.map((e) => [e.ariaLabel, Number(e.value)])")
    )
    called = theme.called(dyn.display_names(dyn.scenes.load("triple_pendulum")))
    at = {name: given[called.get(name, name)] for name in graph.input_names}
    up, down = [graph.evaluate(at | {"qdd0": at["qdd0"] + sign * 1e-3})["tau0"] for sign in (1, -1)]
    assert float(shown.replace("−", "-")) == pytest.approx((up - down) / 2e-3, rel=5e-3)  # three digits are shown


def test_a_box_is_called_by_its_tags_and_says_how_many_nodes_it_has(opened):
    opened.keyboard.press("3")
    graph = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"))
    damping = sum("damping" in node.tags and node.value is None for node in graph.nodes)
    box = opened.locator(f'[aria-label="damping, as written, {damping} nodes, folded"]')
    assert box.locator("text").all_text_contents() == ["▸ damping", f"{damping} nodes"]
    drawn = sum(node.value is None for node in graph.nodes)
    said = f"{len(graph.inputs)} of {drawn} nodes unfolded; {len(graph.nodes) - drawn} constants"
    assert opened.inner_text("#trail") == said


def test_the_motion_moves_the_values(opened):
    before = opened.inner_text("#results")
    opened.evaluate("(s) => { s.value = 80; s.oninput(); }", opened.query_selector("#time"))
    assert opened.inner_text("#results") != before
    assert opened.inner_text("#clock") == f"{80 * 3.0 / 89:.2f} s"


def test_the_theme_can_be_switched(opened):
    ink = "getComputedStyle(document.body).color"
    before = opened.evaluate(ink)
    opened.click("#theme")
    assert opened.evaluate(ink) != before
