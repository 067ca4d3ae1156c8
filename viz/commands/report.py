"""`cgraph report`: error beside run time of integrators, as pages; or one of two other reports."""

from __future__ import annotations

import argparse
import shutil
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import dynamics as dyn
from cgraph import _shared

from . import library
from .arguments import IN_PYTHON, READING, answer, number, place, positive, reading, reads_files, start, unless_json
from .command import Command, flag, say

CURVES, STABILITY, PRUNING = "a report of run times", "--stability", "--pruning"

GO_WITH = {  # options that not every kind of report has
    **dict.fromkeys(READING, (CURVES, PRUNING)),
    "t_end": (CURVES,),
    "start": (CURVES,),
    "methods": (CURVES,),
    "quick": (CURVES, STABILITY),
    "json": (CURVES, STABILITY, PRUNING),
    "without": (PRUNING,),
    "lock": (PRUNING,),
}
FOLDER = Path("report")


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.names |= {
        "scenes": lambda: [*dyn.scenes.names(), *library.named_tasks.TASKS],
        "methods": lambda: dyn.METHODS,
        "effects": lambda: dyn.EFFECTS,
    }
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help=f"{{scenes}}, a model file, MJCF or URDF, a case, or {IN_PYTHON}"
    )
    flag(parser, "--stability", "the table of stiff and extreme cases; status 1 for an unexplained row")
    reads_files(parser)
    parser.add_argument("--out", type=place, help=f"folder to fill (default: {FOLDER}; with --json, none)")
    parser.add_argument("--t-end", type=positive, metavar="S", help="how long, instead of the scene's own time")
    parser.add_argument(
        "--start", type=start, metavar="A=1,B=2", help="instead of the scene's own: by names, or all numbers"
    )
    parser.add_argument("--methods", type=listed, metavar="A,B", help="only these of {methods}")
    flag(parser, "--quick", "fewer turns and shorter runs")
    flag(parser, "--json", "print as JSON")
    flag(parser, "--pruning", "instead: what the scene's graphs hold and leave out")
    parser.add_argument("--without", type=listed, metavar="A,B", help="with --pruning: leave out {effects}")
    parser.add_argument(
        "--lock", type=_locked, action="append", metavar="BODY=AT", help="with --pruning: lock a joint there [rad or m]"
    )
    parser.set_defaults(words="scenes")


def run(options: argparse.Namespace) -> int | None:
    """Write the pages that the arguments ask for; 1 where one of them has a finding."""
    if options.out is None and not options.json:
        options.out = FOLDER
    others = {STABILITY: options.stability, PRUNING: options.pruning}
    kinds = [kind for kind, asked in others.items() if asked] or [CURVES]
    if len(kinds) > 1:
        raise ValueError(f"{' and '.join(kinds)} are {len(kinds)} reports: one at a time")
    kind = kinds[0]
    if not options.scenes and kind in (CURVES, PRUNING):
        raise ValueError(f"{kind} needs a scene, as in: cgraph report spring_mass; --stability needs none")
    if options.scenes and kind == STABILITY:
        raise ValueError(f"{kind} takes no scene, got {options.scenes[0]!r:.80}")
    for name, with_these in GO_WITH.items():
        if kind not in with_these and getattr(options, name) not in (None, False):
            raise ValueError(f"--{name.replace('_', '-')} goes with {' or '.join(with_these)}, not with {kind}")
    if options.out is not None:
        library.check_folder(options.out)
    return {CURVES: _curves, STABILITY: _stability, PRUNING: _pruning}[kind](options)


def listed(text: str) -> tuple[str, ...]:
    """Names between commas, for argparse."""
    return tuple(filter(None, text.split(",")))


def _locked(text: str) -> tuple[str, float]:
    body, equals, at = text.rpartition("=")
    if not (equals and body):
        raise argparse.ArgumentTypeError(f"expected a body and a coordinate, BODY=AT, got {text!r}")
    return body, number(at)


def _curves(options: argparse.Namespace) -> None:
    """A page of run time beside error for each scene."""
    named = {library.named_tasks.load(name, reading=reading(options)).name for name in options.scenes}
    if len(named) < len(options.scenes):
        raise ValueError(f"each scene needs a name of its own for its files, got {', '.join(options.scenes)}")
    chosen = {"t_end": options.t_end, "start": options.start, "reading": reading(options)}
    if options.out is not None:
        library.check_can_plot()
    found, lines, files = [], [], dict[Path, str | bytes]()
    kept = None if options.out is None else options.out / "exact"
    with TemporaryDirectory() as folder:  # of exact motions, kept and new, until the report is whole
        for path in kept.glob("*.json") if kept else ():
            shutil.copy(path, folder)
        for name in options.scenes:
            report = library.work_precision.work_precision(
                name,
                methods=options.methods or tuple(dyn.METHODS),
                turns=3 if options.quick else 9,
                limit=0.03 if options.quick else library.work_precision.LIMIT,
                folder=Path(folder),
                options=chosen,
                say=say,
            )
            content = report.to_dict()
            found.append(content)
            if options.out is not None:
                document, rows = library.work_precision_page.work_precision(content), library.to_csv(report)
                files |= (written := library.document_files(options.out, content["name"], document, content, rows))
                points = sum(len(each.points) for each in report.curves)
                lines.append(f"{[*written][-1]}: {len(report.curves)} integrators, {points} points")
        exact = {kept / path.name: path.read_bytes() for path in Path(folder).iterdir()} if kept else {}
        files |= {path: text for path, text in exact.items() if not path.is_file() or path.read_bytes() != text}
        answer(unless_json(options, found, "\n".join(lines)), files, folder=options.out)


