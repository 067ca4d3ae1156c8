"""`cgraph report --pruning`: what a scene's graphs hold and leave out, as a page."""

from __future__ import annotations

import argparse
from pathlib import Path

import dynamics as dyn
from cgraph import extend

from . import library
from .arguments import answer, reading, unless_json


def run(options: argparse.Namespace) -> None:
    """Write a page for each scene."""
    without = [each for each in (options.without or "").split(",") if each]
    if unknown := [each for each in without if each not in dyn.EFFECTS]:
        raise ValueError(f"effects are {', '.join(dyn.EFFECTS)}, got {unknown[0]!r}")
    locked = options.lock or []
    lock = dict(locked)
    if len(lock) < len(locked):
        raise ValueError(f"--lock takes each body once, got {', '.join(body for body, _ in locked)}")
    found, lines, files = [], [], dict[Path, str | bytes]()
    for name in options.scenes:
        scene = dyn.scenes.load(name, **reading(options))
        effects = [each for each in dyn.EFFECTS if each not in without]
        content = library.pruning.report(scene, effects=effects, lock=_bodies(scene, lock))
        found.append(content)
        if options.out is not None:
            document = library.pruning_page.document(content)
            written = library.document_files(options.out, content["name"], document, content, kind="pruning")
            files |= written
            sizes = [f"{each['equations']} {each['full']['nodes']} to {each['pruned']['nodes']} nodes"
                     for each in content["graphs"]]  # fmt: skip
            lines.append(f"{[*written][-1]}: {', '.join(sizes)}")
    answer(unless_json(options, found, "\n".join(lines)), files, folder=options.out)


def _bodies(scene: dyn.scenes.Scene, lock: dict[str, float]) -> dict[str, float]:
    """What is to be locked by its body's name, where it may be given by its coordinate's."""
    moving = scene.mechanism.moving if scene.mechanism else ()
    bodies = [body.name for body in moving]
    of = {body.coordinate: body.name for body in moving} | {name: name for name in bodies}
    if unknown := [name for name in lock if name not in of]:
        known = extend.or_nearest(unknown[0], list(of)) if of else "it has no bodies"
        raise ValueError(f"{scene.name} has no joint {unknown[0]!r:.80} to lock; {known}")
    return {of[name]: at for name, at in lock.items()}
