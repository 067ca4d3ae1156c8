"""`cgraph report`: error beside run time of integrators, as pages; or one of two other reports."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from dynamics import EFFECTS, scenes
from dynamics.integrators import METHODS
from dynamics.reports import trajectory_scenes, work_precision
from dynamics.reports.cold_start import STARTS

from .. import report as page
from ..document_files import write_document
from . import pruning_report, stability_report
from .arguments import Commands, may_ignore, say


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("report", help="error beside run time of every integrator, ours and others', as pages")
    parser.add_argument(
        "scenes",
        nargs="*",
        metavar="SCENE",
        help=f"{', '.join([*scenes.names(), *trajectory_scenes.names()])}, a model file, MJCF or URDF, or a case",
    )
    parser.add_argument(
        "--stability", action="store_true", help="the table of stiff and extreme cases; status 1 for an unexplained row"
    )
    may_ignore(parser)
    parser.add_argument("--out", type=Path, default=Path("report"), help="folder to fill (default: report)")
    parser.add_argument("--t-end", type=float, metavar="S", help="how long, instead of the scene's own time")
    parser.add_argument("--start", metavar="A,B", help="q and then qd, instead of the scene's own start")
    parser.add_argument("--methods", metavar="A,B", help=f"only these of {', '.join(METHODS)}")
    parser.add_argument("--peers", metavar="A,B", help=f"only these of {', '.join(work_precision.PEERS)}; '' for none")
    parser.add_argument("--quick", action="store_true", help="fewer turns, shorter runs, and no cold starts")
    parser.add_argument(
        "--budget", type=float, default=60.0, metavar="S", help="seconds that a cold start may take (default: 60)"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.add_argument("--pruning", action="store_true", help="instead: what the scene's graphs hold and leave out")
    parser.add_argument("--without", default="", metavar="A,B", help=f"with --pruning: leave out {', '.join(EFFECTS)}")
    parser.add_argument(
        "--lock", action="append", default=[], metavar="BODY=AT", help="with --pruning: lock a joint there [rad or m]"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the pages that the arguments ask for."""
    if options.pruning:
        pruning_report.run(options)
    elif bool(options.scenes) == options.stability:
        raise ValueError("a report needs a scene, or --stability and none")
    elif options.stability:
        stability_report.run(options)
    else:
        _curves(options)


def _curves(options: argparse.Namespace) -> None:
    """A page of run time beside error for each scene."""
    named = {trajectory_scenes.load(name, ignore=options.ignore).name for name in options.scenes}
    if len(named) < len(options.scenes):
        raise ValueError(f"each scene needs a name of its own for its files, got {', '.join(options.scenes)}")
    chosen = {"t_end": options.t_end, "ignore": options.ignore}
    chosen["start"] = [float(each) for each in options.start.split(",")] if options.start else None
    peers = work_precision.PEERS if options.peers is None else tuple(filter(None, options.peers.split(",")))
    found = []
    for name in options.scenes:
        report = work_precision.work_precision(
            name,
            methods=options.methods.split(",") if options.methods else tuple(METHODS),
            peers=peers,
            turns=3 if options.quick else 9,
            limit=0.03 if options.quick else work_precision.LIMIT,
            cold=() if options.quick else tuple(STARTS),
            budget=options.budget,
            folder=options.out / "exact",
            options=chosen,
            say=say,
        )
        content = report.content()
        found.append(content)
        document, rows = page.work_precision(content), work_precision.to_csv(report)
        written = write_document(options.out, content["name"], document, content, rows)
        if not options.json:
            points = sum(len(each.points) for each in report.curves)
            print(f"{written}: {len(report.curves)} integrators, {points} points")
    if options.json:
        print(json.dumps(found, indent=1))
