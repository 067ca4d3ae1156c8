"""Equations of a graph as MathML, which browsers draw without a script or a font from the net."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from cgraph import Graph
from cgraph.extend import Formulas, Notation, Op

from .. import theme

SUM, FUNCTION, LEAF = 1, 3, 4  # how strongly a text binds, as in the rows of operations
FEW = 8  # names that a sentence lists


def equations(graph: Graph, names: Mapping[str, str], lines: int = 12) -> str:
    """The outputs of a graph, and what several of them need, as aligned equations; the last says what is left out.

    names: {name in the graph: text shown}.
    """
    shown = {
        name: names.get(name, theme.pretty(name))
        for name in (*[node.name for node in graph.nodes if node.name], *graph.outputs)
    }
    found = Formulas(graph.nodes, graph.outputs, _MATHML, shown).lines(list(graph.outputs.values()), lines)
    rows = "".join(
        f"<mtr><mtd>{left}</mtd><mtd><mo>=</mo></mtd><mtd>{right}</mtd></mtr>" for left, right in found.equations
    )
    total = len(found.equations) + len(found.left_out)
    missing = few([f"<math>{left}</math>" for left in found.left_out])
    rest = f"<p>{len(found.left_out)} of {total} lines are left out: those of {missing}.</p>" if found.left_out else ""
    table = f'<mtable columnalign="right center left">{rows}</mtable>'
    return f'<div class="scroll" tabindex="0" role="group"><math display="block">{table}</math></div>{rest}'


def few(texts: Sequence[str]) -> str:
    """The first of some texts, and how many more there are."""
    more = len(texts) - FEW
    return ", ".join(texts) if more <= 0 else f"{', '.join(texts[:FEW])} and {more} more"


def _names(names: Iterable[str]) -> dict[str, str]:
    return {name: f"<mi>{escape(name)}</mi>" for name in names}


def _number(value: float) -> tuple[str, int]:
    text = f"{value:.4g}"
    if text.startswith("-"):
        return f"<mrow><mo>−</mo><mn>{text[1:]}</mn></mrow>", SUM
    return f"<mn>{text}</mn>", LEAF


def _operation(op: Op, args: Sequence[tuple[str, int]]) -> tuple[str, int]:
    if op.mathml is None:
        listed = "<mo>,</mo>".join([text for text, _ in args])
        return f"<mrow><mi>{escape(op.name)}</mi>{_fenced(listed)}</mrow>", FUNCTION
    inside = [
        _fenced(text) if binds < least else text for (text, binds), least in zip(args, op.mathml.least, strict=True)
    ]
    return f"<mrow>{op.mathml.text.format(*inside)}</mrow>", op.mathml.binding


def _fenced(text: str) -> str:
    return f'<mrow><mo stretchy="false">(</mo>{text}<mo stretchy="false">)</mo></mrow>'


_MATHML = Notation(_names, _number, _operation, "<msub><mi>v</mi><mn>{}</mn></msub>".format)