def _stability(options: argparse.Namespace) -> int:
    """Write the page and print the table; 1 for a row beyond its bound without a known reason."""
    if options.out is not None:
        library.check_can_plot()
    begin = time.perf_counter()
    found = library.stability.run(options.quick, say)
    content = library.stability.to_dict(found, time.perf_counter() - begin, options.quick)
    files: dict[Path, str | bytes] = {}
    text = library.stability.text(found)
    if options.out is not None:
        document, rows = library.stability_page.document(content), library.stability.to_csv(found)
        files |= library.document_files(options.out, "stability", document, content, rows)
        text = f"{text}\n{[*files][-1]}"
    answer(unless_json(options, content, text), files, folder=options.out)
    unexplained = [f"{each.case} by {each.method}" for each in found if each.verdict == "unexplained"]
    if unexplained:
        say(f"beyond its bound without a known reason: {', '.join(unexplained)}")
    return 1 if unexplained else 0


def _pruning(options: argparse.Namespace) -> None:
    """Write a page for each scene."""
    without, locked = options.without or (), options.lock or []
    if unknown := [each for each in without if each not in dyn.EFFECTS]:
        raise ValueError(f"effects are {', '.join(dyn.EFFECTS)}, got {unknown[0]!r}")
    lock = dict(locked)
    if len(lock) < len(locked):
        raise ValueError(f"--lock takes each body once, got {', '.join(body for body, _ in locked)}")
    found, lines, files = [], [], dict[Path, str | bytes]()
    for name in options.scenes:
        scene = dyn.scenes.load(name, **reading(options))
        effects = [each for each in dyn.EFFECTS if each not in without]
        content = pruning_content(scene, effects, _bodies(scene, lock))
        found.append(content)
        if options.out is not None:
            document = library.pruning_page.document(content)
            files |= (
                written := library.document_files(options.out, content["name"], document, content, kind="pruning")
            )
            sizes = [f"{each['equations']} {each['full']['nodes']} to {each['pruned']['nodes']} nodes"
                     for each in content["graphs"]]  # fmt: skip
            lines.append(f"{[*written][-1]}: {', '.join(sizes)}")
    answer(unless_json(options, found, "\n".join(lines)), files, folder=options.out)


def pruning_content(
    scene: dyn.scenes.Scene, effects: Iterable[str], lock: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Report of `prune` on a scene's inverse and forward dynamics, for JSON.  effects, lock: as of `prune`."""
    kept = tuple(effects)
    graphs = [
        {"equations": title} | _account(dyn.prune(scene, equations, effects=kept, lock=lock))
        for title, equations in (("inverse dynamics", dyn.inverse_dynamics), ("forward dynamics", dyn.forward_dynamics))
    ]
    described = {"name": scene.name, "about": scene.about, "left_out": list(scene.left_out)}
    return {**described, "effects": list(kept), "graphs": graphs}


def _account(pruned: library.PruneResult) -> dict[str, Any]:
    full, left = pruned.full.counts(), pruned.graph.counts()
    sizes: dict[str, Any] = {
        name: {size: getattr(counts, size) for size in ("nodes", "edges", "depth")}
        for name, counts in (("full", full), ("pruned", left))
    }
    rows = {"left_out": pruned.omitted, "absent": pruned.absent, "remains": pruned.remains}
    told = {name: [asdict(each) for each in terms] for name, terms in rows.items()}
    tags = sorted({*full.by_tag, *left.by_tag})
    return sizes | told | {"by_tag": {tag: [full.by_tag.get(tag, 0), left.by_tag.get(tag, 0)] for tag in tags}}


def _bodies(scene: dyn.scenes.Scene, lock: dict[str, float]) -> dict[str, float]:
    """Joints to lock by their bodies' names, where they may be given by their coordinates'."""
    moving = scene.mechanism.moving if scene.mechanism else ()
    bodies = [body.name for body in moving]
    of = {body.coordinate: body.name for body in moving} | {name: name for name in bodies}
    if unknown := [name for name in lock if name not in of]:
        known = _shared.or_nearest(unknown[0], list(of)) if of else "it has no bodies"
        raise ValueError(f"{scene.name} has no joint {unknown[0]!r:.80} to lock; {known}")
    return {of[name]: at for name, at in lock.items()}
