"""The page in a browser, where Playwright and a Chromium are installed."""

import re

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from tests.each_row import each_row
from tests.hostile_texts import HOSTILE, hostile_page
from viz import cli

EMBEDDED = "by_definition"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    for scene in ("triple_pendulum", "spring_mass"):
        assert cli.main(["inspect", scene, "--out", str(folder / f"{scene}.html")]) == 0
    return folder


@pytest.fixture
def show(visit, written):
    return lambda scene="triple_pendulum", **options: visit(written / f"{scene}.html", **options)


def graph_of(name="chain_rule"):
    return dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), name)


# Texts in the picture in CSS pixels, and items that are not whole in it.
FIRST = """() => {
  const frame = document.getElementById("picture").getBoundingClientRect();
  const inside = (r) => r.left >= frame.left - 1 && r.right <= frame.right + 1 && r.top >= frame.top - 1 && r.bottom <= frame.bottom + 1;
  const k = document.getElementById("scene").getCTM().a;
  const shown = [...document.querySelectorAll("#scene text")].filter((e) => getComputedStyle(e).display !== "none");
  return { least: Math.min(...shown.map((e) => k * parseFloat(getComputedStyle(e).fontSize))),
    cut: [...document.querySelectorAll(".item")].filter((e) => !inside(e.getBoundingClientRect())).length,
    wide: shown.filter((e) => e.closest(".item") && e.getBBox().width > e.closest(".item").querySelector("rect").width.baseVal.value)
      .map((e) => e.textContent),
    scroll: document.documentElement.scrollWidth <= innerWidth + 1 };
}"""  # noqa: E501 (a program)


@each_row("scene", ["triple_pendulum", "spring_mass"])
def test_the_first_view_is_whole_and_can_be_read(show, scene):
    page = show(scene)
    for version in "123":
        page.keyboard.press(version)
        first = page.evaluate(FIRST)
        assert first["cut"] == 0
        assert first["least"] >= 11.0
        assert first["wide"] == []
    small = show(scene, width=390, height=844).evaluate(FIRST)
    assert small["cut"] == 0
    assert small["scroll"]


def test_the_spurious_branch_is_seen_at_once_and_gone_by_the_chain_rule(show):
    page = show()
    assert page.locator(".item.box.wrong").count() > 5
    assert page.locator(".item.wrong .label").first.inner_html().count("spurious") == 1
    assert page.locator("#arm").is_visible()
    page.keyboard.press("u")
    assert page.locator(".item.wrong").count() == 55
    page.keyboard.press("3")
    assert page.locator(".item.wrong").count() == 0
    assert page.locator("#results td.off").count() == 5  # by definition all three, kinetic only all but the first's
    page.keyboard.press("2")
    assert re.match(r"Now tau.joint 2 is \S+ N m, by the chain rule 0 N m; tau.joint 3 is", page.inner_text("#now"))
    assert page.locator(".item.output.off").count() == 2
    page.keyboard.press("3")
    titles = page.locator(".column-title").all_text_contents()
    assert titles == ["link 1", "link 2", "link 3", "damping"]  # no column for the Euler step, which is not in it


def test_nodes_that_switch_are_dotted_and_in_the_legend(visit, tmp_path):
    x = cg.variable("x")
    for name, graph in (("smooth", cg.sin(x)), ("kinks", cg.where(cg.less(x, 1.0), abs(x), 2.0 * x))):
        (tmp_path / f"{name}.html").write_text(viz.page(cg.Graph([x], {"y": graph})), encoding="utf-8")
        page = visit(tmp_path / f"{name}.html")
        assert page.locator(".node.switch").count() == (2 if name == "kinks" else 0)
        assert ("switches: jumps or kinks" in page.inner_text("#legend")) == (name == "kinks")
    assert page.locator(".switch title").first.text_content() == "%1, less, switches: its value or its slope jumps"


def test_rows_without_nodes_are_not_named(show):
    """On a tall page the column of the Euler step is alone in its band, and the chain rule has nothing in it."""
    page = show(width=1400, height=2600)
    page.keyboard.press("3")
    highest = "Math.min(...Array.from(document.querySelectorAll('#scene .%s'), (e) => e.getBoundingClientRect().top))"
    assert page.evaluate(highest % "stage") > page.evaluate(highest % "column-title")


