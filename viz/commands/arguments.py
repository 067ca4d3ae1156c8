"""The arguments that several commands share: a scene, a formulation, a picture; and what they stand for."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

from cgraph import Graph
from cgraph.extend import atomic_write
from dynamics import FORMULATIONS, scenes

from ..graph_drawing.render import Drawing, render_svg

Commands = argparse._SubParsersAction  # what `add_subparsers` returns has no public name


def takes_a_scene(command: argparse.ArgumentParser) -> None:
    """The arguments that `scene_of` reads."""
    command.add_argument("scene", metavar="SCENE", help=f"{', '.join(scenes.names())}, or a model file, MJCF or URDF")
    may_ignore(command)


def may_ignore(command: argparse.ArgumentParser) -> None:
    """The argument by which what cannot be modeled is left out."""
    command.add_argument("--ignore", action="store_true", help="leave out what of a model file cannot be modeled")


def scene_of(options: argparse.Namespace) -> scenes.Scene:
    """The scene that the arguments name; what of a file is left out goes to standard error, a line each."""
    scene = scenes.load(options.scene, **({"ignore": True} if options.ignore else {}))
    for what in scene.omitted:
        say(f"{scene.name}: left out {what}")
    return scene


def say(line: str) -> None:
    """A line of progress or of warning, on standard error."""
    print(f"cgraph: {line}", file=sys.stderr, flush=True)


def takes_a_formulation(command: argparse._ActionsContainer) -> None:
    """The argument `--formulation`."""
    command.add_argument(
        "--formulation", default="chain_rule", choices=sorted(FORMULATIONS), help="default: chain_rule"
    )


def whole(text: str) -> int:
    """A whole number, at least 0, for argparse."""
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"expected a whole number, at least 0, got {text!r}")
    return int(text)


def number(text: str) -> float:
    """A finite number, for argparse."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, got {text!r}")
    return value


def positive(text: str) -> float:
    """A positive number, for argparse."""
    value = number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text!r}")
    return value


def may_draw_and_print(command: argparse.ArgumentParser) -> None:
    """The arguments `--json` and `--svg`; `draw` writes the picture."""
    command.add_argument("--json", action="store_true", help="print as JSON")
    command.add_argument("--svg", type=_svg_file, metavar="FILE", help="draw the graph, with the answer marked")


def draw(options: argparse.Namespace, drawing: Drawing) -> None:
    """Write a drawing to the file that `--svg` names."""
    atomic_write(options.svg, render_svg(drawing))
    say(f"drawn in {options.svg}")


def state_names(graph: Graph, n: int) -> tuple[list[str], list[str]]:
    """Names of the coordinates and of the velocities that the graph has, as inputs or as inner nodes."""
    known = {node.name for node in (*graph.inputs, *graph.nodes)}
    q, qd = ([f"{letter}{i}" for i in range(n) if f"{letter}{i}" in known] for letter in ("q", "qd"))
    return q, qd


def _svg_file(text: str) -> Path:
    if not text.endswith(".svg"):
        raise argparse.ArgumentTypeError(f"the picture's file must end in .svg, got {text!r}")
    return Path(text)
