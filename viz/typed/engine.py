"""The engine of the typed page as one script: the operation table's rows, then the files."""

from __future__ import annotations

import json
from importlib.resources import files

from cgraph.extend import OPS

from .. import theme
from ..inspector.operations import operations
from ..inspector.record import slopes

FILES = (
    "tokens.js",
    "expressions.js",
    "statements.js",
    "system.js",
    "nodes.js",
    "folding.js",
    "derivatives.js",
    "equations.js",
    "verdict.js",
    "lint.js",
    "motion.js",
    "record.js",
    "examples.js",
    "interface.js",
)


def engine() -> str:
    """The script that reads a text and derives its equations, in a scope that shares no names with other scripts.

    It needs the constant VALUE of `operations`, and makes one constant, TYPED.
    """
    rows = {
        op.name: {
            "symbol": op.symbol,
            "arity": op.arity,
            "commutative": op.commutative,
            "selects": op.selects,
            "rounding": op.rounding,
            "singular": op.singular is not None,
            "slopes": slopes(op),
        }
        for op in OPS.values()
    }
    parts = "\n".join([files(__package__).joinpath(name).read_text(encoding="utf-8") for name in FILES])
    table = json.dumps(rows, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    letters = json.dumps(theme.LETTERS, separators=(",", ":"), ensure_ascii=False)
    return f"const TYPED = (() => {{\nconst ROWS = {table};\nconst LETTERS = {letters};\n{parts}\n}})();\n"


def script() -> str:
    """The engine with what it needs, for a program that has no page."""
    return f'"use strict";\n{operations()}{engine()}'
