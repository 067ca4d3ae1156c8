"""`cgraph paper`: the paper's figures and its table, measured, in one folder."""

import argparse
from pathlib import Path

import dynamics as dyn

from . import library
from .arguments import answer, may_open, place, unless_json
from .command import Command, flag, say


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.add_argument("--out", type=place, default=Path("paper"), help="folder to fill (default: paper)")
    flag(parser, "--quick", "times of fewer evaluations, and shorter chains")
    may_open(parser)
    flag(parser, "--json", "print the figures as JSON on standard output")


def run(options: argparse.Namespace) -> None:
    """Write the folder."""
    spring, arm = (dyn.scenes.load(name) for name in ("spring_mass", "triple_pendulum"))
    beside = {
        "typed.html": (
            "Type a Lagrangian, at first that of Figures 1 to 3",
            lambda: library.typed_page(library.typed_text(spring, spring.q)),
        ),
        "live.html": ("The three-link arm of Figures 4 and 5, live", lambda: library.live(arm)),
    }
    files, data = library.paper(options.out, say, quick=options.quick, beside=beside)
    page = options.out / "index.html"
    said = unless_json(options, data, f"All of it on one page: {page}")
    answer(said, files, folder=options.out, show=page if options.open else None)
