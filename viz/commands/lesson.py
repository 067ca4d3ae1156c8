"""`cgraph lesson`: a lesson on a system, six screens to predict, reveal and play with."""

from __future__ import annotations

import argparse
from pathlib import Path

from cgraph.extend import check_writable

from ..lessons.lesson import SCREENS, lesson
from .arguments import Commands, answer, say, scene_of, takes_a_scene

DEFAULT = "spring_mass"


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("lesson", help="a page for a class, on any scene: predict, reveal, play; with answers")
    takes_a_scene(parser, default=DEFAULT)
    parser.add_argument("--out", type=Path, required=True, help="file to write: .html")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    if options.out.suffix != ".html":
        raise ValueError(f"--out must end in .html, got {options.out}")
    check_writable(options.out)
    scene = scene_of(options)
    say(f"{scene.name}: deriving the equations and answers of {len(SCREENS)} screens")
    text = lesson(scene)
    answer(
        f"{options.out}: {len(SCREENS)} screens on {scene.name}; {len(text.encode()) / 1e3:.0f} kB", {options.out: text}
    )