def test_hostile_names_stay_texts_in_the_browser(visit, tmp_path):
    """Every panel is filled, wide and narrow, light and dark; nothing runs, and the policy has nothing to refuse."""
    for text, width, scheme in ((HOSTILE[0], 1400, "light"), (HOSTILE[1], 390, "dark"), (HOSTILE[3], 390, "light")):
        (tmp_path / "page.html").write_text(hostile_page(text), encoding="utf-8")
        page = visit(tmp_path / "page.html", width=width, height=800, color_scheme=scheme)
        for _ in range(2):
            page.click("#unfold")
        for group in page.locator("g.item").all():
            group.dispatch_event("click")
            group.dispatch_event("pointerover")
        assert page.locator("#node math mi, #node math msub").count() > 0
        assert text in page.locator("#why").text_content() + page.locator("#node").text_content()
        assert page.locator("#inputs td").first.text_content() == text.replace(" ", "_")
        assert page.locator("#results th").nth(0).text_content() == text
        assert page.locator("img, body script:not([type]) ~ script, [onpointerover], [onload], [onerror]").count() == 0
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")


def test_detail_goes_from_nodes_to_bodies_and_back(show):
    page = show()
    page.click("#unfold")
    assert page.locator(".item.box").count() == 0
    nodes = graph_of(EMBEDDED).nodes
    assert page.locator(".item.node, .item.leaf").count() == sum(node.value is None for node in nodes)
    page.keyboard.press("f")
    sums = page.locator(".item.node").count()
    assert sums == 3  # what is a torque stands under it
    page.locator(".item.box").first.click()
    assert page.locator(".frame").count() == 1
    page.keyboard.press("f")
    page.keyboard.press("f")
    bodies = page.locator(".item.body")
    assert bodies.count() == 5
    counts = [
        re.fullmatch(r"(?:(\d+) of )?(\d+) (?:spurious|nodes?)", text)
        for text in bodies.locator(".value").all_text_contents()
    ]
    assert sum(int(found[1] or 0) for found in counts) == 55
    drawn = sum(int(found[2]) for found in counts) + sums + len(graph_of(EMBEDDED).inputs)
    assert drawn == sum(node.value is None for node in nodes)
    bodies.first.click()
    assert page.locator(".item.body").count() == 4
    assert page.locator(".item.box").count() > 0


def test_an_input_is_edited_once_for_all_versions_and_reset(show):
    page = show("spring_mass")
    before = page.inner_text("#results table")
    page.evaluate("window.told = []; inspector.onState((state) => told.push(state.qdd0)); 0")
    page.click("#state summary")
    assert not page.locator("#reset").is_visible()
    field = page.locator('#inputs input[aria-label="qdd.theta"]')
    field.fill("2.5")
    field.press("Enter")
    scene = dyn.scenes.load("spring_mass")
    state = page.evaluate("inspector.state()")
    assert state["qd0_old"] == pytest.approx(state["qd0"] - state["dt"] * 2.5)
    results = page.evaluate("inspector.results()")
    for name in ("by_definition", "kinetic_only", "chain_rule"):
        graph = dyn.inverse_dynamics(scene, name)
        expected = graph.evaluate({each: state[each] for each in graph.input_names})["tau0"]
        assert results[name.replace("_", " ")]["tau0"] == pytest.approx(expected)
        page.click(f'#versions button:text-is("{name.replace("_", " ")}")')
        assert page.input_value('#inputs input[aria-label="qdd.theta"]') == "2.5"
    assert page.inner_text("#results table") != before
    page.click("#reset")
    assert page.inner_text("#results table") == before
    assert not page.locator("#reset").is_visible()
    assert page.evaluate("told.length") == 3


