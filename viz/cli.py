"""The command line `cgraph`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from dynamics import FORMULATIONS, forward_dynamics, inverse_dynamics, scenes, spurious
from dynamics.reports.bench import MODELS, bench

from .dot import to_dot
from .files import write
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
        "bench", help="forward dynamics, ours beside what is installed: MuJoCo, Pinocchio, CasADi"
    )
    timed.add_argument("models", nargs="*", help=f"among {', '.join(MODELS)} (default: all)")
    timed.add_argument("--json", action="store_true", help="print as JSON")
    timed.set_defaults(run=_bench)

    listed = commands.add_parser("scenes", help="the scenes, with the size of their graphs")
    listed.add_argument("--json", action="store_true", help="print as JSON")
    listed.set_defaults(run=_scenes)

    draw = commands.add_parser("draw", help="draw the graph of a scene's equations (SVG, PNG or DOT) or list it (TXT)")
    draw.add_argument("scene", help=f"one of {', '.join(scenes.names())}")
    draw.add_argument("--formulation", default="chain_rule", choices=sorted(FORMULATIONS), help="default: chain_rule")
    draw.add_argument("--out", type=Path, required=True, help="file to write: .svg, .png, .dot or .txt")
    draw.add_argument(
        "--collapse", action="append", default=[], metavar="TAG", help="draw all nodes of a tag as one box"
    )
    draw.set_defaults(run=_draw)
    return parser


def _paper(options: argparse.Namespace) -> None:
    from .paper import write_paper  # matplotlib and MuJoCo load for this command alone

    data = write_paper(options.out, lambda line: print(line, file=sys.stderr, flush=True))
    if options.json:
        print(json.dumps(data, indent=1))


def _bench(options: argparse.Namespace) -> None:
    if unknown := [name for name in options.models if name not in MODELS]:
        raise ValueError(f"there is no bench model {unknown[0]!r}; the models are {', '.join(MODELS)}")
    rows = []
    for name in options.models or MODELS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        rows.append(bench(name))
    if options.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
        return
    print("Forward dynamics, one core. Times are medians of alternating repetitions; in brackets, times ours.")
    for row in rows:
        print(f"{row.model:10} {row.nodes} nodes, build {row.build:.3f} s, compile {row.compile:.3f} s ({row.backend})")
        print(f"{'':10} {'ours':10} {row.ours:8.2f} us a call, {row.batch:.3f} us a state in batches")
        for peer, micros in row.peers.items():
            ratio, difference = micros / row.ours, row.difference[peer]
            print(f"{'':10} {peer:10} {micros:8.2f} us a call [{ratio:.2f}], differs by {difference:.0e}")


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
    graph = inverse_dynamics(scenes.load(options.scene), options.formulation)
    counts = graph.counts()
    kind = options.out.suffix
    if kind == ".txt":
        write(options.out, graph.listing())
    elif kind in (".dot", ".svg", ".png"):
        caption = f"{options.scene}: inverse dynamics, {options.formulation.replace('_', ' ')}"
        drawing = to_dot(graph, marked=spurious(graph), collapse=options.collapse, caption=caption)
        if kind == ".dot":
            write(options.out, str(drawing.source))
        else:
            svg = render_svg(drawing)
            write(options.out, svg if kind == ".svg" else render_png(svg))
    else:
        raise ValueError(f"--out must end in .svg, .png, .dot or .txt, got {options.out}")
    print(f"{options.out}: {counts.nodes} nodes, {counts.edges} edges")
