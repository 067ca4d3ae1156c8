"""`cgraph completion`: what the Tab key completes, as a script for a shell, by shtab from the parser's arguments."""

import argparse

import dynamics as dyn
from cgraph import _shared

from .arguments import answer
from .command import Command, parsers

SHELLS = ("bash", "zsh", "fish")


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.add_argument("shell", choices=SHELLS, help='bash or zsh: eval "$(cgraph completion bash)"; fish: | source')


def run(options: argparse.Namespace) -> None:
    """Print the script. Raises ImportError, which names the extra, where shtab is missing."""
    try:
        import shtab
    except ImportError as error:
        raise ImportError(f"a script of completion needs the package shtab: {_shared.install('completion')}") from error
    whole, commands = parsers()
    for command in commands.values():
        command.complete()
        for action in command._actions:
            if "SCENE" in str(action.metavar) and action.choices is None:
                action.choices = list(dyn.scenes.names())
            elif "FILE" in str(action.metavar) or "FOLDER" in str(action.metavar):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    answer(shtab.complete(whole, options.shell))