def test_another_record_is_shown_in_place_of_the_first(show):
    page = show()
    other = show("spring_mass").evaluate("inspector.record()")
    page.evaluate("window.told = 0; inspector.onState(() => { told += 1; }); 0")
    page.evaluate("(record) => inspector.showRecord(record)", other)
    assert page.inner_text("h1") == "spring_mass"
    assert page.evaluate("told") == 2
    assert page.locator('#versions button:text-is("live")').count() == 0  # it moves the page's first model
    assert page.locator("#results tbody tr").count() == 1
    assert page.locator("#arm").get_attribute("aria-label") == "q.theta over time"  # it has no places
    assert "x1, y1" in page.locator("#frame").inner_text()
    assert not page.locator("#statetables").is_visible()


def test_two_clicks_ask_why(show):
    page = show()
    page.keyboard.press("3")
    page.locator('g[aria-label="q.joint 1"]').click()
    page.locator("#otau0").click()
    graph = graph_of()
    at = dict.fromkeys(graph.input_names, 0.5)
    assert f": {cg.why(graph, 'tau0', 'q0', at=at).count} paths" in page.inner_text("#why")
    paths = page.locator("#why .path").all_text_contents()
    assert len(set(paths)) == len(paths) == 5  # never shortened to the same
    assert page.locator(".onpath").count() > 2
    assert page.locator("#otau0.onpath.picked").count() == 1  # the output that was clicked, and the line to it
    assert page.locator('.line.onpath[data-to="otau0"]').count() == 1
    assert page.locator("#node math").count() == 1
    page.keyboard.press("Escape")
    assert page.locator(".onpath").count() == 0
    page.locator("#otau1").hover()
    assert page.locator(".item[data-part=ancestor]").count() > 10
    assert page.locator(".item[data-part=descendant]").count() == 0


def test_why_is_asked_by_name_and_answered_by_cause(show):
    page = show()
    page.keyboard.press("3")
    page.select_option('#why select[aria-label="what to explain"]', label="tau.joint 2")
    told = page.inner_text("#why")
    assert "tau.joint 2 is " in told
    assert " N m, the sum of" in told
    rows = page.locator("#why .causes tr")
    heads = [row.partition("\t")[0] for row in rows.all_inner_texts()]
    assert {"gravity", "inertia", "Coriolis", "sum"} <= set(heads)
    assert page.locator("#why .causebar span").first.evaluate("bar => bar.getBoundingClientRect().width") > 20
    page.select_option('#why select[aria-label="by what it depends on"]', label="by q.joint 1")
    assert "∂tau.joint 2 by q.joint 1 is " in page.inner_text("#why")
    assert page.locator("#why .path").count() == 5
    assert page.locator(".item.picked").count() >= 2
    assert page.locator("#why .wrong").count() == 0
    page.keyboard.press("1")
    page.select_option('#why select[aria-label="what to explain"]', label="tau.joint 2")
    assert page.locator("#why .cause.wrong").inner_text().startswith("spurious")
    assert "a mistake of the formulation. Without it" in page.inner_text("#why")
    page.select_option('#why select[aria-label="what to explain"]', label="gravity")
    assert page.locator("#why .causes tr").count() == 3
    page.locator("#otau0").click()
    assert "tau.joint 1 is " in page.inner_text("#why")


def test_search_finds_by_name_tag_and_number(show):
    page = show()
    graph = graph_of(EMBEDDED)
    tagged = sum("link 2" in node.tags and node.value is None for node in graph.nodes)
    operations = [node for node in graph.nodes if node.args]
    for text, found in (("link 2", tagged), ("%7", 1), ("v7", 1), (f"%{len(operations) + 1}", 0)):
        page.keyboard.press("/")
        page.keyboard.type(text)
        assert page.inner_text("#trail") == f"{found} node{'s' * (found != 1)} found"
        page.keyboard.press("Escape")
    page.fill("#search", "%7")
    page.press("#search", "Enter")
    assert page.inner_text("#node p").startswith(f"%7, {operations[6].op.name}, ")


