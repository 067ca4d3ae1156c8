"""Formulas as MathML, which browsers draw themselves: no script, no font and no request."""

from docutils import nodes
from latex2mathml.converter import convert


def _inline(translator, node):
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _display(translator, node):
    """In a box of its own, which scrolls where the formula is wider than a phone."""
    text = node.astext().replace("{aligned}", "{align*}")  # the name that the converter has for it
    formula = convert(text, display="block")
    translator.body.append(f'<div class="formula">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app):
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    return {"parallel_read_safe": True}
