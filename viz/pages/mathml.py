"""Equations as MathML, which browsers draw without a script or a font from the net."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape

from cgraph import Graph, variable
from cgraph._shared import GREEK, Side, fraction, is_letter, reading_form, statements, symbol
from cgraph.extend import Notation, Op

from .. import theme

SUM, PRODUCT, FUNCTION, LEAF = 1, 2, 3, 4  # how strongly a text binds, as in the rows of operations
FEW = 8  # names that a sentence lists
DIGITS = 4  # of numbers
# Of every page with equations. Some browsers align the columns of a table by it, others by the attribute; the brackets
# of a matrix are lines, since parentheses grow only in a font that is made for mathematics.
STYLE = """
div.scroll:has(> math) { overflow-x: auto; } div.scroll > math { width: max-content; margin: 2px 0 2px 1em; }
mtable.aligned > mtr > mtd { text-align: left; padding: 3px 2px; }
mtable.aligned > mtr > mtd:first-child { text-align: right; }
mtable.matrix { border: solid; border-width: 0 1.5px; border-radius: 9px; padding: 0 4px; margin: 3px 0; }
mtable.matrix mtd { padding: 2px 6px; }
"""
_ACCENTS = {"dot": "\u02d9", "ddot": "\u00a8", "bar": "\u00af"}


def equations(graph: Graph, names: Mapping[str, str], lines: int = 12) -> str:
    """The outputs of a graph, and what several of them need, as aligned equations; the last says what is left out.

    names: {name in the graph: what a person calls it}, such as `dynamics.display_names(model)`, or letters.
    """
    rights = reading_form(list(graph.outputs.values()), ranks(graph.input_names))
    return typeset([(variable(name), right) for name, right in zip(graph.outputs, rights, strict=True)], names, lines)


def typeset(given: Sequence[Sequence[Side]], names: Mapping[str, str], lines: int, *, rest: str = "") -> str:
    """Statements that sides are equal, of nodes in reading form, as aligned equations; the last says what is left out.

    given: of each statement its sides from the left; a matrix, by rows, stands on the right.  rest: HTML behind the
    sentence on what is left out, such as the command that prints all.
    """
    found = statements(given, NOTATION, names, lines, whole=True)
    rows = "".join(
        f"<mtr><mtd>{left}</mtd><mtd>{'<mo>=</mo>' if left else ''}</mtd><mtd>{right}</mtd></mtr>"
        for left, right in found.equations
    )
    total = sum([bool(left) for left, _ in found.equations]) + len(found.left_out)
    missing = few([f"<math>{left}</math>" for left in found.left_out])
    more = f"<p>{len(found.left_out)} of {total} lines are left out: those of {missing}.{rest and f' {rest}'}</p>"
    table = f'<mtable class="aligned" columnalign="right center left" displaystyle="true">{rows}</mtable>'
    box = '<div class="scroll" tabindex="0" role="group" aria-label="equations">'
    return f'{box}<math display="block">{table}</math></div>' * bool(rows) + more * bool(found.left_out)


def inline(sides: Sequence[Side], names: Mapping[str, str]) -> str:
    """A statement in a line of text, of nodes in reading form; one side alone is a formula."""
    found = statements([(variable("left"), each) for each in sides], NOTATION, names)
    return f"<math>{'<mo>=</mo>'.join([right for _, right in found.equations])}</math>"


def few(texts: Sequence[str]) -> str:
    """The first of some texts, and how many more there are."""
    more = len(texts) - FEW
    return ", ".join(texts) if more <= 0 else f"{', '.join(texts[:FEW])} and {more} more"


def ranks(names: Iterable[str]) -> dict[str, int]:
    """Ranks of the inputs of graphs of mechanics, see `reading_form`: parameters, coordinates, rates, forces."""
    found = {}
    for name in sorted(names, key="t".__eq__):  # of parameters time is the last
        kind = symbol(name) if re.fullmatch(r"(q|qd|qdd|p|tau|lambda)\d+(_\w+)?", name) else None
        place = {"": 1, "dot": 3, "ddot": 4}[kind.accent] if kind else 0
        found[name] = {"p": 3, "tau": 5, "lambda": 5}.get(kind.word, place) if kind else 0
    return found


def _names(names: Iterable[str]) -> dict[str, str]:
    """Names in MathML, {name: text}; two that would look the same are written as they are."""
    texts = {name: _name(name) for name in names}
    alike = Counter(texts.values())
    return {name: text if alike[text] == 1 else f"<mi>{escape(name)}</mi>" for name, text in texts.items()}


def _name(name: str) -> str:
    found = symbol(name)
    if found is None:
        return f"<mi>{escape(theme.pretty(name))}</mi>"
    text = f"<mi>{escape(GREEK.get(found.word, found.word))}</mi>"
    text = f"<mover>{text}<mo>{_ACCENTS[found.accent]}</mo></mover>" if found.accent else text
    below = "<mo>,</mo>".join(
        [f"<mn>{each}</mn>" if each.isdigit() else f"<mi>{escape(_letter(each))}</mi>" for each in found.below]
    )
    text = f"<msub>{text}<mrow>{below}</mrow></msub>" if below else text
    return f"<mrow><mo>∂</mo>{text}</mrow>" if found.before else text


def _letter(index: str) -> str:
    word = index.rstrip("0123456789") if is_letter(index.rstrip("0123456789")) else ""
    return GREEK.get(word, word) + theme.pretty(f"x{index[len(word) :]}")[1:] if word else index


def _number(value: float, digits: int = DIGITS) -> tuple[str, int]:
    if (parts := fraction(value)) is not None:
        return f"<mfrac><mn>{parts[0]}</mn><mn>{parts[1]}</mn></mfrac>", PRODUCT
    text, _, power = f"{value:.{digits}g}".partition("e")
    size = f"<mn>{text.removeprefix('-').replace('inf', '∞')}</mn>"
    if power:
        exponent = f"<mo>−</mo><mn>{-int(power)}</mn>" if int(power) < 0 else f"<mn>{int(power)}</mn>"
        size = f"{size}<mo>·</mo><msup><mn>10</mn><mrow>{exponent}</mrow></msup>"
    if text.startswith("-"):
        return f"<mrow><mo>−</mo>{size}</mrow>", SUM
    return (f"<mrow>{size}</mrow>", PRODUCT) if power else (size, LEAF)


def _operation(op: Op, args: Sequence[tuple[str, int]]) -> tuple[str, int]:
    if op.mathml is None:
        listed = "<mo>,</mo>".join([text for text, _ in args])
        return f"<mrow><mi>{escape(op.name)}</mi>{_fenced(listed)}</mrow>", FUNCTION
    inside = [
        _fenced(text) if binds < least else text for (text, binds), least in zip(args, op.mathml.least, strict=True)
    ]
    text = op.mathml.text.format(*inside)
    if op.name == "mul" and not inside[1].startswith(("<mn>", "<mfrac><mn>")):
        text = '<mo lspace="0" rspace="0.17em">\u2062</mo>'.join(inside)  # a product of letters has no sign
    if inside[0] == "":  # what goes on from the row above
        text = text.replace("<mo>", '<mo form="infix">', 1)
    return f"<mrow>{text}</mrow>", op.mathml.binding


def _fenced(text: str) -> str:
    return f'<mrow><mo stretchy="false">(</mo>{text}<mo stretchy="false">)</mo></mrow>'


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    inside = "".join(f"<mtr>{''.join(f'<mtd>{entry}</mtd>' for entry in row)}</mtr>" for row in rows)
    return f'<mtable class="matrix">{inside}</mtable>'


NOTATION = Notation(_names, _number, _operation, "<msub><mi>v</mi><mn>{}</mn></msub>".format, _matrix, "<mo>=</mo>")
