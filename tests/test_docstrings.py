"""Docstrings: every example runs and prints what it shows, and what is public says its parameters."""

import doctest
import importlib
import inspect
import re
from functools import cache
from pathlib import Path
from types import FunctionType

import numpy as np
import pytest

import cgraph as cg
import cgraph.extend
import dynamics as dyn
import viz
from cgraph._shared import install
from cgraph.operations.table import OPS
from tests.sources import result_types, sources

PUBLIC = (cg, cgraph.extend, dyn, viz)
# What an example may use without importing it, beside the names of its module; in its output `...` is any text.
NAMES = {"cg": cg, "dyn": dyn, "viz": viz, "np": np}
FLAGS = doctest.ELLIPSIS


@cache
def examples() -> dict[str, list[doctest.DocTest]]:
    """{package.folder: examples in the docstrings of its modules}."""
    finder, found = doctest.DocTestFinder(exclude_empty=True), {}
    for source in sources().values():
        if ">>> " in source.text:
            tests = [test for test in finder.find(importlib.import_module(source.module)) if test.examples]
            found.setdefault(".".join(source.module.split(".")[:2]), []).extend(tests)
    return found


def run(example: doctest.DocTest) -> str:
    """Raises AssertionError for another output; what an optional package says that is missing, else nothing."""
    example.globs = NAMES | example.globs
    try:
        doctest.DebugRunner(optionflags=FLAGS).run(example)
    except doctest.DocTestFailure as failure:
        shown = f"{failure.example.source}Expected:\n{failure.example.want}Got:\n{failure.got}"
        raise AssertionError(f"{example.filename}, {example.name}:\n{shown}") from None
    except doctest.UnexpectedException as failure:
        error = failure.exc_info[1]
        if isinstance(error, ImportError) and install("").partition("'")[0] in str(error):
            return str(error)
        raise error from None
    return ""


@pytest.mark.parametrize("room", examples())
def test_an_example_prints_what_is_shown(room: str, here: Path) -> None:
    if absent := list(filter(None, map(run, examples()[room]))):
        pytest.skip(f"not run: {', '.join(absent)}")


def public() -> dict[str, type | FunctionType]:
    """{dotted name: object} of the public functions and classes and of results, without errors and operations."""
    named = {f"{module.__name__}.{name}": getattr(module, name) for module in PUBLIC for name in module.__all__}
    named |= result_types()
    operations = {f"cgraph.{name}" for name in OPS}
    return {
        name: value
        for name, value in named.items()
        if isinstance(value, FunctionType) or (isinstance(value, type) and not issubclass(value, Exception))
        if name not in operations
    }


def section(docstring: str, title: str) -> str | None:
    """The lines of a section in NumPy's style, or None."""
    match = re.search(rf"^{title}\n-{{{len(title)}}}\n(.*?)(?=^\w[\w ]*\n---|\Z)", docstring, re.MULTILINE | re.DOTALL)
    return match[1] if match else None


def documented(text: str) -> list[str]:
    """The names that a section explains: of `a, b : int` and `*args : str`, `a`, `b` and `args`."""
    heads = re.findall(r"^(\*{0,2}\w[\w*, ]*?)(?: : .*)?$", text, re.MULTILINE)
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def lacks(value: type | FunctionType) -> list[str]:
    """What a docstring should have and has not, in words."""
    docstring = inspect.getdoc(value) or ""
    missing = [] if ">>> " in (section(docstring, "Examples") or "") else ["Examples"]
    explained = section(docstring, "Parameters")
    if isinstance(value, type):
        has_fields = any(not name.startswith("_") for name in getattr(value, "__annotations__", ()))
        if has_fields and explained is None and section(docstring, "Attributes") is None:
            missing.append("Attributes or Parameters")
    elif inspect.signature(value).parameters:
        taken = list(inspect.signature(value).parameters)
        if explained is None:
            missing.append("Parameters")
        elif sorted(documented(explained)) != sorted(taken):
            missing.append(f"Parameters for {', '.join(taken)} (it has {', '.join(documented(explained))})")
    return missing


NODES = ("cgraph.extend", "cgraph.autodiff", "cgraph.program")  # for whoever builds on nodes: a sentence, an example


def test_what_is_public_says_its_parameters_and_shows_an_example() -> None:
    offenders = {}
    for name, value in public().items():
        helper = name.startswith(NODES)
        if missing := ([] if ">>> " in (value.__doc__ or "") else ["Examples"]) if helper else lacks(value):
            offenders[name] = missing
    assert offenders == {}


def test_what_a_docstring_lacks_is_seen() -> None:
    def bare(a: int, *, b: int) -> None:
        """One line."""

    def whole(a: int, *, b: int) -> None:
        """One line.

        Parameters
        ----------
        a, b : int
            Numbers.

        Examples
        --------
        >>> 1 + 1
        2
        """

    def renamed(a: int, *, c: int) -> None: ...

    renamed.__doc__ = whole.__doc__
    assert lacks(bare) == ["Examples", "Parameters"]
    assert lacks(whole) == []
    assert lacks(renamed) == ["Parameters for a, c (it has a, b)"]


def test_an_example_that_prints_something_else_fails() -> None:
    with pytest.raises(AssertionError, match="Got:\n2"):
        run(doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "sum", None, 0))
