"""Test the tests: a check of rows in one case sees the row that fails."""

import pytest

pytest_plugins = ["pytester"]

TABLE = """
import pytest
from tests.each_row import each_row

@each_row("a, b", [(1, 1), (2, 3), (3, 4), pytest.param(4, 4, marks=pytest.mark.skip)])
def test_alike(a, b, tmp_path):
    assert a == b

@each_row("a, b", [("x", 1), ("y", 2), ("x", 3)], by="a")
def test_small(a, b):
    assert b < 3
"""


def test_every_row_that_fails_is_told(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(TABLE)
    result = pytester.runpytest_inprocess("-p", "no:randomly")
    result.assert_outcomes(passed=1, failed=2, skipped=1)
    text = result.stdout.str()
    assert "(2, 3)" in text
    assert "(3, 4)" in text
    assert "('x', 3)" in text
