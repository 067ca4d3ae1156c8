"""The page of all commands: their usage and arguments, as the parsers have them."""

import argparse
import re
from functools import partial

WIDTH = 88  # columns of the usage


def markdown(commands):
    """Sections in Markdown, one for each command, {name: parser}."""
    from viz.commands.command import COMMANDS

    return "\n".join(_section(name, COMMANDS[name], command) for name, command in commands.items())


def _section(name, summary, command):
    command.formatter_class = partial(argparse.HelpFormatter, width=WIDTH)
    formatter = command._get_formatter()
    usage = command.format_usage().removeprefix("usage: ").strip()
    lines = [f"## cgraph {name}", "", _sentence(summary), "", "```sh", re.sub(r"\n {7}", "\n", usage), "```", ""]
    for action in command._actions:
        if action.dest != "help":
            lines += [f"`{formatter._format_action_invocation(action)}`"]
            lines += [f": {_sentence(formatter._expand_help(action)) if action.help else ''}", ""]
    return "\n".join(lines)


def _sentence(text):
    """Text of a help as Markdown: a capital first where it is a word, a period last, no character that means more."""
    text = re.sub(r"([\\*_${}\[\]<>|])", r"\\\1", text.strip())
    first = text.split(" ", 1)[0]
    start = text[:1].upper() if first.isalpha() and first.islower() else text[:1]
    return start + text[1:] + ("" if text[-1:] in ".?!" else ".")


def _append(app, name, source):
    from viz.commands.command import complete

    if name == "command-reference":
        source[0] += "\n" + markdown(complete())


def setup(app):
    """Called by Sphinx."""
    app.connect("source-read", _append)
    return {"parallel_read_safe": True}
