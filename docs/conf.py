"""How Sphinx builds these pages; `make docs` runs it with warnings as errors."""

import re
import sys
import tomllib
from pathlib import Path
from textwrap import indent

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from cgraph import __version__  # noqa: E402 (the extensions beside this file are found by the path above)

project = "cgraph"
author = "the cgraph authors"
copyright = "2026, the cgraph authors"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_extensions.mathml",
    "sphinx_extensions.names",
    "sphinx_extensions.live_page",
    "sphinx_extensions.architecture",
    "sphinx_extensions.command_reference",
]
html_math_renderer = "mathml"
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"cgraph {version}"
html_theme_options = {"top_of_page_buttons": []}  # the source is named below the page
html_static_path = ["_static"]
html_css_files = ["pages.css"]
templates_path = ["_templates"]
html_show_search_summary = False  # would be fetched, which a page that is opened as a file may not
html_context = {  # shown below every page; where the repository is, is said in pyproject.toml
    "urls": tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"].get("urls", {})
}

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


def break_names(app, pagename, templatename, context, doctree):
    """A long name in code may go on in the next line, after a dot, a slash, colons or an underscore."""

    def broken(match):
        return match[0] if len(match[1]) < 12 else re.sub(r"([._/]|::)(?=\w)", r"\1<wbr>", match[0])

    if "body" in context:
        context["body"] = re.sub(r'<span class="pre">([^<]*)(?=</span>)', broken, context["body"])


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-skip-member", skip_fields)
    app.connect("autodoc-process-docstring", docstring_to_rst, priority=400)  # before napoleon
    app.connect("html-page-context", break_names)
    app.connect("autodoc-process-signature", name_aliases)
