"""`cgraph completion`: what the Tab key completes, as a script for a shell, written from the parser's arguments."""

from __future__ import annotations

import argparse
from collections.abc import Callable

import dynamics as dyn

from .arguments import answer
from .command import Command
from .parser import complete

Words = dict[str, list[str]]  # by what stands before the word: a command, or a command and an option with choices


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.add_argument("shell", choices=SHELLS, help='bash or zsh: eval "$(cgraph completion bash)"; fish: | source')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the script."""
    names = {name: _words(parser) for name, parser in complete().items()}
    answer(SHELLS[options.shell](names))


def _words(parser: argparse.ArgumentParser) -> Words:
    """What may stand after the command: at "", its options and words; at an option, what that takes."""
    words: Words = {"": []}
    for action in parser._actions:
        choices = [str(choice) for choice in action.choices or ()]
        words[""] += action.option_strings or choices or (dyn.scenes.names() if "SCENE" in str(action.metavar) else [])
        if action.option_strings and choices:
            words |= dict.fromkeys(action.option_strings, choices)
    return words


def _cases(names: dict[str, Words], command: str, before: str) -> list[str]:
    """Branches of a shell's `case`: the words after an option of a command, or after the command."""
    return [
        f"    {command.format(name)}{before.format(option) if option else '*'}) choices={' '.join(words)!r} ;;"
        for name, each in names.items()
        for option, words in sorted(each.items(), reverse=True)
    ]


def _bash(names: dict[str, Words]) -> str:
    """Where no word fits, and after an option that takes a file, files are completed."""
    lines = [
        "_cgraph() {",
        '  local word="${COMP_WORDS[COMP_CWORD]}" choices=""',
        '  case "$COMP_CWORD ${COMP_WORDS[1]} ${COMP_WORDS[COMP_CWORD-1]}" in',
        f"    1\\ *) choices={' '.join([*names, '--version', '--help'])!r} ;;",
        *_cases(names, "*\\ {}\\ ", "{}"),
        "  esac",
        '  COMPREPLY=($(compgen -W "$choices" -- "$word"))',
        "}",
        "complete -o default -F _cgraph cgraph",
    ]
    return "\n".join(lines)


def _zsh(names: dict[str, Words]) -> str:
    lines = [
        "_cgraph() {",
        "  local choices=''",
        '  case "$CURRENT ${words[2]} ${words[CURRENT-1]}" in',
        f"    2\\ *) choices={' '.join([*names, '--version', '--help'])!r} ;;",
        *_cases(names, "*\\ {}\\ ", "{}"),
        "  esac",
        "  compadd -- ${=choices}",
        "  _files",
        "}",
        "compdef _cgraph cgraph",
    ]
    return "\n".join(lines)


def _fish(names: dict[str, Words]) -> str:
    lines = [f"complete -c cgraph -n __fish_use_subcommand -f -a {' '.join([*names, '--version', '--help'])!r}"]
    for name, each in names.items():
        within = f"complete -c cgraph -n '__fish_seen_subcommand_from {name}'"
        lines.append(f"{within} -a {' '.join(each[''])!r}")
        lines += [
            f"{within} -l {option.removeprefix('--')} -x -a {' '.join(words)!r}"
            for option, words in each.items()
            if option.startswith("--")
        ]
    return "\n".join(lines)


SHELLS: dict[str, Callable[[dict[str, Words]], str]] = {"bash": _bash, "zsh": _zsh, "fish": _fish}
