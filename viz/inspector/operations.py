"""The operations of the table for the page's script: their values as JavaScript, their formulas as trees of MathML."""

from __future__ import annotations

import json
import re
from typing import Any
from xml.etree import ElementTree

from cgraph.extend import OPS, Op

Part = str | int | list[Any]  # of a formula: a text, the number of an argument, [element, attributes, *parts]


def operations() -> str:
    """The script's constants: VALUE {operation: function}, FORMULA operation -> [tree, least binding, binding].

    An operation without a formula is written as a function.
    """
    values = ",\n".join([f"  {op.name}: {op.javascript}" for op in OPS.values()])
    formulas = [[op.name, [_tree(op), op.mathml.least, op.mathml.binding]] for op in OPS.values() if op.mathml]
    return f"const VALUE = {{\n{values},\n}};\nconst FORMULA = new Map({json.dumps(formulas, ensure_ascii=False)});\n"


def _tree(op: Op) -> Part:
    """The formula of an operation as a tree, so that the page makes elements and reads no markup."""
    assert op.mathml is not None
    try:
        root = ElementTree.fromstring(f"<mrow>{op.mathml.text}</mrow>")  # noqa: S314 (the table's own text)
    except ElementTree.ParseError as error:
        raise ValueError(f"the MathML of operation {op.name!r} is not well formed: {error}") from None
    return _element(root)


def _element(element: ElementTree.Element) -> Part:
    """[name, attributes, *what is inside]."""
    parts = _parts(element.text)
    for child in element:
        parts += [_element(child), *_parts(child.tail)]
    return [element.tag, element.attrib, *parts]


def _parts(text: str | None) -> list[Part]:
    """Text and the numbers of arguments, which stand as {0}, {1}, .. in it."""
    return [
        int(part[1:-1]) if re.fullmatch(r"{\d}", part) else part for part in re.split(r"({\d})", text or "") if part
    ]
