"""How Sphinx builds these pages; `make docs` runs it with warnings as errors."""

import re
from importlib.metadata import version as installed_version
from textwrap import indent

project = "cgraph"
author = "the cgraph authors"
copyright = "2026, the cgraph authors"
version = release = installed_version("cgraph")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax"]
myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = "cgraph"

autodoc_member_order = "bysource"
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Matrix", "Scalar", "Value", "Vector")}
python_maximum_signature_line_length = 100


def docstring_to_rst(app, what, name, obj, options, lines):
    """Docstrings here are plain text with `code` in single backticks; say that in reStructuredText.

    An indented paragraph is code; one with indented lines below its first keeps its lines. A line of dashes makes the
    line above it the title of a section, as NumPy's docstrings have them: what follows it is a list of terms, each with
    its indented text, or, under Examples, code.
    """
    text = "\n".join(lines).strip("\n")
    parts = SECTION.split(text)  # text, title, text, title, text, ..
    blocks = [_prose_paragraphs(parts[0])]
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        blocks += [f".. rubric:: {title}", (_code if title == "Examples" else _terms)(body.strip("\n"))]
    lines[:] = "\n\n".join(blocks).split("\n")


SECTION = re.compile(r"^(Parameters|Returns|Raises|Attributes|Examples|Yields|Notes)\n-{3,}$", re.MULTILINE)


def _prose_paragraphs(text):
    return "\n\n".join(map(_paragraph, re.split(r"\n\s*\n", text.strip("\n"))))


def _code(text):
    return "::\n\n" + indent(text, "    ")


def _terms(text):
    """A definition list: a line at the margin is a term, the indented lines below it are its text."""
    lines = []
    for line in text.split("\n"):
        term = bool(line[:1].strip())
        if term and lines and lines[-1][:1].strip():
            lines.append(NO_TEXT)
        lines.append(("" if term else "    ") + _prose(line.strip()) if line.strip() else "")
    return "\n".join([*lines, *([NO_TEXT] if lines[-1][:1].strip() else [])])


NO_TEXT = "    \\ "  # an escaped space: a definition must have a text


def _paragraph(text):
    if text.startswith((" ", ">>> ")):
        return "::\n\n" + indent(text, "    ")
    if "\n " in text:
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


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", docstring_to_rst)
    app.connect("autodoc-process-signature", name_aliases)
