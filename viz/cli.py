"""The command line `cgraph`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from cgraph.files import write
from dynamics import FORMULATIONS, forward_dynamics, inverse_dynamics, scenes, spurious
from dynamics.reports.bench import MODES, PEERS, QUICK, SCENES, TASKS, Row, bench
from dynamics.reports.bench_table import machine, tables

from .dot import to_dot
from .render import render_png, render_svg


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status: 0, 1 for an error (one line on standard error), 2 for wrong usage."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("cgraph: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader, such as `head`, has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ValueError, TypeError, OSError, ImportError, RuntimeError) as error:
        print(f"cgraph: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="cgraph", description="Equations of motion as computational graphs: see, count, draw and simulate them."
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    paper = commands.add_parser("paper", help="the paper's six figures and its table, measured, in one folder")
    paper.add_argument("--out", type=Path, default=Path("paper"), help="folder to fill (default: paper)")
    paper.add_argument("--json", action="store_true", help="print the figures as JSON on standard output")
    paper.set_defaults(run=_paper)

    timed = commands.add_parser(
        "bench", help="our speed beside what is installed: CasADi, Pinocchio, MuJoCo, heyoka, JAX, SymPy, PyTorch"
    )
    timed.add_argument(
        "scenes",
        nargs="*",
        metavar="SCENE",
        help=f"one of {', '.join(SCENES)} (default: all of these), a name that `cgraph scenes` lists, or a model file",
    )
    _may_ignore(timed)
    for what, known in (("tasks", TASKS), ("modes", MODES), ("peers", PEERS)):
        timed.add_argument(f"--{what}", metavar="A,B", help=f"only these of {', '.join(known)}")
    timed.add_argument("--quick", action="store_true", help=f"fewer turns and, unless named, {', '.join(QUICK)} alone")
    timed.add_argument(
        "--budget", type=float, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    timed.add_argument("--json", action="store_true", help="print as JSON")
    timed.set_defaults(run=_bench)

    listed = commands.add_parser("scenes", help="the scenes, with the size of their graphs")
    listed.add_argument("--json", action="store_true", help="print as JSON")
    listed.set_defaults(run=_scenes)

    draw = commands.add_parser("draw", help="draw the graph of a scene's equations (SVG, PNG or DOT) or list it (TXT)")
    _takes_a_scene(draw)
    draw.add_argument("--formulation", default="chain_rule", choices=sorted(FORMULATIONS), help="default: chain_rule")
    draw.add_argument("--out", type=Path, required=True, help="file to write: .svg, .png, .dot or .txt")
    draw.add_argument(
        "--collapse", action="append", default=[], metavar="TAG", help="draw all nodes of a tag as one box"
    )
    draw.set_defaults(run=_draw)
    return parser


def _takes_a_scene(command: argparse.ArgumentParser) -> None:
    """The arguments that `_scene` reads."""
    command.add_argument("scene", help=f"{', '.join(scenes.names())}, or a model file, MJCF or URDF")
    _may_ignore(command)


def _may_ignore(command: argparse.ArgumentParser) -> None:
    command.add_argument("--ignore", action="store_true", help="leave out what of a model file cannot be modelled")


def _scene(options: argparse.Namespace) -> scenes.Scene:
    """The scene that the arguments name; what of a file is left out goes to standard error, a line each."""
    scene = scenes.load(options.scene, **({"ignore": True} if options.ignore else {}))
    for what in scene.left_out:
        print(f"cgraph: {scene.name}: left out {what}", file=sys.stderr)
    return scene


def _paper(options: argparse.Namespace) -> None:
    from .paper import write_paper  # matplotlib and MuJoCo load for this command alone

    data = write_paper(options.out, lambda line: print(line, file=sys.stderr, flush=True))
    if options.json:
        print(json.dumps(data, indent=1))


def _bench(options: argparse.Namespace) -> None:
    chosen = [
        tuple(given.split(",")) if given else tuple(known)
        for given, known in ((options.tasks, TASKS), (options.modes, MODES), (options.peers, PEERS))
    ]
    rows: list[Row] = []
    measured = bench(
        options.scenes or (QUICK if options.quick else tuple(SCENES)),
        *chosen,
        repeats=5 if options.quick else 15,
        budget=(20.0 if options.quick else 60.0) if options.budget is None else options.budget,
        ignore=options.ignore,
        say=lambda line: print(f"cgraph: {line}", file=sys.stderr, flush=True),
    )
    try:
        rows.extend(measured)
    finally:  # of a run that is interrupted, what has been measured
        if options.json and rows:
            print(json.dumps({"machine": machine(), "rows": [asdict(row) for row in rows]}, indent=1))
        elif rows:
            print(f"{machine()}\n\n{tables(rows)}")


def _scenes(options: argparse.Namespace) -> None:
    rows = []
    for name in scenes.names():
        scene = scenes.load(name)
        inverse, forward = inverse_dynamics(scene).counts(), forward_dynamics(scene).counts()
        rows.append(
            {
                "name": name,
                "about": scene.about,
                "coordinates": scene.system.n,
                "inverse_nodes": inverse.nodes,
                "forward_nodes": forward.nodes,
            }
        )
    if options.json:
        print(json.dumps(rows, indent=1))
        return
    for row in rows:
        print(
            f"{row['name']:16} {row['about']}\n{'':16} {row['coordinates']} coordinate(s), inverse dynamics "
            f"{row['inverse_nodes']} nodes, forward dynamics {row['forward_nodes']} nodes"
        )


def _draw(options: argparse.Namespace) -> None:
    scene = _scene(options)
    graph = inverse_dynamics(scene, options.formulation)
    counts = graph.counts()
    kind = options.out.suffix
    if kind == ".txt":
        write(options.out, graph.listing())
    elif kind in (".dot", ".svg", ".png"):
        caption = f"{scene.name}: inverse dynamics, {options.formulation.replace('_', ' ')}"
        drawing = to_dot(graph, marked=spurious(graph), collapse=options.collapse, caption=caption)
        if kind == ".dot":
            write(options.out, str(drawing.source))
        else:
            svg = render_svg(drawing)
            write(options.out, svg if kind == ".svg" else render_png(svg))
    else:
        raise ValueError(f"--out must end in .svg, .png, .dot or .txt, got {options.out}")
    print(f"{options.out}: {counts.nodes} nodes, {counts.edges} edges")
