"""The parser of the command line, with every command's arguments."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from cgraph import __version__

from . import (
    animate,
    architecture,
    bench,
    certify,
    code,
    compare,
    completion,
    draw,
    inspect,
    lesson,
    lint,
    live,
    paper,
    report,
    scenes,
    simulate,
    type as type_,
    why,
)

# In the order of the help. To add a command, write its file and name it here and above.
COMMANDS = (
    paper,
    bench,
    report,
    scenes,
    draw,
    code,
    certify,
    inspect,
    live,
    simulate,
    animate,
    type_,
    lint,
    why,
    compare,
    lesson,
    architecture,
    completion,
)


def parser() -> argparse.ArgumentParser:
    """The parser of all commands; what it parses has `run`, the command's function."""
    whole = argparse.ArgumentParser(
        prog="cgraph", description="Equations of motion as computational graphs: see, count, draw and simulate them."
    )
    whole.add_argument("--version", action="version", version=f"cgraph {__version__}")
    commands = whole.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    return whole


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The options that arguments stand for. Wrong ones end in SystemExit with status 2, after the usage.

    argparse takes the words of a list from one place; of those that an option parts (`a --quick b`) the rest follow.
    """
    whole = parser()
    options, rest = whole.parse_known_args(arguments)
    if rest:
        words = getattr(options, getattr(options, "words", ""), None)
        if words is None or any([each.startswith("-") for each in rest]):
            whole.error(f"unrecognized arguments: {' '.join(rest)}")
        words.extend(rest)
    return options