def test_sweeps_step_forward_and_back(show):
    page = show()
    graph = graph_of(EMBEDDED)
    steps = ["Before the first node.", "forward, 1 of 249: ", "forward, 2 of 249: ", "forward, 1 of 249: "]
    for key, said in zip("]]][", steps, strict=True):
        page.keyboard.press(key)
        assert page.inner_text("#step").startswith(said)
    move = "(slider, to) => { slider.value = to; slider.oninput(); }"
    last = graph.nodes[-1]
    assert last is graph.outputs["tau2"]
    number = sum(bool(node.args) for node in graph.nodes)
    for output, adjoint in (("tau2", "1"), ("tau0", "0")):  # tau0 does not depend on tau2
        page.select_option("#from", output)
        page.eval_on_selector("#sweep", move, len(graph.nodes) + 1)
        assert page.inner_text("#step") == f"reverse, 1 of 249: tau.joint 3 (%{number}, +) has adjoint {adjoint}"
    page.eval_on_selector("#sweep", move, 2 * len(graph.nodes))
    shown = page.inner_text("#step").partition("reverse, 249 of 249: qdd.joint 1 has adjoint ")[2]
    at = {name: value for name, value in page.evaluate("inspector.state()").items() if name in graph.input_names}
    up, down = [graph.evaluate(at | {"qdd0": at["qdd0"] + sign * 1e-3})["tau0"] for sign in (1, -1)]
    assert float(shown.replace("−", "-")) == pytest.approx((up - down) / 2e-3, rel=5e-3)  # three digits are shown


def test_a_box_is_called_by_its_tags_and_says_how_many_nodes_it_has(show):
    page = show()
    page.keyboard.press("3")
    graph = graph_of()
    sums = set(graph.outputs.values())
    damping = sum("damping" in node.tags and node.value is None and node not in sums for node in graph.nodes)
    box = page.locator(f'[aria-label="damping, as written, {damping} nodes, folded"]')
    assert box.locator("text").first.text_content() == f"{damping} nodes"  # its column has the name
    drawn = sum(node.value is None for node in graph.nodes)
    said = f"{len(graph.inputs) + len(sums)} of {drawn} nodes unfolded; {len(graph.nodes) - drawn} constants"
    assert page.inner_text("#trail") == said


def test_the_motion_moves_the_values_and_the_tables(show):
    page = show()
    before = page.inner_text("#results"), page.inner_text("#statetables")
    page.evaluate("(s) => { s.value = 80; s.oninput(); }", page.query_selector("#time"))
    assert page.inner_text("#results") != before[0]
    assert page.inner_text("#statetables") != before[1]
    assert page.inner_text("#clock") == f"{80 * 3.0 / 89:.2f} s"


@each_row("links", [2, 3, 4, 10])
def test_no_table_is_cut_beside_the_picture_or_below_it(visit, tmp_path, links):
    """Rows and columns change places where that makes it fit; a table of many of both stands below the picture."""
    viz.inspect(dyn.scenes.load("chain", n=links), tmp_path / "arm.html", t_end=1.0)
    page = visit(tmp_path / "arm.html", width=1400, height=1000)
    for summary in page.locator("#wide summary").all():
        summary.click()
    tables = "[...document.querySelectorAll(':is(#results, #statetables, #wide) .scroll')]"
    assert page.evaluate(f"{tables}.map((each) => each.scrollWidth > each.clientWidth)") == [False, False]
    found = page.evaluate(f"{tables}[1].innerText.match(/[\\d−.e-]+(?=[\\t\\n]|$)/g).length")
    assert found >= links * (links + 1)
    assert page.locator("#wide tbody tr").count() == (links if links > 3 else 0)


def test_the_elimination_is_gone_through_joint_by_joint(show, written):
    assert cli.main(["inspect", "triple_pendulum", "--forward", "--out", str(written / "forward.html")]) == 0
    page = show("forward")
    said, lit = [], []
    for _ in range(6):
        page.click("#lessonon")
        said.append(page.inner_text("#lessonwords"))
        lit.append(
            page.eval_on_selector_all("#arm circle", "(all) => all.findIndex((e) => e.classList.contains('marked'))")
        )
        assert page.locator(".item.result").count() > 0 or "1 of 6" in said[-1]  # the tip's pivot is a constant
    assert lit == [2, 1, 0, 0, 1, 2]  # from the tip to the base, and back out
    assert [text.split("joint ")[1][0] for text in said] == ["3", "2", "1", "1", "2", "3"]
    page.keyboard.press("Escape")
    assert page.locator("#picture.teaching, .joint.marked, .item.lit").count() == 0
    assert not show("spring_mass").locator("#lesson").is_visible()


