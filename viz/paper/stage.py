"""The figure that moves: graphs on one layout, chosen by a button, with every node's formula and value at a step dt."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

from cgraph import Edge, Graph, Node
from cgraph._shared import Json, columns
from cgraph.extend import Names

from .. import theme
from ..graph_drawing.dot import short_formulas
from ..graph_drawing.render import Size, positions
from ..pages.document import Picture
from ..theme import Paint

# Pixels: a letter's width, heights of shapes, room at the sides.
LETTER, LEAF, OPERATION, MARGIN = 8.6, 30.0, 46.0, 18.0
FONT, SMALL = 15, 13  # pixels
_NUMBERED = re.compile(r"%[0-9]+")  # a node without a name in a formula
FIRST_STEP = 2  # of `steps`, what the slider shows first
OUTPUT, INPUT, NODE = "output", "input", "operation"


class Shape(NamedTuple):
    """One box or ellipse.  texts: its lines.  node: what it stands for; of an output, the node that computes it.

    named: whether the first text is a name.
    """

    kind: str
    paint: Paint
    texts: tuple[str, ...]
    node: Node
    named: bool = True

    @property
    def size(self) -> Size:
        """Width and height in pixels."""
        room = LETTER * max(map(len, self.texts))
        return (max(44.0, room + 26.0), OPERATION) if self.kind == NODE else (max(34.0, room + 18.0), LEAF)


@dataclass(frozen=True)
class View:
    """One graph as it is drawn: {place: shape} and {(place, place): arrow}, by places that all views share.

    An arrow is the argument's number, where the order matters, else empty, and whether it is wrong.
    wrong, wrong_edges: the operations and edges that are painted so.
    """

    graph: Graph
    shapes: Mapping[str, Shape]
    arrows: Mapping[tuple[str, str], tuple[str, bool]]
    wrong: frozenset[Node]
    wrong_edges: frozenset[Edge]

    def drawn(self) -> dict[str, int]:
        """How many shapes and arrows of each kind the drawing has; wrong ones are among the others."""
        kinds = [shape.kind for shape in self.shapes.values()]
        to_outputs = [self.shapes[target].kind == OUTPUT for _, target in self.arrows]
        return {
            "inputs": kinds.count(INPUT),
            "operations": kinds.count(NODE),
            "outputs": kinds.count(OUTPUT),
            "edges": to_outputs.count(False),
            "output_arrows": to_outputs.count(True),
            "wrong_operations": len(self.wrong),
            "wrong_edges": len(self.wrong_edges),
        }

    def inputs_of_mistakes(self) -> list[str]:
        """The texts of inputs all of whose arrows are wrong."""
        sound = {source for (source, _), (_, wrong) in self.arrows.items() if not wrong}
        return [shape.texts[0] for place, shape in self.shapes.items() if shape.kind == INPUT and place not in sound]


def view_of(
    graph: Graph, names: Mapping[str, str], wrong: Collection[Node] = (), wrong_edges: Collection[Edge] = ()
) -> View:
    """A graph as it is drawn, without constants.  names: {name in the graph: text shown}.

    A wrong operation is painted so, with the arrows out of it; an input that serves nothing else is no mistake itself.
    """
    if strange := [node for node in graph.nodes if node.value is not None]:
        raise ValueError(f"a fixed layout has no constants, got {len(strange)}, such as {strange[0]!r}")
    places, formulas = _places(graph), short_formulas(graph, names)
    wrong_edges = frozenset([edge for edge in graph.edges if edge.source in wrong or edge in wrong_edges])
    wrong = frozenset([node for node in wrong if node.args])
    shapes = {places[node]: _shape(node, names, formulas, node in wrong) for node in graph.nodes}
    arrows = {}
    for edge in graph.edges:
        op = edge.target.op
        slot = str(edge.slot + 1) if op.arity > 1 and not op.commutative else ""
        arrows[places[edge.source], places[edge.target]] = slot, edge in wrong_edges
    for name, node in graph.outputs.items():
        place = f"output {name}"
        shapes[place] = Shape(OUTPUT, theme.OUTPUT, (names.get(name, theme.pretty(name)),), node)
        arrows[places[node], place] = "", node in wrong
    return View(graph, shapes, arrows, wrong, wrong_edges)


def _places(graph: Graph) -> dict[Node, str]:
    """{node: its place}: its name, whether it is an input or computed, else its operation on the places of its arguments."""
    places: dict[Node, str] = {}
    for node in graph.nodes:
        arguments = [places[each] for each in node.args]
        listed = ", ".join(sorted(arguments) if node.op.commutative else arguments)
        places[node] = node.name or f"{node.op.name}({listed})"
    return places


def _shape(node: Node, names: Mapping[str, str], formulas: Mapping[Node, str], wrong: bool) -> Shape:
    text = names.get(node.name, theme.pretty(node.name)) if node.name else formulas.get(node, "")
    if not node.args:
        return Shape(INPUT, theme.ROLES["input"], (text,), node)
    paint = theme.MARKED if wrong else theme.ROLES[theme.role_of(node)]
    return Shape(NODE, paint, tuple(filter(None, (text, columns(node.op).symbol))), node, bool(node.name))


def stage_svg(views: Mapping[str, View], shown: str) -> str:
    """All views on one layout, as SVG for a page; elements of other views than the one shown have the class `off`.

    An element that looks the same in several views is one, with their names in `data-views`.
    """
    centers, lines, (width, height) = _layout(list(views.values()))
    arrows: dict[tuple[str, str], list[str]] = {}
    boxes: dict[tuple[str, str], list[str]] = {}
    for name, view in views.items():
        for (source, target), arrow in view.arrows.items():
            drawn = _arrow(lines[source, target], *arrow, centers[target], view.shapes[target])
            arrows.setdefault(drawn, []).append(name)
        for place, shape in view.shapes.items():
            boxes.setdefault(_box(place, shape, centers[place]), []).append(name)
    parts = [
        f'<g class="{kind}{" off" * (shown not in names)}" data-views="{" ".join(names)}"{rest}</g>'
        for (kind, rest), names in (arrows | boxes).items()
    ]
    width += 2 * MARGIN
    return (
        f'<svg viewBox="{-MARGIN:.0f} 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}" '
        f'font-family="{theme.FONT_FAMILIES}" font-size="{FONT}" text-anchor="middle">{"".join(parts)}</svg>'
    )


def _layout(views: Sequence[View]) -> tuple[dict[str, Size], dict[tuple[str, str], str], Size]:
    """Where the places of all views are, as wide and high as the largest shape at each; lines, and the whole size."""
    sizes: dict[str, Size] = {}
    for view in views:
        for place, shape in view.shapes.items():
            wide, high = sizes.get(place, (0.0, 0.0))
            sizes[place] = max(wide, shape.size[0]), max(high, shape.size[1])
    number = {place: i for i, place in enumerate(sizes)}
    pairs = list(dict.fromkeys([pair for view in views for pair in view.arrows]))
    (found,) = positions((tuple(sizes.values()), tuple([(number[a], number[b]) for a, b in pairs])))
    lines = {(a, b): found.lines[number[a], number[b]] for a, b in pairs}
    return dict(zip(sizes, found.centers, strict=True)), lines, found.size


def _arrow(path: str, slot: str, wrong: bool, center: Size, target: Shape) -> tuple[str, str]:
    """Class and content of an arrow to a shape."""
    x, y = center
    kind = " ".join(["arrow", *["wrong"] * wrong, *["to-output"] * (target.kind == OUTPUT)])
    start = float(path[1:].split(maxsplit=1)[0])
    side = -1.0 if start < x else 1.0  # below the shape, on the side that the argument comes from
    below = y + target.size[1] / 2 + 12
    number = f'<text x="{x + side * 26:.1f}" y="{below:.1f}" font-size="{SMALL}">{slot}</text>' * bool(slot)
    return kind, f'><path d="{path}"/>{number}'


def _box(place: str, shape: Shape, center: Size) -> tuple[str, str]:
    """Class and content of a shape."""
    (x, y), (w, h) = center, shape.size
    paint, box = shape.paint, f'x="{x - w / 2:.1f}" y="{y - h / 2:.1f}" width="{w:.1f}" height="{h:.1f}"'
    look = f'fill="{paint.fill}" stroke="{paint.line}"'
    if shape.kind == NODE:
        outline = f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{w / 2:.1f}" ry="{h / 2:.1f}" {look}/>'
    elif shape.kind == INPUT:
        outline = f'<rect {box} rx="7" {look}/>'
    else:
        inner = f'x="{x - w / 2 + 3:.1f}" y="{y - h / 2 + 3:.1f}" width="{w - 6:.1f}" height="{h - 6:.1f}"'
        outline = f"<rect {box} {look}/><rect {inner} {look}/>"
    top = y + 5 - 9 * (len(shape.texts) - 1)
    texts = "".join(
        [
            f'<text x="{x:.1f}" y="{top + 18 * i:.1f}">{subscripts(escape(each))}</text>'
            for i, each in enumerate(shape.texts)
        ]
    )
    kind = f"box {shape.kind}{' wrong' * (paint == theme.MARKED)}"
    return kind, f' data-place="{escape(place)}">{outline}{texts}'


def subscripts(text: str) -> str:
    """A text of SVG with "old" of an earlier state as a subscript."""
    return text.replace(" old", f'<tspan dy="4" font-size="{SMALL - 1}">old</tspan>')


def spoken(graph: Graph, names: Mapping[str, str]) -> str:
    """A graph in words: what goes in, and what each named node and each output is computed from."""
    called = Names(graph, names)
    inputs = ", ".join([called.shown(str(node.name)) for node in graph.nodes if not node.args])
    results = [(called.shown(str(node.name)), node) for node in graph.nodes if node.args and node.name]
    results += [(names.get(name, theme.pretty(name)), node) for name, node in graph.outputs.items()]
    return f"Inputs {inputs}. {'; '.join([f'{name} = {written(graph, node, names)}' for name, node in results])}."


def written(graph: Graph, node: Node, names: Mapping[str, str]) -> str:
    """The formula of a node, down to what has a name, in the letters of a drawing; of an input its name."""
    called = Names(graph, names)
    numbered = {f"%{number}": each for each, number in called.number.items()}
    text = called.formula(node) if node.args else called.short(node)
    while found := _NUMBERED.search(text):
        part = called.formula(numbered[found[0]])
        inside = f"({part})" if " + " in part or " - " in part else part
        text = text[: found.start()] + inside + text[found.end() :]
    return text.replace(" * ", " ").replace("-", "−")


@dataclass(frozen=True)
class Stage:
    """What the figure shows.

    views: {name: graph}, the first shown first, the last the one that is right.  titles, captions: of the views.
    letters: {name in the graphs: name in a line of text}.  steps: of dt, largest first [s].  states: values of the inputs
    at each.  output, called: the output that the figure compares, and what it is called.
    """

    views: Mapping[str, View]
    titles: Mapping[str, str]
    captions: Mapping[str, str]
    letters: Mapping[str, str]
    steps: Sequence[float]
    states: Sequence[Mapping[str, float]]
    output: str
    called: str

    def data(self) -> dict[str, Json]:
        """What the page's script reads: texts, a value at each step, and what the output has too much."""
        views, found = dict[str, Json](), dict[str, list[float]]()
        for name, view in self.views.items():
            every = Graph(view.graph.inputs, {place: shape.node for place, shape in view.shapes.items()})
            values = [every.evaluate({each: state[each] for each in every.input_names}) for state in self.states]
            nodes: dict[str, Json] = {
                place: [*self._told(view.graph, shape), [_number(float(each[place])) for each in values]]
                for place, shape in view.shapes.items()
            }
            words = f"Graph. {spoken(view.graph, self.letters)}"
            views[name] = {"caption": self.captions[name], "words": words, "nodes": nodes}
            found[name] = [float(each[f"output {self.output}"]) for each in values]
        *_, right = found.values()
        compared: list[Json] = [
            [name, [*map(_number, values)], [_number(a - b) for a, b in zip(values, right, strict=True)]]
            for name, values in found.items()
        ]
        return {"steps": [*map(_number, self.steps)], "first": FIRST_STEP, "views": views, "compared": compared}

    def _told(self, graph: Graph, shape: Shape) -> tuple[str, str]:
        """The formula of a shape, and what it is."""
        roles = " and ".join(sorted(shape.node.roles - {"input"}))
        told = shape.kind if shape.kind == OUTPUT or not roles else f"{shape.kind}: {roles}"
        formula = written(graph, shape.node, self.letters)
        name = shape.texts[0].replace(" old", "_old")
        text = f"{name} = {formula}" if shape.named and name != formula else formula
        return text, f"{told} · there by mistake" if shape.paint == theme.MARKED else told


