"""The operations of the table for the page's script: their values as JavaScript, their formulas as MathML."""

from __future__ import annotations

import json

from cgraph.extend import OPS


def operations() -> str:
    """The script's constants: VALUE {operation: function}, FORMULA {operation: [MathML, least binding, binding]}.

    In the MathML {0}, {1}, .. stand for arguments; an operation without one is written as a function.
    """
    values = ",\n".join([f"  {op.name}: {op.javascript}" for op in OPS.values()])
    formulas = {op.name: op.mathml for op in OPS.values() if op.mathml is not None}
    return f"const VALUE = {{\n{values},\n}};\nconst FORMULA = {json.dumps(formulas, ensure_ascii=False)};\n"
