"""Numbers of things in words."""

from __future__ import annotations

from .explain_failure import explain_failure
from .require import require_whole


@explain_failure
def counted(number: int, noun: str) -> str:
    """The number, at least 0, and the noun, in the plural of all but 1.

    >>> from cgraph.extend import counted
    >>> counted(1, "node"), counted(2, "node")
    ('1 node', '2 nodes')
    """
    return f"{require_whole('number', number)} {noun}{'' if number == 1 else 's'}"
