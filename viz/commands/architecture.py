"""`cgraph architecture`: which folder of the library imports which, as a list and as a picture."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from cgraph.extend import atomic_write

from ..architecture.architecture import architecture
from ..architecture.import_rule import PACKAGES
from ..architecture.picture import to_dot
from ..graph_drawing.render import render_png, render_svg
from .arguments import Commands, say


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "architecture", help="which folder of the library imports which; status 1 for a circle or an arrow that climbs"
    )
    parser.add_argument(
        "package", nargs="?", choices=PACKAGES, help="the folders of this one alone (default: the whole library)"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="draw it: .svg, .png or .dot")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the rooms by floor, the arrows, and what is wrong; 1 where anything is."""
    if options.out is not None and options.out.suffix not in (".svg", ".png", ".dot"):
        raise ValueError(f"--out must end in .svg, .png or .dot, got {options.out}")
    plan = architecture(options.package)
    print(json.dumps(plan.to_dict(), indent=1) if options.json else plan)
    if options.out is not None:
        drawing = to_dot(plan)
        if options.out.suffix == ".dot":
            atomic_write(options.out, str(drawing.source))
        else:
            svg = render_svg(drawing)
            atomic_write(options.out, svg if options.out.suffix == ".svg" else render_png(svg))
        say(f"drawn in {options.out}")
    return 0 if plan.sound else 1
