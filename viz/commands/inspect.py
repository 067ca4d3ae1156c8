"""`cgraph inspect`: one page on which the graphs of a scene's equations unfold, move and answer."""

import argparse

from cgraph import _shared

from . import library
from .arguments import (
    MOMENTUM_FORM,
    answer_page,
    positive,
    started,
    takes_a_scene,
    takes_a_start,
    unless_json,
    writes_a_page,
)
from .command import Command, say

LONGEST_MOTION = 1000.0  # s: seconds of work for an arm of ten links


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    writes_a_page(parser)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--forward", action="store_true", help="show forward dynamics first")
    which.add_argument("--momentum", action="store_true", help=f"show {MOMENTUM_FORM} first")
    takes_a_start(parser)
    parser.add_argument("--t-end", type=positive, metavar="S", help="how long it moves, in place of the scene's time")
    parser.add_argument("--json", action="store_true", help="print the sizes as JSON")


def run(options: argparse.Namespace) -> int:
    """Write the page; 1 where the motion ends before its time, which the page then says."""
    if options.t_end is not None and options.t_end > LONGEST_MOTION:
        raise ValueError(
            f"--t-end must be at most {LONGEST_MOTION:g} s, got {options.t_end:g} s: a page has {library.FRAMES} times"
        )
    library.html_target("--out", options.out)
    say(f"reading {options.scene}")
    scene, moved = started(options)
    content = library.inspection(scene, t_end=options.t_end, say=say)
    count = sum(len(each.graph.nodes) for each in content.versions.values())
    say(f"{scene.name}: writing the page of {_shared.counted(count, 'node')}")
    text = library.inspection_page(scene, content, moved, view=library.first_view(options.forward, options.momentum))
    sizes = {
        name: {
            "nodes": len(version.graph.nodes),
            "edges": len(version.graph.edges),
            "spurious": len(version.marked),
            "spurious_edges": len(version.blamed),
            "differs": version.flawed,
        }
        for name, version in content.versions.items()
    }
    size = len(text.encode())
    counts = ", ".join(f"{name} {_shared.counted(version['nodes'], 'node')}" for name, version in sizes.items())
    data = {"scene": scene.name, "bytes": size, "stopped": content.stopped, "versions": sizes}
    answer_page(options, unless_json(options, data, f"{options.out}: {counts}; {size / 1e6:.2f} MB"), text)
    return 1 if content.stopped else 0
