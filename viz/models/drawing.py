"""The drawing of a model's equations: one picture, with what is wrong in them painted."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from cgraph import Graph, Node
from cgraph._shared import check_writable, require_path, write_files
from dynamics import Verdict, display_names, formulation_verdict, scenes, state_equation
from dynamics.systems.model import Model

from ..graph_drawing.dot import to_dot
from ..graph_drawing.render import check_can_draw, render_png, render_svg, tags_to_collapse

if TYPE_CHECKING:
    from graphviz import Digraph

KINDS = (".svg", ".png", ".dot")


class Picture(str):
    """A drawing as SVG text, which a notebook shows."""

    __slots__ = ()

    def _repr_svg_(self) -> str:
        return str(self)


def draw(
    model: Model | Graph, path: str | os.PathLike[str] | None = None, *, formulation: str = "chain_rule"
) -> Picture:
    """The drawing of inverse dynamics, or of any graph; nodes and edges that make a formulation wrong are painted.

    Of more than 500 nodes those of a tag are one box. `viz.to_dot` has all that may be chosen.

    Parameters
    ----------
    model : Model or Graph
        A System, a Mechanism or a Scene; of an OdeSystem the state equation is drawn, and a Graph as it is.
    path : str or path, optional
        The file to write the drawing to: .svg, .png or .dot.
    formulation : str
        One of `dynamics.FORMULATIONS`, for a model.

    Returns
    -------
    Picture
        The SVG text; a notebook shows it.

    Raises
    ------
    TypeError
        For what is no model and no graph.
    ValueError
        For another formulation, and for a path with another ending.
    ImportError
        Where the extra `viz` is missing.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> picture = viz.draw(dyn.scenes.load("spring_mass"), formulation="by_definition")
    >>> "spurious" in picture
    True
    """
    target = None if path is None else require_path("the picture's file", path)
    if target is not None and target.suffix not in KINDS:
        raise ValueError(f"the picture's file must end in {', '.join(KINDS[:-1])} or {KINDS[-1]}, got {str(target)!r}")
    if target is not None:
        check_writable(target)
    check_can_draw(png=target is not None and target.suffix == ".png")
    if isinstance(model, Graph):
        drawing = to_dot(model, collapse=tags_to_collapse(model))
    elif isinstance(model, Node):
        raise TypeError(f"draw takes a model or a graph, got {model!r:.60}: cg.Graph(inputs, {{name: node}}) has it")
    else:
        scene = scenes.of_model(model)
        verdict = None if scene.ode is not None else formulation_verdict(scene, formulation)
        graph = state_equation(scene) if verdict is None else verdict.graph
        what = "state equation" if verdict is None else f"inverse dynamics, {formulation.replace('_', ' ')}"
        caption, names = f"{scene.name}: {what}", display_names(scene)
        drawing = judged_drawing(graph, verdict, names=names, collapse=tags_to_collapse(graph), caption=caption)
    svg = Picture(render_svg(drawing))
    if target is not None:
        texts = {".svg": str(svg), ".dot": str(drawing.source)}
        content: str | bytes = render_png(svg) if target.suffix == ".png" else texts[target.suffix]
        write_files({target: content})
    return svg


def judged_drawing(graph: Graph, verdict: Verdict | None, **options: Any) -> Digraph:
    """The drawing of equations, with nodes, edges and outputs painted that their verdict, if they have one, blames.

    options: as of `to_dot`.
    """
    if verdict is not None:
        options |= {"marked": verdict.nodes, "marked_edges": verdict.edges, "wrong_outputs": tuple(verdict.excess)}
    return to_dot(graph, **options)
