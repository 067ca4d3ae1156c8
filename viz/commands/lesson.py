"""`cgraph lesson`: a lesson on a system, six screens to predict, reveal and play with."""

from __future__ import annotations

import argparse

from . import library
from .arguments import answer_page, say, scene_of, takes_a_scene, writes_a_page
from .command import Command

DEFAULT = "spring_mass"


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser, default=DEFAULT)
    writes_a_page(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    library.html_target("--out", options.out)
    scene = scene_of(options)
    say(f"{scene.name}: deriving the equations and answers of {len(library.SCREENS)} screens")
    text = library.lesson(scene)
    answer_page(
        options,
        f"{options.out}: {len(library.SCREENS)} screens on {scene.name}; {len(text.encode()) / 1e3:.0f} kB",
        text,
    )
