"""The engine of the typed page as one script."""

from __future__ import annotations

import json

from .. import theme
from ..pages import html
from ..pages.html import asset
from ..pages.operations import operations

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

    It needs the constants of `operations` and graph.js, and makes one, TYPED.
    """
    letters = json.dumps(theme.LETTERS, separators=(",", ":"), ensure_ascii=False)
    return f"const TYPED = (() => {{\nconst LETTERS = {letters};\n{asset(__package__, *FILES)}\n}})();\n"


def script() -> str:
    """The engine with what it needs, for a program that has no page."""
    return f'"use strict";\n{operations()}{asset(html.__package__, "graph.js")}{engine()}'
