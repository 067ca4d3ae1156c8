"""`cgraph inspect`: one page on which the graphs of a scene's equations unfold, move and answer."""

import argparse

from cgraph import _shared

from . import arguments, library
from .command import Command, flag, say

LONGEST_MOTION = 1000.0  # s: seconds of work for an arm of ten links


def add(parser: Command) -> None:
    """The command's arguments."""
    arguments.takes_a_scene(parser)
    arguments.writes_a_page(parser)
    which = parser.add_mutually_exclusive_group()
    flag(which, "--forward", "show forward dynamics first")
    flag(which, "--momentum", f"show {arguments.MOMENTUM_FORM} first")
    arguments.takes_a_start(parser)
    parser.add_argument(
        "--t-end", type=arguments.positive, metavar="S", help="how long it moves, in place of the scene's time"
    )
    flag(parser, "--json", "print the sizes as JSON")


def run(options: argparse.Namespace) -> int:
    """Write the page; 1 where the motion ends before its time, which the page then says."""
    if options.t_end is not None and options.t_end > LONGEST_MOTION:
        raise ValueError(
            f"--t-end must be at most {LONGEST_MOTION:g} s, got {options.t_end:g} s: a page has {library.FRAMES} times"
        )
    library.html_target("--out", options.out)
    say(f"reading {options.scene}")
    scene, moved = arguments.started(options)
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
    arguments.answer_page(
        options, arguments.unless_json(options, data, f"{options.out}: {counts}; {size / 1e6:.2f} MB"), text
    )
    return 1 if content.stopped else 0
