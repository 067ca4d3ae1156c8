"""The parser of the command line, with every command's arguments."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from cgraph import __version__

# In the order of the help. To add a command, write its file and name it here.
COMMANDS = (
    "paper",
    "bench",
    "report",
    "scenes",
    "draw",
    "code",
    "certify",
    "inspect",
    "live",
    "simulate",
    "animate",
    "type",
    "lint",
    "why",
    "compare",
    "lesson",
    "architecture",
    "completion",
)
OF_ALL = "completion"  # the command that asks the others


def parser(only: str | None = None) -> argparse.ArgumentParser:
    """The parser of all commands, or of one alone; what it parses has `run`, the command's function."""
    whole = argparse.ArgumentParser(
        prog="cgraph", description="Equations of motion as computational graphs: see, count, draw and simulate them."
    )
    whole.add_argument("--version", action="version", version=f"cgraph {__version__}")
    commands = whole.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in COMMANDS if only is None else [only]:
        import_module(f".{name}", __package__).add(commands)
    return whole


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The options that arguments stand for. Wrong ones end in SystemExit with status 2, after the usage.

    argparse takes the words of a list from one place; of those that an option parts (`a --quick b`) the rest follow.
    Of the commands that one alone is loaded which is asked for: all take a fifth of a second.
    """
    asked = next(iter(sys.argv[1:] if arguments is None else arguments), None)
    whole = parser(asked if asked in COMMANDS and asked != OF_ALL else None)
    options, rest = whole.parse_known_args(arguments)
    if rest:
        words = getattr(options, getattr(options, "words", ""), None)
        if words is None or any([each.startswith("-") for each in rest]):
            whole.error(f"unrecognized arguments: {' '.join(rest)}")
        words.extend(rest)
    return options
