"""How Sphinx builds these pages; `make docs` runs it with warnings as errors."""

import argparse
import re
from textwrap import indent

from docutils import nodes
from docutils.parsers.rst import Directive

from cgraph import __version__
from viz.commands.parser import parser

project = "cgraph"
author = "the cgraph authors"
copyright = "2026, the cgraph authors"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = "cgraph"

suppress_warnings = ["ref.python"]  # a word of a type that is some attribute: the n of "n sequences of Node"
napoleon_google_docstring = False
napoleon_custom_sections = [("Attributes", "params_style")]  # a table, not members beside those that autodoc lists
autodoc_member_order = "bysource"
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Matrix", "Scalar", "Value", "Vector")}
python_maximum_signature_line_length = 100


SECTION = re.compile(r"(?<=\n)(?=\w[\w ]*\n-{3,}\n)")  # before the title of a section in NumPy's style


def docstring_to_rst(app, what, name, obj, options, lines):
    """Docstrings here are plain text with `code` in single backticks; say that in reStructuredText.

    Napoleon, which comes after, makes tables of the sections. Of the text before them, an indented paragraph is code.
    """
    text, *sections = SECTION.split("\n".join(lines).strip("\n") + "\n")
    paragraphs = map(_paragraph, re.split(r"\n\s*\n", text.strip("\n")))
    lines[:] = "\n\n".join([*paragraphs, *map(_section, sections)]).split("\n")


def _section(text):
    title, line, *body = text.split("\n")
    if title == "Examples":
        return text
    return "\n".join([title, line, *map(_prose, body)])


def _paragraph(text):
    if text.startswith((" ", ">>> ")):
        return "::\n\n" + indent(text, "    ")
    if "\n " in text:  # indented lines below the first: keep the lines
        return "\n".join("| " + re.match(" *", line)[0] + _prose(line.strip()) for line in text.split("\n"))
    return _prose(text)


def _prose(text):
    parts = re.split(r"`+([^`]+)`+", text)
    parts[::2] = [re.sub(r"([\\*|_])", r"\\\1", prose) for prose in parts[::2]]
    parts[1::2] = [f"\\ ``{code}``\\ " for code in parts[1::2]]  # an escaped space ends markup and takes no room
    return "".join(parts)


def name_aliases(app, what, name, obj, options, signature, return_annotation):
    """In a union autodoc writes the wrapper of a type's name instead of the name."""
    if signature:
        wrapper = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")
        return wrapper.sub(r"\1", signature), wrapper.sub(r"\1", return_annotation or "")
    return None


def skip_fields(app, what, name, obj, skip, options):
    """Fields of named tuples stand in the table of the class already."""
    return True if (getattr(obj, "__doc__", None) or "").startswith("Alias for field number") else None


class CommandReference(Directive):
    """Every command with its arguments, from the parser: no text that could be out of date."""

    def run(self):
        whole = parser()
        (commands,) = [action for action in whole._actions if isinstance(action, argparse._SubParsersAction)]
        about = {each.dest: each.help for each in commands._choices_actions}
        return [_command(name, about[name], command) for name, command in commands.choices.items()]


def _command(name, about, command):
    section = nodes.section(ids=[f"cgraph-{name}"], names=[f"cgraph {name}"])
    section += nodes.title(text=f"cgraph {name}")
    section += nodes.paragraph(text=about)
    listed = nodes.definition_list()
    shown = command._get_formatter()
    for action in command._actions:
        if "--help" not in action.option_strings:
            term = nodes.term("", "", nodes.literal(text=shown._format_action_invocation(action)))
            text = shown._expand_help(action) if action.help else ""
            listed += nodes.definition_list_item("", term, nodes.definition("", nodes.paragraph(text=text)))
    section += listed
    if command.epilog:
        section += nodes.line_block("", *[nodes.line(text=line) for line in command.epilog.splitlines()])
    return section


def setup(app):
    """Called by Sphinx."""
    app.add_directive("command-reference", CommandReference)
    app.connect("autodoc-skip-member", skip_fields)
    app.connect("autodoc-process-docstring", docstring_to_rst, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", name_aliases)
