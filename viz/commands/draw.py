"""`cgraph draw`: the graph of a scene's equations as a picture, as DOT, or as a list."""

from __future__ import annotations

import argparse
from dataclasses import replace

import cgraph as cg
import dynamics as dyn
from cgraph import _shared

from . import library
from .arguments import answer, collapsed, equations_of, place, scene_of, takes_equations
from .command import Command, flag

PICTURES = (".svg", ".png")
KINDS = (*PICTURES, ".dot", ".txt")


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_equations(parser)
    flag(parser, "--inertial-term", "p and dp/dt alone, as in the paper's figures, by the --formulation")
    parser.add_argument("--out", type=place, required=True, help="file to write: .svg, .png, .dot or .txt")
    parser.add_argument(
        "--collapse",
        action="append",
        metavar="A,B",
        help="draw all nodes of a tag as one box (default: of all tags if a picture needs it); '' for none",
    )


def run(options: argparse.Namespace) -> None:
    """Write the file."""
    kind = options.out.suffix
    if kind not in KINDS:
        raise ValueError(f"--out must end in {', '.join(KINDS[:-1])} or {KINDS[-1]}, got {options.out}")
    if kind == ".txt" and options.collapse is not None:
        raise ValueError(f"--collapse goes with {', '.join(KINDS[:-1])}: a list has every node, got {options.out}")
    _shared.check_writable(options.out)
    if kind in PICTURES:
        library.check_can_draw(png=kind == ".png")
    scene = scene_of(options)
    if options.inertial_term and (options.forward or options.momentum or scene.ode is not None):
        raise ValueError("--inertial-term is of a Lagrangian, by a --formulation")
    graph, what, verdict = equations_of(options, scene)
    if options.inertial_term:
        graph, wrong = library.blamed(scene, library.INERTIAL_TERM, options.formulation)
        off = {name.replace("tau", "p") + "_dot": each for name, each in verdict.excess.items()} if verdict else {}
        verdict = verdict and replace(verdict, graph=graph, nodes=wrong.nodes, edges=wrong.edges, excess=off)
        what = what.replace("inverse dynamics", library.INERTIAL_TERM)
    names = dyn.display_names(scene)
    content: str | bytes
    if kind == ".txt":  # the listing, and above it what a person calls inputs and outputs
        called = [name for name in (*graph.input_names, *graph.outputs) if name in names]
        content = "".join([f"# {name} is {names[name]}\n" for name in called]) + graph.listing()
    else:
        if options.collapse is None:
            tags = collapsed(graph) if kind in PICTURES else []
        else:
            tags = [tag for each in options.collapse for tag in tags_of(each, graph)]
        caption, legend = f"{scene.name}: {what}", library.theme.MOTION_WORDS if options.momentum else True
        drawing = library.judged_drawing(graph, verdict, names=names, collapse=tags, caption=caption, legend=legend)
        content = str(drawing.source) if kind == ".dot" else library.render_svg(drawing)
        content = library.render_png(content) if kind == ".png" else content
    counts = graph.counts()
    answer(
        f"{options.out}: {_shared.counted(counts.nodes, 'node')}, {_shared.counted(counts.edges, 'edge')}",
        {options.out: content},
    )


def tags_of(text: str, graph: cg.Graph) -> list[str]:
    """The tags in `a,b`; a tag may have a comma itself."""
    carried = {tag for node in graph.nodes for tag in node.tags}
    return [text] if text in carried else [tag.strip() for tag in text.split(",") if tag.strip()]
