"""The box at work, in V8: what is typed reaches the inspector, what is wrong is said below, links hold the text."""

import json

from py_mini_racer import MiniRacer

from tests.page_script import DOCUMENT
from viz.inspector.page import scripts
from viz.typed.text_page import box

# What a browser has and V8 has not, as far as the box asks for it.
BROWSER = """
const byIds = new Map();
document.getElementById = (id) => {
  const more = { value: "", after() {}, focus() {}, toggleAttribute() {} };
  if (!byIds.has(id)) byIds.set(id, Object.assign(made("", id), more));
  return byIds.get(id);
};
globalThis.location = { hash: "", protocol: "file:", href: "file:///page.html" };
globalThis.history = { replaceState: (_, __, hash) => { location.hash = hash; } };
globalThis.Event = class {};
globalThis.dispatchEvent = globalThis.addEventListener = globalThis.setTimeout = globalThis.clearTimeout = () => {};
globalThis.navigator = {};
globalThis.shown = [{ title: "before" }];
globalThis.inspector = { record: () => shown.at(-1), showRecord: (record) => shown.push(record) };
const text = (each) => (typeof each === "string" ? each : [each.textContent, ...each.inside.map(text)].join(""));
const press = (words) => {
  byId("text").value = words;
  byId("text").onkeydown({ key: "Enter", ctrlKey: true, stopPropagation() {} });
};
const state = () => [byId("typed").hidden, byId("text").value, shown.length, shown.at(-1).title];
"""
GOOD, LINK = "L = x'^2 - x^2", "#text=L%20%3D%20x'%5E2%20-%20x%5E2"
WORDS = "Line 2: There is no “k”: a line such as k = 1 gives its value."


def test_the_box_shows_what_is_typed_and_says_what_is_wrong():
    page = MiniRacer()
    page.eval(f'"use strict";\n{DOCUMENT}\n{scripts()}\n{box().script}\n{BROWSER}')

    def said(program: str) -> list[object]:
        found: list[object] = json.loads(page.eval(f"JSON.stringify((() => {{ {program} }})())"))
        return found

    # The box of another page is closed, holds that page's text, and shows nothing by itself.
    assert said(f"startTyped(inspector, {json.dumps(GOOD)}, false); return state();") == [True, GOOD, 1, "before"]
    found = said(f"press({json.dumps(GOOD)}); return [...state().slice(2), text(byId('wrong')), location.hash];")
    assert found == [2, "Your Lagrangian", "", LINK]
    # What is wrong is said, and changes nothing else.
    wrong = "x(0) = 1\nL = x'^2 - k*x^2"
    found = said(f"press({json.dumps(wrong)}); return [shown.length, text(byId('wrong')), location.hash];")
    still = "Picture and results are still those of the text before."
    assert found == [2, WORDS + wrong.splitlines()[1] + still, LINK]
    other = "location.hash = '#live=a:1,b&text=L%3D'; keepLink('m = 1 &'); return [location.hash, linkedText()];"
    assert said(other) == ["#text=m%20%3D%201%20%26&live=a:1,b", "m = 1 &"]  # the rest stays as it is
    assert said("location.hash = '#text=%'; return [linkedText()];") == ["%"]
    assert said('location.hash = "#"; byId("back-to").onclick(); return [shown.at(-1).title, location.hash];') == [
        "before",
        "#",
    ]
    # A link opens the box; with nothing else on the page, its text is what is shown first, if it means something.
    found = said(f"""location.hash = "{LINK}"; startTyped(inspector, "", false); return state();""")
    assert found == [False, GOOD, 4, "Your Lagrangian"]
    first = "return firstTyped(TYPED.EXAMPLES.get('Kepler')).called[0];"
    assert said(first) == ["q0", "q.x"]
    assert said(f"location.hash = '#text=L%3D'; {first.replace('[0]', '[1]')}") == ["q0_old", "q_old.x"]
    page.close()
