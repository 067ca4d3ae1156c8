"""`cgraph draw`: the graph of a scene's equations as a picture, as DOT, or as a list."""

from __future__ import annotations

import argparse
from pathlib import Path

from cgraph.extend import atomic_write
from dynamics import inverse_dynamics, spurious_nodes

from ..graph_drawing.dot import to_dot
from ..graph_drawing.render import render_png, render_svg
from .arguments import Commands, scene_of, takes_a_formulation, takes_a_scene


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "draw", help="draw the graph of a scene's equations (SVG, PNG or DOT) or list it (TXT)"
    )
    takes_a_scene(parser)
    takes_a_formulation(parser)
    parser.add_argument("--out", type=Path, required=True, help="file to write: .svg, .png, .dot or .txt")
    parser.add_argument(
        "--collapse", action="append", default=[], metavar="TAG", help="draw all nodes of a tag as one box"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the file."""
    scene = scene_of(options)
    graph = inverse_dynamics(scene, options.formulation)
    counts = graph.counts()
    kind = options.out.suffix
    if kind == ".txt":
        atomic_write(options.out, graph.listing())
    elif kind in (".dot", ".svg", ".png"):
        caption = f"{scene.name}: inverse dynamics, {options.formulation.replace('_', ' ')}"
        drawing = to_dot(graph, marked=spurious_nodes(graph), collapse=options.collapse, caption=caption)
        if kind == ".dot":
            atomic_write(options.out, str(drawing.source))
        else:
            svg = render_svg(drawing)
            atomic_write(options.out, svg if kind == ".svg" else render_png(svg))
    else:
        raise ValueError(f"--out must end in .svg, .png, .dot or .txt, got {options.out}")
    print(f"{options.out}: {counts.nodes} nodes, {counts.edges} edges")
