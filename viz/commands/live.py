"""`cgraph live`: one page on which a scene's motion is computed as it is watched."""

from __future__ import annotations

import argparse
from pathlib import Path

from cgraph.extend import check_writable

from ..models.live import live_page
from .arguments import Commands, answer, say, takes_a_scene
from .point_arguments import started, takes_a_start


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("live", help="one page that computes a scene's motion, with sliders and meters")
    takes_a_scene(parser)
    takes_a_start(parser)
    parser.add_argument("--out", type=Path, required=True, help="file to write: .html")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    if options.out.suffix != ".html":
        raise ValueError(f"--out must end in .html, got {options.out}")
    check_writable(options.out)
    scene, _ = started(options)
    say(f"{scene.name}: deriving what moves and what is shown")
    text = live_page(scene)
    answer(f"{options.out}: {len(text.encode()) / 1e3:.0f} kB", {options.out: text})
