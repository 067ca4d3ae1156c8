"""`cgraph architecture`: which folder of the library imports which, as a list and as a picture."""

from __future__ import annotations

import argparse
from pathlib import Path

from cgraph import extend

from ..architecture.import_rule import PACKAGES
from . import library
from .arguments import answer, say, unless_json
from .command import Command


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.add_argument(
        "package", nargs="?", choices=PACKAGES, help="the folders of this one alone (default: the whole library)"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="draw it: .svg, .png or .dot")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the rooms by floor, the arrows, and what is wrong; 1 where anything is."""
    kind = None if options.out is None else options.out.suffix
    if kind not in (None, ".svg", ".png", ".dot"):
        raise ValueError(f"--out must end in .svg, .png or .dot, got {options.out}")
    if kind is not None:
        extend.check_writable(options.out)
    if kind in (".svg", ".png"):
        library.check_can_draw(png=kind == ".png")
    plan = library.architecture(options.package)
    text = unless_json(options, plan.to_dict(), plan)
    if kind is None:
        answer(text)
    else:
        drawing = library.architecture_dot(plan)
        picture = str(drawing.source) if kind == ".dot" else library.render_svg(drawing)
        answer(text, {options.out: library.render_png(picture) if kind == ".png" else picture})
        say(f"drawn in {options.out}")
    return 0 if plan.sound else 1
