"""The command line `cgraph`."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from cgraph.files import write
from dynamics import EFFECTS, FORMULATIONS, forward_dynamics, inverse_dynamics, scenes, spurious
from dynamics.integrators import METHODS
from dynamics.reports import pruning as pruning_report, stability, stability_table, trajectory_scenes, work_precision
from dynamics.reports.bench import MODES, PEERS, QUICK, SCENES, TASKS, Row, bench
from dynamics.reports.bench_table import machine, tables
from dynamics.reports.cold_start import STARTS
from dynamics.tables.certificate import certify

from . import pruning
from .commands import diff, inspect, lesson, lint, why
from .commands.scene import may_ignore, scene_of, takes_a_scene
from .dot import to_dot
from .render import render_png, render_svg


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status.

    0, or what the command returns; 1 for an error (one line on standard error), 2 for wrong usage.
    """
    options = _parser().parse_args(arguments)
    try:
        status: int | None = options.run(options)
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
    return status or 0


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
    may_ignore(timed)
    for what, known in (("tasks", TASKS), ("modes", MODES), ("peers", PEERS)):
        timed.add_argument(f"--{what}", metavar="A,B", help=f"only these of {', '.join(known)}")
    timed.add_argument("--quick", action="store_true", help=f"fewer turns and, unless named, {', '.join(QUICK)} alone")
    timed.add_argument(
        "--budget", type=float, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    timed.add_argument("--json", action="store_true", help="print as JSON")
    timed.set_defaults(run=_bench)

    _add_report(commands)

    listed = commands.add_parser("scenes", help="the scenes, with the size of their graphs")
    listed.add_argument("--json", action="store_true", help="print as JSON")
    listed.set_defaults(run=_scenes)

    draw = commands.add_parser("draw", help="draw the graph of a scene's equations (SVG, PNG or DOT) or list it (TXT)")
    takes_a_scene(draw)
    draw.add_argument("--formulation", default="chain_rule", choices=sorted(FORMULATIONS), help="default: chain_rule")
    draw.add_argument("--out", type=Path, required=True, help="file to write: .svg, .png, .dot or .txt")
    draw.add_argument(
        "--collapse", action="append", default=[], metavar="TAG", help="draw all nodes of a tag as one box"
    )
    draw.set_defaults(run=_draw)

    checked = commands.add_parser(
        "certify", help="equations that a scene's graphs must fulfil, at random states, and agreement with peers"
    )
    takes_a_scene(checked)
    checked.add_argument("--states", type=int, default=20, metavar="N", help="random states (default: 20)")
    checked.add_argument("--seed", type=int, default=0, metavar="S", help="of the random states (default: 0)")
    checked.add_argument("--json", action="store_true", help="print as JSON")
    checked.set_defaults(run=_certify)

    for command in (inspect, lint, why, diff, lesson):
        command.add(commands)
    return parser


def _add_report(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    report = commands.add_parser("report", help="error beside run time of every integrator, ours and others', as pages")
    report.add_argument(
        "scenes",
        nargs="*",
        metavar="SCENE",
        help=f"{', '.join([*scenes.names(), *trajectory_scenes.names()])}, a model file, MJCF or URDF, or a case",
    )
    report.add_argument(
        "--stability", action="store_true", help="the table of stiff and extreme cases; status 1 for an unexplained row"
    )
    may_ignore(report)
    report.add_argument("--out", type=Path, default=Path("report"), help="folder to fill (default: report)")
    report.add_argument("--t-end", type=float, metavar="S", help="how long, instead of the scene's own time")
    report.add_argument("--start", metavar="A,B", help="q and then qd, instead of the scene's own start")
    report.add_argument("--methods", metavar="A,B", help=f"only these of {', '.join(METHODS)}")
    report.add_argument("--peers", metavar="A,B", help=f"only these of {', '.join(work_precision.PEERS)}; '' for none")
    report.add_argument("--quick", action="store_true", help="fewer turns, shorter runs, and no cold starts")
    report.add_argument(
        "--budget", type=float, default=60.0, metavar="S", help="seconds that a cold start may take (default: 60)"
    )
    report.add_argument("--json", action="store_true", help="print as JSON")
    report.add_argument("--pruning", action="store_true", help="instead: what the scene's graphs hold and leave out")
    report.add_argument("--without", default="", metavar="A,B", help=f"with --pruning: leave out {', '.join(EFFECTS)}")
    report.add_argument(
        "--lock", action="append", default=[], metavar="BODY=AT", help="with --pruning: lock a joint there [rad or m]"
    )
    report.set_defaults(run=_report)


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
            print(tables(rows, machine()))


def _report(options: argparse.Namespace) -> None:
    if options.pruning:
        _pruning(options)
        return
    from .report_files import write_report  # matplotlib loads for this command alone

    if bool(options.scenes) == options.stability:
        raise ValueError("a report needs a scene, or --stability and none")
    if options.stability:
        _stability(options)
        return
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
            say=lambda line: print(f"cgraph: {line}", file=sys.stderr, flush=True),
        )
        found.append(report.content())
        page = write_report(options.out, found[-1], work_precision.to_csv(report))
        if not options.json:
            print(f"{page}: {len(report.curves)} integrators, {sum(len(each.points) for each in report.curves)} points")
    if options.json:
        print(json.dumps(found, indent=1))


def _stability(options: argparse.Namespace) -> None:
    from .stability import write as write_stability  # matplotlib loads for this command alone

    begin = time.perf_counter()
    found = stability.run(options.quick, lambda line: print(f"cgraph: {line}", file=sys.stderr, flush=True))
    content = stability.content(found, time.perf_counter() - begin, options.quick)
    page = write_stability(options.out, content, stability.to_csv(found))
    print(json.dumps(content, indent=1) if options.json else f"{stability_table.table(found)}\n{page}")
    if unexplained := [f"{each.case} by {each.method}" for each in found if not each.explained]:
        raise RuntimeError(f"beyond its bound without a known reason: {', '.join(unexplained)}")


def _pruning(options: argparse.Namespace) -> None:
    without = [each for each in options.without.split(",") if each]
    if unknown := [each for each in without if each not in EFFECTS]:
        raise ValueError(f"effects are {', '.join(EFFECTS)}, got {unknown[0]!r}")
    if wrong := [each for each in options.lock if "=" not in each]:
        raise ValueError(f"--lock must be a body and a coordinate, BODY=AT, got {wrong[0]!r}")
    lock = {body: float(at) for body, _, at in (each.rpartition("=") for each in options.lock)}
    found = []
    for name in options.scenes:
        scene = scenes.load(name, **({"ignore": True} if options.ignore else {}))
        found.append(pruning_report.report(scene, effects=[each for each in EFFECTS if each not in without], lock=lock))
        page = pruning.write(options.out, found[-1])
        if not options.json:
            sizes = [f"{each['equations']} {each['full']['nodes']} to {each['pruned']['nodes']} nodes"
                     for each in found[-1]["graphs"]]  # fmt: skip
            print(f"{page}: {', '.join(sizes)}")
    if options.json:
        print(json.dumps(found, indent=1))


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
    scene = scene_of(options)
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


def _certify(options: argparse.Namespace) -> None:
    scene = scene_of(options)
    twin = None if options.scene in scenes.names() else Path(options.scene)
    certificate = certify(scene, options.states, options.seed, twin=twin)
    if options.json:
        print(json.dumps({"scene": scene.name} | certificate.as_dict(), indent=1))
    else:
        print(certificate.text(), end="")
    if not certificate.passed:
        failed = [each.equation for each in certificate.residuals if not each.passed]
        raise RuntimeError(f"{scene.name}: {len(failed)} residual(s) exceed their bound: {'; '.join(failed)}")
