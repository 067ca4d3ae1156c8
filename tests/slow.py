"""Values of a parameter that only `-m slow` tries: the largest, and the rest of many."""

from typing import Any

from pytest import mark, param


def slow(*values: Any) -> list[Any]:
    """Marked; a tuple holds the values of several parameters."""
    rows = [value if isinstance(value, tuple) else (value,) for value in values]
    return [param(*row, marks=mark.slow) for row in rows]
