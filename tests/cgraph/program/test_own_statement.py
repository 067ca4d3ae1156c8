"""A row is all: a statement that is added as docs/extending.md says, in a fresh process, works in every program."""

import re

import pytest

from cgraph.extend import STATEMENTS
from tests.processes import printed_by
from tests.test_docs import PAGES, examples

HERE = "tests/cgraph/program/own_statement_everywhere.py"


def test_both_runners_both_modes_and_many_take_the_statement() -> None:
    pytest.importorskip("llvmlite")
    page = PAGES["docs/extending.md"]
    blocks = [code for _, code, _ in examples(page[page.index("## A statement") : page.index("## An equation")])]
    code = "\n".join([*blocks, "import pytest, sys", f"sys.exit(pytest.main(['-qp', 'no:cacheprovider', {HERE!r}]))"])
    assert re.search(r"^7 passed", printed_by(code), re.MULTILINE)
    assert not [kind for kind in STATEMENTS if kind.__name__ == "Turn"]  # this process has no such row
