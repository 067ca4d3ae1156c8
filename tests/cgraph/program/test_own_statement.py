"""A row is all: a statement that is added as docs/extending.md says, in a fresh process, works in every program."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from cgraph.extend import STATEMENTS
from tests.test_docs import PAGES, examples

ROOT = Path(__file__).parents[3]
HERE = "tests/cgraph/program/own_statement_everywhere.py"


def test_both_runners_both_modes_and_many_take_the_statement() -> None:
    pytest.importorskip("llvmlite")
    page = PAGES["docs/extending.md"]
    blocks = [code for _, code, _ in examples(page[page.index("## A statement") : page.index("## An equation")])]
    code = "\n".join([*blocks, "import pytest, sys", f"sys.exit(pytest.main(['-qp', 'no:cacheprovider', {HERE!r}]))"])
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert re.search(r"^7 passed", done.stdout, re.MULTILINE)
    assert not [kind for kind in STATEMENTS if kind.__name__ == "Turn"]  # this process has no such row
