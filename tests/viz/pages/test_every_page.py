"""Every page is one file that loads nothing, whose policy lets its own script and style alone run."""

import base64
import hashlib
import re

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from tests.viz.page_elements import Elements
from viz.inspector import Table
from viz.pages.document import Document, Picture, Section, to_html
from viz.paper.one_joint import equations, figures_1_to_3
from viz.paper.paper import page_of

SVG, MATHML = "http://www.w3.org/2000/svg", "http://www.w3.org/1998/Math/MathML"  # names, not addresses
ARM = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
X = cg.variable("x")
PAGES = {  # kind: its page, bytes at most, and the one thing that its policy allows besides
    "inspect": (lambda: viz.inspect(ARM, t_end=0.2), 400_000, ""),
    "page": (lambda: viz.page(cg.Graph([X], {"y": cg.sin(X)}), tables=[Table("t", ["a"], [["b"]])]), 200_000, ""),
    "live": (lambda: viz.live(ARM), 60_000, ""),
    "typed": (viz.typed_page, 500_000, ""),
    "lesson": (lambda: viz.lesson(ARM), 200_000, ""),
    "paper": (lambda: page_of([equations(), figures_1_to_3()], {}), 200_000, ""),
    "document": (
        lambda: to_html(Document("d", [], [Section("s", "S", [Picture("p", "<svg/>", "c"), Table("t", ["a"], [])])])),
        20_000,
        "style-src 'unsafe-inline'",  # it has no script
    ),
}


@pytest.mark.parametrize("kind", PAGES)
def test_a_page_is_one_small_strict_file(kind: str) -> None:
    make, most, allowed = PAGES[kind]
    text = make()
    found = Elements(text)
    ids = [attributes["id"] for _, attributes in found.elements if "id" in attributes]
    assert len(text.encode()) < most
    assert (found.open, sorted(set(ids))) == ([], sorted(ids))
    assert set(re.findall(r"https?://[^\s\"'<]+", re.sub(r"<!DOCTYPE[^>]*>|xmlns\S*", "", text))) <= {SVG, MATHML}
    sources = [attributes.get(key) for _, attributes in found.elements for key in ("src", "href") if key in attributes]
    assert [each for each in sources if not str(each).startswith(("data:", "#"))] == []
    assert "prefers-color-scheme: dark" in text
    kinds = [attributes.get("type") for name, attributes in found.elements if name == "script"]  # of the data: JSON
    scripts = [each for each, what in zip(found.texts.get("script", []), kinds, strict=True) if what is None]
    loading = r"@import|url\(|fetch\(|XMLHttpRequest|import\(|localStorage"
    assert not re.search(rf"{loading}|HTML\b|document\.write|\b(eval|Function)\b", "".join(scripts))
    (policy,) = [attributes["content"] for _, attributes in found.elements if "http-equiv" in attributes]
    assert policy is not None
    assert policy.startswith("default-src 'none'; ")
    assert (policy.count("unsafe"), allowed in policy) == (allowed.count("unsafe"), True)
    for what, run in (("script", scripts), ("style", found.texts["style"] if scripts else [])):
        digests = [base64.b64encode(hashlib.sha256(each.encode()).digest()).decode() for each in run]
        assert [each for each in digests if f"{what}-src 'sha256-{each}'" not in policy] == []
        assert len(run) == bool(scripts)
    keys = {key for _, attributes in found.elements for key in attributes}
    assert not {key for key in keys if key.startswith("on") or (key == "style" and scripts)}