def _number(value: float) -> str:
    return f"{value:.4g}".replace("e-0", "e-").replace("-", "−")


def stage_html(stage: Stage, told: str, legend: Picture) -> str:
    """The figure as HTML, for the page's style and script.  told: where its values are taken."""
    first, buttons, rows = next(iter(stage.views)), "", ""
    for name, title in stage.titles.items():
        checked, words = " checked" * (name == first), escape(title)
        buttons += f'<label><input type="radio" name="view" value="{name}"{checked}>{words}</label>'
        rows += f'<tr data-view="{name}"><td>{words}</td><td></td><td></td></tr>'
    return (
        f'<figure class="stage"><fieldset><legend>Formulation</legend>{buttons}</fieldset>'
        f'<div id="graph" role="group" aria-roledescription="graph">{stage_svg(stage.views, first)}</div><div class="beside">'
        '<p id="told">Point at a node, or tap it, or walk through the graph with the arrow keys.</p>'
        f'<p class="step"><label for="dt">Step dt</label><input id="dt" type="range" min="0" max="{len(stage.steps) - 1}" '
        f'value="{FIRST_STEP}" step="1" aria-describedby="at"><output for="dt"></output></p>'
        f'<table id="compared"><thead><tr><th></th><th>{escape(stage.called)}</th><th>of it too much</th></tr></thead>'
        f'<tbody>{rows}</tbody></table><p id="at">{escape(told)}</p>{legend.html()}</div>'
        f'<figcaption id="caption">{escape(stage.captions[first])}</figcaption>'
        '<details><summary>This graph as text</summary><p id="words"></p></details></figure>'
    )
