"""`cgraph live`: one page on which a scene's motion is computed as it is watched."""

from __future__ import annotations

import argparse
from pathlib import Path

from cgraph.extend import check_writable
from dynamics.integrators import TABLEAUS
from dynamics.scenes.live_graphs import live_graphs
from dynamics.scenes.scenes import Scene

from ..live import Live, live_page
from .arguments import Commands, answer, say, scene_of, takes_a_scene


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("live", help="one page that computes a scene's motion, with sliders and meters")
    takes_a_scene(parser)
    parser.add_argument("--out", type=Path, required=True, help="file to write: .html")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    if options.out.suffix != ".html":
        raise ValueError(f"--out must end in .html, got {options.out}")
    check_writable(options.out)
    scene = scene_of(options)
    say(f"{scene.name}: deriving what moves and what is shown")
    text = live_page(live_of(scene), title=f"{scene.name}, live", about=scene.about)
    answer(f"{options.out}: {len(text.encode()) / 1e3:.0f} kB", {options.out: text})


def live_of(scene: Scene) -> Live:
    """What the panel of a scene computes."""
    made = live_graphs(scene)
    return Live(
        made.rate,
        made.start,
        made.shown,
        made.meters,
        made.parents,
        made.scales,
        made.dt,
        TABLEAUS,
        made.names,
        made.units,
    )
