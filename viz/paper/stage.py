"""The figure that moves: graphs on one layout, chosen by a button, with every node's formula and value at a step dt."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from cgraph import Graph
from cgraph._shared import Json

from .. import theme
from ..pages.document import Picture
from .fixed_layout import OUTPUT, View, spoken, stage_svg, written

FIRST_STEP = 2  # of `steps`, what the slider shows first


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
        """What the page's script reads: texts, and a value at each step."""
        views: dict[str, Json] = {
            name: {
                "caption": self.captions[name],
                "words": f"Graph. {spoken(view.graph, self.letters)}",
                "nodes": self._nodes(view),
            }
            for name, view in self.views.items()
        }
        steps = [_number(step) for step in self.steps]
        return {"steps": steps, "first": FIRST_STEP, "views": views, "compared": self._compared()}

    def _nodes(self, view: View) -> dict[str, Json]:
        """{place: what a reader is told of it}, in the order of computation."""
        every = Graph(view.graph.inputs, {place: shape.node for place, shape in view.shapes.items()})
        values = [every.evaluate(_known(view, state)) for state in self.states]
        nodes: dict[str, Json] = {}
        for place, shape in view.shapes.items():
            roles = " and ".join(sorted(shape.node.roles - {"input"}))
            told = shape.kind if shape.kind == OUTPUT or not roles else f"{shape.kind}: {roles}"
            what = f"{told} · there by mistake" if shape.paint == theme.MARKED else told
            formula = written(view.graph, shape.node, self.letters)
            name = shape.texts[0].replace(" old", "_old")
            text = f"{name} = {formula}" if shape.named and name != formula else formula
            nodes[place] = [text, what, [_number(float(each[place])) for each in values]]
        return nodes

    def _compared(self) -> list[Json]:
        """Rows of the table: a view's title, and the output at each step with what it has too much."""
        found = {
            name: [float(view.graph.evaluate(_known(view, state))[self.output]) for state in self.states]
            for name, view in self.views.items()
        }
        *_, right = found.values()
        return [
            [name, [*map(_number, values)], [_number(a - b) for a, b in zip(values, right, strict=True)]]
            for name, values in found.items()
        ]


def _known(view: View, state: Mapping[str, float]) -> dict[str, float]:
    return {name: state[name] for name in view.graph.input_names}


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
