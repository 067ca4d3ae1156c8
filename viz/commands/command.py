"""The table of the commands and their parsers, which have their arguments once a command is named."""

import argparse
import difflib
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import Any

from cgraph import __version__


def say(line: str) -> None:
    """A line of progress, of warning or of an error, on standard error."""
    if sys.stderr is not None:
        print(f"cgraph: {line}", file=sys.stderr, flush=True)


class Command(argparse.ArgumentParser):
    """A command's parser. Its file, loaded when it is needed, has `add`, which gives arguments, and `run`.

    names: what `{scenes}` in a help stands for, asked for when the help is shown: the library takes a second to load,
    and a wrong argument is told before.
    late: optional arguments without a dash that may also stand after options, which argparse alone does not take there.
    """

    file = ""  # of the command, beside this one, until it is loaded

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.names: dict[str, Callable[[], Iterable[str]]] = {}
        self.late: tuple[str, ...] = ()

    def load(self) -> None:
        """Add the command's arguments."""
        if self.file:
            module = import_module(f".{self.file}", __package__)
            self.set_defaults(run=module.run)
            module.add(self)
            self.file = ""

    def complete(self) -> None:
        """Add the arguments, with the names in their help."""
        self.load()
        told = {name: ", ".join(names()) for name, names in self.names.items()}
        self.epilog = self.epilog and self.epilog.format(**told)
        for action in self._actions:
            action.help = action.help and action.help.format(**told)

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Options of a command, loaded first; argparse asks this of the command that is named."""
        self.load()
        options, rest = super().parse_known_args(args, namespace)
        for name in self.late:
            if rest and not rest[0].startswith("-") and getattr(options, name) is None:
                setattr(options, name, rest.pop(0))
        return options, rest

    def format_help(self) -> str:
        """Help of a command, completed first."""
        self.complete()
        return super().format_help()


def flag(command: argparse._ActionsContainer, name: str, about: str) -> None:
    """Add an option that is given or not.  about: its help."""
    command.add_argument(name, action="store_true", help=about)


# What each does, in the order of the help. To add a command, write its file and name it here.
COMMANDS = {
    "paper": "the paper's six figures and its table, measured, and four of our own, in one folder",
    "report": "error beside run time of every integrator, as pages",
    "scenes": "the scenes, with the size of their graphs",
    "equations": "the Lagrangian, momenta and torques of a scene as formulas; status 1 for a wrong formulation",
    "draw": "draw the graph of a scene's equations (SVG, PNG or DOT) or list it (TXT)",
    "code": "write a scene's equations as C, JavaScript or Python",
    "certify": "equations that a scene's graphs must fulfil, and agreement with peers; status 1 if any fails",
    "inspect": "one page on which a scene's equations unfold, move and answer; status 1 for a motion cut short",
    "live": "one page that computes a scene's motion, with sliders and meters",
    "simulate": "the motion of a scene: how the run went, its energy, and as CSV; status 1 if it is cut short",
    "animate": "a film of a scene in motion (GIF); status 1 for a motion cut short",
    "type": "a page that a Lagrangian is typed into: derived, checked, drawn, moving",
    "lint": "check that a scene's equations are those of the chain rule; status 1 and the blame if they are not",
    "why": "what makes a torque, by cause and body; why it depends on an input; where a NaN comes from",
    "compare": "compare two formulations of a scene's equations, node by node; status 1 where they differ",
    "lesson": "a page for a class, on any scene: predict, reveal, try; a worksheet, and the key to it",
}

ALIKE = 0.7  # share of the letters that two words have in common
OPTIONS = ("-h", "--help", "--version")  # of the command line itself


def parsers() -> tuple[argparse.ArgumentParser, dict[str, Command]]:
    """The parser of the command line, and those of its commands; what it parses has `run`, the command's function."""
    whole = argparse.ArgumentParser(
        prog="cgraph", description="Equations of motion as computational graphs: see, count, draw and simulate them."
    )
    whole.add_argument("--version", action="version", version=f"cgraph {__version__}")
    commands = whole.add_subparsers(title="commands", required=True, metavar="COMMAND", parser_class=Command)
    for name, about in COMMANDS.items():
        commands.add_parser(name, help=about).file = name
    return whole, dict(commands.choices)


def complete() -> dict[str, Command]:
    """The parsers of all commands by name, with their arguments and all that their help says."""
    _, commands = parsers()
    for command in commands.values():
        command.complete()
    return commands


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The options that arguments stand for; without any, the help. Wrong ones end in SystemExit with status 2.

    argparse takes the words of a list from one place; of those that an option parts (`a --quick b`) the rest follow.
    """
    whole, commands = parsers()
    words = sys.argv[1:] if arguments is None else list(arguments)
    if not words:
        words = ["--help"]
    elif words[0] not in COMMANDS and not any([option.startswith(words[0]) for option in OPTIONS]):
        hint = _nearest(words[0], [*COMMANDS, *OPTIONS]) or "`cgraph` alone lists the commands"
        whole.error(f"there is no {'option' if words[0].startswith('-') else 'command'} {words[0]!r}: {hint}")
    options, rest = whole.parse_known_args(words)
    if rest:
        several = getattr(options, getattr(options, "words", ""), None)
        if several is None or any([each.startswith("-") for each in rest]):
            command = commands[words[0]]
            hint = _nearest(rest[0].partition("=")[0], command._option_string_actions)
            command.error(f"unrecognized arguments: {' '.join(rest)}{hint and f'; {hint}'}")
        several.extend(rest)
    return options


def _nearest(word: str, known: Iterable[str]) -> str:
    """A question for the known word that is spelled most like a word; "" where none is like it."""
    near = difflib.get_close_matches(word.casefold(), known, 1, ALIKE)
    return f"did you mean {near[0]!r}?" if near else ""
