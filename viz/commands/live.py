"""`cgraph live`: one page on which a scene's motion is computed as it is watched."""

import argparse

from . import library
from .arguments import answer_page, started, takes_a_scene, takes_a_start, writes_a_page
from .command import Command, say


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    takes_a_start(parser)
    writes_a_page(parser)


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    library.html_target("--out", options.out)
    scene, _ = started(options)
    say(f"{scene.name}: deriving what moves and what is shown")
    text = library.live(scene)
    answer_page(options, f"{options.out}: {len(text.encode()) / 1e3:.0f} kB", text)
