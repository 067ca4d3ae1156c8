"""`cgraph inspect`: one page on which the graphs of a scene's equations unfold, move and answer."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cgraph.extend import check_writable
from dynamics import display_names, scenes
from dynamics.scenes.inspection import FRAMES, inspection

from .. import theme
from ..inspector import Motion, Table, Version, page
from .arguments import Commands, answer, positive, say, scene_of, takes_a_scene, unless_json

ROUNDING = 1e-12  # of the largest torque: smaller ones are what is left of a difference
LONGEST = 1000.0  # s: seconds of work for an arm of ten links


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "inspect", help="one page on which a scene's equations unfold, move and answer; status 1 for a motion cut short"
    )
    takes_a_scene(parser)
    parser.add_argument("--out", type=Path, required=True, help="file to write: .html")
    parser.add_argument("--forward", action="store_true", help="forward dynamics, in place of the three formulations")
    parser.add_argument("--t-end", type=positive, metavar="S", help="how long it moves, in place of the scene's time")
    parser.add_argument("--json", action="store_true", help="print the sizes as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Write the page; 1 where the motion ends before its time, which the page then says."""
    if options.out.suffix != ".html":
        raise ValueError(f"--out must end in .html, got {options.out}")
    if options.t_end is not None and options.t_end > LONGEST:
        raise ValueError(f"--t-end must be at most {LONGEST:g} s, got {options.t_end:g} s: a page has {FRAMES} times")
    check_writable(options.out)
    say(f"reading {options.scene}")
    scene = scene_of(options)
    content = inspection(scene, forward=options.forward, t_end=options.t_end, say=say)
    bones = content.skeleton
    cut = f"The motion is not whole: it {content.stopped}." if content.stopped else ""
    say(f"{scene.name}: writing the page of {sum(len(each.graph.nodes) for each in content.versions)} nodes")
    text = page(
        [
            Version(version.name.replace("_", " "), version.graph, f"{cut} {version.about}".strip(), *version[3:])
            for version in content.versions
        ],
        title=f"{scene.name}: {'forward' if options.forward else 'inverse'} dynamics",
        about=f"Left out of the model: {'; '.join(scene.left_out)}." if scene.left_out else "",
        motion=Motion(content.t, bones.points, bones.parents) if bones else Motion(content.t, None, ()),
        tables=[_torques(scene, content.shares, content.units)] if content.shares else [],
        names=display_names(scene),
        units=content.units,
    )
    sizes = {
        version.name: {
            "nodes": len(version.graph.nodes),
            "edges": len(version.graph.edges),
            "spurious": len(version.marked),
        }
        for version in content.versions
    }
    size = len(text.encode())
    counts = ", ".join(f"{name} {version['nodes']} nodes" for name, version in sizes.items())
    data = {"scene": scene.name, "bytes": size, "stopped": content.stopped, "versions": sizes}
    answer(unless_json(options, data, f"{options.out}: {counts}; {size / 1e6:.2f} MB"), {options.out: text})
    if cut:
        say(cut)
    return 1 if cut else 0


def _torques(scene: scenes.Scene, shares: Mapping[str, NDArray[np.float64]], units: Mapping[str, str]) -> Table:
    """A row for each velocity, a column for each part; what is rounding beside the largest number is said to be."""
    largest = max(float(np.abs(torques).max()) for torques in shares.values())

    def text(value: float) -> str:
        return "≈0" if 0.0 < abs(value) <= ROUNDING * largest else f"{value:.4g}".replace("-", "−")

    names = theme.called(display_names(scene))
    rows = [
        [f"{names[f'tau{i}']} [{units.get(f'tau{i}', 'N m')}]", *[text(torques[i]) for torques in shares.values()]]
        for i in range(scene.system.n)
    ]
    return Table("Torques and forces that each part takes at t = 0", ["", *shares], rows)
