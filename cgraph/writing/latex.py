"""LaTeX: formulas of nodes and graphs; an operation's formula is its row's MathML, told in other words."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

from ..core.graph import Graph
from ..core.node import Node
from ..core.traversal import topological
from ..operations.operation import FUNCTION, LEAF, PRODUCT, SUM, Op
from ..util.caches import OPERATIONS, memo
from .formulas import LINES, Formulas, Lines, Notation, Text, fraction
from .symbols import GREEK, is_letter, symbol

_ACCENTS = {"dot": r"\dot{{{}}}", "ddot": r"\ddot{{{}}}", "bar": r"\bar{{{}}}"}
_SIGNS = {"·": r"\cdot", "−": "-", "≤": r"\leq", "≠": r"\neq", "⌊": r"\lfloor", "⌋": r"\rfloor",
          "⌈": r"\lceil", "⌉": r"\rceil"}  # fmt: skip
_FUNCTIONS = {name: f"\\{name}" for name in "sin cos tan sinh cosh tanh exp".split()}
_FUNCTIONS |= {"log": r"\ln", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan"}
_FUNCTIONS |= {"minimum": r"\min", "maximum": r"\max"}
_KNOWN = ("log", "min", "max")  # functions of LaTeX that rows name
_FORMS = {"msup": "{{{}}}^{{{}}}", "msub": "{}_{{{}}}", "mfrac": r"\frac{{{}}}{{{}}}", "mroot": r"\sqrt[{1}]{{{0}}}"}
_SPECIAL = {"\\": r"\backslash ", "^": r"\hat{}", "~": r"\sim "} | {sign: f"\\{sign}" for sign in "#$%&_{}"}

FormulaPart = str | int | list[Any]  # of a formula: a text, the number of an argument, [element, attributes, *parts]


def latex(what: Node | Graph, *, names: Mapping[str, str] | None = None, lines: int = LINES) -> str:
    r"""The formula of a node, or the equations of a graph, as LaTeX.

    Parameters
    ----------
    what : Node or Graph
        The node or the graph.
    names : mapping of str to str, optional
        {name of a variable or node: what a person calls it}.
    lines : int
        Lines of an aligned block, at most; a last one says how many are left out.

    Returns
    -------
    str
        The formula of a node; an aligned block of a graph, or if parts of the formula have names or are needed more
        than once: a node that several lines need, or that has a name, has a line.

    Raises
    ------
    TypeError
        For what is neither a node nor a graph.
    ValueError
        For fewer than one line.

    Examples
    --------
    >>> import cgraph as cg
    >>> m, v = cg.variables("m v")
    >>> print(cg.latex(0.5 * m * v**2))
    \frac{1}{2} \, m \, {v}^{2}
    """
    if isinstance(what, Graph):
        return latex_block(Formulas(what.nodes, what.outputs, LATEX, names).lines(list(what.outputs.values()), lines))
    if not isinstance(what, Node):
        raise TypeError(f"latex needs a node or a graph, got {type(what).__name__}: {what!r:.60}")
    found = Formulas(topological([what]), {}, LATEX, names).lines([what], lines)
    return found.equations[0][1] if len(found.equations) == 1 and not found.left_out else latex_block(found)


def latex_block(lines: Lines) -> str:
    """Equations as an aligned block; a last line says how many are left out."""
    rows = [f"{left} &= {right}" if left else f"& {right}" for left, right in lines.equations]
    if lines.left_out:
        few = ", ".join(lines.left_out[:3]) + (r", \dots" if len(lines.left_out) > 3 else "")
        total = len(lines.left_out) + len(lines.equations)
        rows.append(f"& {literal(f'left out: {len(lines.left_out)} of {total} lines, of ')}{few}")
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"


def literal(text: str) -> str:
    """LaTeX of any text as one upright word."""
    return rf"\mathrm{{{''.join([_SPECIAL.get(sign, sign) for sign in text]).replace(' ', '~')}}}"


def name_texts(names: Iterable[str]) -> dict[str, str]:
    """Names in LaTeX, {name: text}; two that would look the same are written as they are."""
    texts = {name: _name(name) for name in names}
    seen = Counter(texts.values())
    return {name: text if seen[text] == 1 else literal(name) for name, text in texts.items()}


def _name(name: str) -> str:
    r"""q0 is q_{0}, qd.knee is \dot{q}_{knee}, qd.theta is \dot{\theta}, M_0_1 is M_{0,1}, p0_dot is \dot{p}_{0}."""
    found = symbol(name)
    if found is None:
        return literal(name)
    word = found.word
    text = word if len(word) == 1 else f"\\{word}" if word in GREEK else literal(word)
    text = _ACCENTS[found.accent].format(text) if found.accent else text
    text = rf"\partial {text}" if found.before else text
    below = [_index(each) for each in found.below]
    return f"{text}_{{{','.join(below)}}}" if below else text


def _index(name: str) -> str:
    """An index: a number or a letter, which may have a number in turn; else a word."""
    found = symbol(name)
    return _name(name) if found and is_letter(found.word) else name if name.isdigit() else literal(name)


def number_text(value: float, digits: int = 17) -> Text:
    """A number in so many digits, 17 of which are all."""
    if (parts := fraction(value)) is not None:
        return rf"\frac{{{parts[0]}}}{{{parts[1]}}}", PRODUCT
    text = f"{value!r}".removesuffix(".0") if digits >= 17 else f"{value:.{digits}g}"
    text, _, power = text.partition("e")
    if text.lstrip("-") in ("inf", "nan"):
        return text.replace("inf", r"\infty ").replace("nan", r"\mathrm{nan}"), LEAF if value > 0 else SUM
    text = rf"{text} \cdot 10^{{{int(power)}}}" if power else text
    return text, SUM if value < 0.0 else PRODUCT if power else LEAF


def operation_text(op: Op, args: Sequence[Text]) -> Text:
    """An operation on arguments, those that bind less than their places ask for in parentheses."""
    if op.mathml is None:
        function = _FUNCTIONS.get(op.name) or rf"\operatorname{{{op.name.replace('_', chr(92) + '_')}}}"
        return f"{function}{_fenced(', '.join([text for text, _ in args]))}", FUNCTION
    inside = [
        _fenced(text) if binds < least else text for (text, binds), least in zip(args, op.mathml.least, strict=True)
    ]
    text = _part(formula_tree(op), inside).strip()
    return re.sub(r"\\cdot (?=[^0-9\-.])", r"\\, ", text), op.mathml.binding


def _fenced(text: str) -> str:
    return rf"\left({text}\right)"


@memo(OPERATIONS)
def formula_tree(op: Op) -> FormulaPart:
    """The MathML of an operation as a tree. Raises ValueError where it is not well formed."""
    mathml = "" if op.mathml is None else op.mathml.text
    try:
        return _tree(ElementTree.fromstring(f"<mrow>{mathml}</mrow>"))  # noqa: S314 (the table's own text)
    except ElementTree.ParseError as error:
        raise ValueError(f"the MathML {mathml!r} of operation {op.name!r} is not well formed: {error}") from None


def _tree(element: ElementTree.Element) -> FormulaPart:
    parts = _text_parts(element.text)
    for child in element:
        parts += [_tree(child), *_text_parts(child.tail)]
    return [element.tag, element.attrib, *parts]


def _text_parts(text: str | None) -> list[FormulaPart]:
    """Text and the numbers of arguments, which stand as {0}, {1}, .. in it."""
    return [int(part) if k % 2 else part for k, part in enumerate(re.split(r"{(\d)}", text or "")) if part]


def _part(part: FormulaPart, args: Sequence[str]) -> str:
    """The LaTeX of a part of a formula."""
    if not isinstance(part, list):
        return part if isinstance(part, str) else args[part]
    tag, _, *inside = part
    parts = [_part(each, args) for each in inside]
    if tag in _FORMS:
        return _FORMS[tag].format(*parts)
    text = "".join(parts)
    if tag == "msqrt":
        return rf"\sqrt{{{text}}}"
    if tag == "mo":
        sign = _SIGNS.get(text, text)
        return sign if text in "()|" else f" {sign} "
    if tag == "mi" and len(text) > 1:
        return rf"\{text}" if text in _KNOWN else literal(text)
    return text


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    inside = r" \\ ".join([" & ".join(row) for row in rows])
    return rf"\begin{{pmatrix}} {inside} \end{{pmatrix}}"


LATEX = Notation(name_texts, number_text, operation_text, "v_{{{}}}".format, _matrix)
