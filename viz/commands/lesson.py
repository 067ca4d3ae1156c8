"""`cgraph lesson`: a lesson on a system, questions to predict and to try, with a worksheet and its key."""

import argparse
from functools import partial
from pathlib import Path

from cgraph import _shared

from . import library
from .arguments import answer, may_open, scene_of, takes_a_scene
from .command import Command, say


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser, default="two_link")
    parser.names["subjects"] = lambda: [
        f"{name} ({each.title}, {each.minutes} minutes)" for name, each in library.LESSONS.items()
    ]
    parser.add_argument("--out", type=Path, help="file to write the lesson to: .html")
    parser.add_argument("--worksheet", type=Path, metavar="FILE", help="file for a worksheet to be printed: .html")
    parser.add_argument("--key", type=Path, metavar="FILE", help="file for the answers, for the teacher: .html")
    parser.add_argument("--subject", default="euler", metavar="SUBJECT", help="one of {subjects}; default: euler")
    parser.add_argument(
        "--title", default="", metavar="TEXT", help="what stands at the top, in place of the subject's title"
    )
    parser.add_argument("--author", default="", metavar="TEXT", help="name below the title")
    may_open(parser)
    parser.set_defaults(run=partial(run, parser))


def run(parser: Command, options: argparse.Namespace) -> None:
    """Write the pages that are asked for."""
    asked = {"page": options.out, "worksheet": options.worksheet, "key": options.key}
    targets = {form: path for form, path in asked.items() if path}
    if not targets:
        parser.error("one of --out, --worksheet and --key is required")
    for form, path in targets.items():
        library.html_target("--out" if form == "page" else f"--{form}", path)
    if len({path.resolve() for path in targets.values()}) < len(targets):
        raise ValueError("--out, --worksheet and --key need different files")
    scene = scene_of(options)
    say(f"{scene.name}: deriving the equations and the answers")
    make = partial(library.lesson, scene, subject=options.subject, title=options.title, author=options.author)
    texts = {path: make(form=form) for form, path in targets.items()}
    lesson = library.LESSONS[options.subject]
    about = f"{_shared.counted(len(lesson.screens), 'question')} on {scene.name}, {lesson.minutes} minutes"
    words = {"page": about, "worksheet": "worksheet, to be printed", "key": "answers to it"}
    lines = [f"{path}: {words[form]}; {len(texts[path].encode()) / 1e3:.0f} kB" for form, path in targets.items()]
    answer("\n".join(lines), texts, show=next(iter(targets.values())) if options.open else None)
