"""Rows of a reader's own in a table of the library, of methods or of types of joints, for as long as a test takes."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def registered(table: dict[str, Any], **rows: Any) -> Iterator[None]:
    """What had these names comes back."""
    before = {name: table[name] for name in rows if name in table}
    table.update(rows)
    try:
        yield
    finally:
        for name in rows:
            del table[name]
        table.update(before)
