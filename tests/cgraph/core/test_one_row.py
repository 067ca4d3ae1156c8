"""A row is all: an operation that is added as one row, in a fresh process, works in every part of the library."""

import re

import pytest

from tests.processes import printed_by
from tests.sources import ROOT

PROGRAM = """
import math, sys
import numpy as np
import pytest
import cgraph as cg
from cgraph.extend import Op, register

register(Op("asinh", 1, math.asinh, np.arcsinh, lambda y, x: (1.0 / cg.hypot(1.0, x),), samples=((0.6,),)))
sys.exit(pytest.main(["-v", "-p", "no:cacheprovider", *sys.argv[1:]]))
"""
# The tests that go through the operation table, or draw operations from it.
TABLE = (
    "tests/cgraph/core/test_operations.py",
    "tests/cgraph/core/test_function_factory.py",
    "tests/cgraph/codegen/test_strict.py",
    "tests/cgraph/codegen/test_llvm.py",
    "tests/cgraph/codegen/test_c.py",
    "tests/cgraph/codegen/test_javascript.py",
    "tests/cgraph/explain/lint/test_lint.py",
    "tests/viz/graph_drawing/test_dot.py",
    "tests/viz/inspector/test_script.py",
    "tests/dynamics/multiprecision/test_taylor_series.py",
)


def outcomes(*arguments: str) -> dict[str, list[str]]:
    """{file: what came of each of its tests} of a run in a process that has the row."""
    found: dict[str, list[str]] = {}
    text = printed_by(PROGRAM, *arguments)
    for file, outcome in re.findall(r"^(\S+\.py)::.* (PASSED|SKIPPED|FAILED|ERROR)", text, re.MULTILINE):
        found.setdefault(file, []).append(outcome)
    return found


@pytest.mark.slow
def test_every_part_of_the_library_takes_the_operation_and_the_tests_of_the_table_accept_it() -> None:
    """Without a word about it in any of them."""
    pytest.importorskip("llvmlite")  # without which these files have nothing to run
    file = "tests/cgraph/core/asinh_everywhere.py"
    found = outcomes(file, *TABLE, "-k", "asinh or every_operation or the_script_knows or slopes_are or no_slope")
    assert found[file].count("PASSED") >= 12
    assert set(found) == {file, *TABLE}


def test_no_test_of_the_table_names_the_operation() -> None:
    assert [file for file in TABLE if "asinh" in (ROOT / file).read_text(encoding="utf-8")] == []