def test_the_mechanism_follows_the_state_and_carries_its_torques(show):
    page = show()
    sticks = "() => [...document.querySelectorAll('#arm .stick')].map((each) => each.getAttribute('d'))"
    before = page.evaluate(sticks)
    turns = page.locator("#arm .turn").count()
    assert turns >= 4
    page.evaluate("inspector.setState({ q0: 0.0, q1: 0.0, q2: 0.0 })")
    hanging = page.evaluate(sticks)
    assert hanging != before
    numbers = [float(each) for each in re.findall(r"-?[0-9.]+(?:e-?[0-9]+)?", " ".join(hanging))]
    assert max(map(abs, numbers[::2])) < 1e-9  # x
    page.click("#reset")
    assert page.evaluate(sticks) == before


def test_the_theme_can_be_switched_and_dark_is_dark(show):
    page = show(color_scheme="dark")
    light = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number).reduce((a, b) => a + b)"
    assert page.evaluate(light) < 200
    page.click("#theme")
    assert page.evaluate(light) > 600


def test_two_fingers_pinch_and_one_moves(show):
    page = show(width=390, height=844, has_touch=True)
    scale = "document.getElementById('scene').getCTM().a"
    where = page.locator("#picture").bounding_box()
    x, y = where["x"] + where["width"] / 2, where["y"] + where["height"] / 2
    client = page.context.new_cdp_session(page)

    def touch(kind, *points):
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": a, "y": b} for a, b in points]})

    before = page.evaluate(scale)
    touch("touchStart", (x - 30, y), (x + 30, y))
    for far in (40, 60, 90):
        touch("touchMove", (x - far, y), (x + far, y))
    touch("touchEnd")
    assert page.evaluate(scale) == pytest.approx(3 * before, rel=0.05)
    left = page.locator("#scene").bounding_box()["x"]
    touch("touchStart", (x, y))
    for way in (10, 30, 50):
        touch("touchMove", (x + way, y))
    touch("touchEnd")
    assert page.locator("#scene").bounding_box()["x"] == pytest.approx(left + 50, abs=2)
    assert page.evaluate(scale) == pytest.approx(3 * before, rel=0.05)


def test_the_keyboard_alone_does_everything(show):
    """Views as tabs, a walk over nodes, folding, values, playing, asking, letting go."""
    page = show()
    page.locator("#versions button").first.focus()
    assert page.evaluate("document.activeElement.textContent") == "by definition"
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("document.activeElement.textContent") == "chain rule"
    assert page.locator('#versions [aria-selected="true"]').text_content() == "chain rule"
    reached = set()
    page.evaluate("document.activeElement.blur()")
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.tagName"))
    assert {"search", "fold", "unfold", "values", "fit", "theme", "picture", "play", "time", "sweep", "from"} <= reached
    page.focus("#picture")
    for key in ("ArrowUp", "ArrowDown", "ArrowDown", "Enter"):
        page.keyboard.press(key)
    assert page.locator(".item.picked").count() > 0
    assert page.locator(".frame").count() == 1
    page.keyboard.press("v")
    assert page.locator("#picture.values").count() == 1
    page.keyboard.press("Space")
    assert "stop" in page.inner_text("#play")
    page.keyboard.press("Space")
    assert "play" in page.inner_text("#play")
    page.keyboard.press("Escape")
    assert page.locator(".item.picked").count() == 0


def test_print_keeps_the_picture_legend_results_and_version(show):
    page = show(color_scheme="dark")
    page.emulate_media(media="print")
    for kept in ("h1", "#picture", "#legend", "#results", "#version", '#versions [aria-selected="true"]', "#about"):
        assert page.locator(kept).is_visible(), kept
    for gone in ("#search", "#play", "#sweep", "#fold", "#keys"):
        assert not page.locator(gone).is_visible(), gone
    assert page.inner_text("#version").startswith("cgraph ")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
