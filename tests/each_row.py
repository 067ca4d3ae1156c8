"""Checks of the rows of a table in one case, which tells all rows that fail."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from typing import Any

import pytest


def each_row(
    names: str | Sequence[str], rows: Iterable[Any], *, by: str = ""
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """As `pytest.mark.parametrize` takes names and rows, one case for all rows without marks; others have theirs.

    by: one of the names, for a case for each of its values.
    """
    keys = [key.strip() for key in (names.split(",") if isinstance(names, str) else names)]
    groups: dict[str, list[tuple[Any, ...]]] = {}
    marked = []
    for row in rows:
        values = row.values if hasattr(row, "marks") else tuple(row) if len(keys) > 1 else (row,)
        if getattr(row, "marks", ()):
            marked.append(pytest.param([values], marks=row.marks, id="-".join(map(str, values))))
        else:
            groups.setdefault(str(values[keys.index(by)]) if by else "rows", []).append(values)
    cases = [*[pytest.param(group, id=name) for name, group in groups.items()], *marked]

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @pytest.mark.parametrize("each_row_of", cases)
        @wraps(test)
        def whole(each_row_of: list[tuple[Any, ...]], **fixtures: Any) -> None:
            wrong = []
            for values in each_row_of:
                try:
                    test(**dict(zip(keys, values, strict=True)), **fixtures)
                except Exception as error:
                    if len(each_row_of) == 1:
                        raise
                    wrong.append(f"{repr(values)[:100]}: {type(error).__name__}: {error}")
            assert not wrong, "\n".join([f"{len(wrong)} of {len(each_row_of)} rows", *wrong])

        others = [each for each in inspect.signature(test).parameters.values() if each.name not in keys]
        row_of = inspect.Parameter("each_row_of", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        whole.__signature__ = inspect.Signature([row_of, *others])  # type: ignore[attr-defined]
        return whole

    return decorate
