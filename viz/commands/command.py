"""The parser of one command, which has its arguments once it is named, and names in its help once that is shown."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import Any


class Command(argparse.ArgumentParser):
    """A command's parser. Its arguments are given by `add` of the command's file, which is loaded when they are needed.

    names: what `{scenes}` in a help stands for, asked for when the help is shown: the library takes a second to load,
    and a wrong argument is told before.
    """

    file = ""  # of the command, beside this one, until it is loaded

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.names: dict[str, Callable[[], Iterable[str]]] = {}

    def load(self) -> None:
        """Have the command's arguments."""
        if self.file:
            import_module(f".{self.file}", __package__).add(self)
            self.file = ""

    def complete(self) -> None:
        """Have the arguments, and in their help the names."""
        self.load()
        told = {name: ", ".join(names()) for name, names in self.names.items()}
        self.epilog = self.epilog and self.epilog.format(**told)
        for action in self._actions:
            action.help = action.help and action.help.format(**told)

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """As argparse has it, which asks this of the command that is named."""
        self.load()
        return super().parse_known_args(args, namespace)

    def format_help(self) -> str:
        """As argparse has it."""
        self.complete()
        return super().format_help()
