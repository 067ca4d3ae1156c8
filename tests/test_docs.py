"""The pages: their examples run and print what is shown, and what they name exists."""

import os
import re
import shlex
import subprocess
import sys
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from pkgutil import resolve_name
from runpy import run_path

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from cgraph import extend
from docs.sphinx_extensions.command_reference import markdown
from tests.slow import slow
from tests.sources import listed_names, result_types
from viz.commands.command import complete, parse

ROOT = Path(__file__).parents[1]
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (
        ROOT / "README.md",
        *sorted([*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "reference").glob("*.md")]),
    )
}
RESULTS = "docs/reference/results.md"
RUN = [name for name, page in PAGES.items() if "```python\n" in page]
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MARK = "-- end of example --"
NEEDED = {  # {page: packages without which it is not run}
    "docs/bridges.md": ("casadi", "jax", "torch"),
    "docs/environments.md": ("gymnasium",),
}
SECONDS = 120  # for one page; each takes a few
# In processes of their own: JAX is set to float64, rows are added, workers are started.
APART = ("docs/bridges.md", "docs/extending.md", "docs/ensembles.md")


def examples(page: str) -> list[tuple[int, str, str]]:
    """(line, code, output) of each ```python block; its output is the next block if that is ```text, else nothing."""
    blocks = [(page.count("\n", 0, match.start(2)), match[1], match[2]) for match in FENCE.finditer(page)]
    following = [*blocks[1:], (0, "", "")]
    return [
        (line, code, after if after_kind == "text" else "")
        for (line, kind, code), (_, after_kind, after) in zip(blocks, following, strict=True)
        if kind == "python"
    ]


def program(page: str) -> str:
    """The examples of a page as one program, each on the line that it has there, with a mark printed after each."""
    lines: list[str] = []
    for line, code, _ in examples(page):
        lines += [""] * (line - len(lines)) + code.splitlines() + [f"print({MARK!r})"]
    return "\n".join(lines) + "\n"


def pictures(name: str) -> dict[str, str]:
    """{file that the examples of a page write: picture that it shows}, as of docs/x.md y.svg and images/x-y.svg."""
    found = re.findall(rf"\(images/{Path(name).stem}-([\w-]+\.(?:svg|gif|png))\)", PAGES[name])
    return {file: f"images/{Path(name).stem}-{file}" for file in found}


def commands(page: str) -> list[str]:
    """The commands `cgraph ...` that a page shows to a shell, without their first word."""
    blocks = [text for kind, text in FENCE.findall(page) if kind == "sh"]
    return re.findall(r"^(?:\S*/)?cgraph ([^#\n|]+?) *(?:[#|].*)?$", "\n".join(blocks), re.MULTILINE)


def texts(svg: Path) -> list[str]:
    """The texts of a drawing; of a plot, whose letters are outlines, the comments that spell them."""
    shown = svg.read_text(encoding="utf-8")
    return sorted(re.findall(r"<text[^>]*>([^<]*)", shown) or re.findall(r"<!-- (.*?) -->", shown))


def run_examples(name: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """The examples of a page, run in the empty folder "empty" of a folder."""
    (folder / "page.py").write_text(program(PAGES[name]), encoding="utf-8")
    (folder / "empty").mkdir()
    return subprocess.run(
        [sys.executable, "-W", "error", "-X", "utf8", str(folder / "page.py")],
        cwd=folder / "empty",
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        encoding="utf-8",
        timeout=SECONDS,
        check=False,
    )


def test_an_example_has_the_output_that_follows_it() -> None:
    page = "a\n```python\nx = 1\n```\n```python\nprint(x)\n```\nprints\n```text\n1\n```\n```sh\nls\n```\n"
    assert examples(page) == [(2, "x = 1\n", ""), (5, "print(x)\n", "1\n")]
    assert program(page).splitlines()[5] == "print(x)"


LONG = ("docs/derivatives.md", "docs/optimal_control.md")  # some seconds each


@pytest.mark.parametrize("name", [*[name for name in RUN if name not in LONG], *slow(*LONG)])
def test_examples_print_what_is_shown(name: str, tmp_path: Path) -> None:
    """From top to bottom, in one namespace, in an empty folder, and write the pictures that the page shows."""
    for package in NEEDED.get(name, ()):
        pytest.importorskip(package)
    if name in APART:
        run = run_examples(name, tmp_path)
        assert run.returncode == 0, run.stderr
        text = run.stdout
    else:
        (tmp_path / "page.py").write_text(program(PAGES[name]), encoding="utf-8")
        (tmp_path / "empty").mkdir()
        with redirect_stdout(StringIO()) as output, chdir(tmp_path / "empty"):
            run_path(str(tmp_path / "page.py"), run_name="__main__")
        text = output.getvalue()
    printed = text.split(f"{MARK}\n")[:-1]
    shown = [(line, output) for line, _, output in examples(PAGES[name])]
    assert [(line, text) for (line, _), text in zip(shown, printed, strict=True)] == shown
    folder = tmp_path / "empty"
    assert [file for file in pictures(name) if not (folder / file).is_file()] == []
    drawings = {folder / file: ROOT / "docs" / image for file, image in pictures(name).items() if ".svg" in file}
    assert [file.name for file, image in drawings.items() if texts(file) != texts(image)] == []  # else: make pictures


def test_linked_files_exist() -> None:
    targets = [
        (name, target)
        for name, page in PAGES.items()
        for target in re.findall(r"""(?:\]\(|src=")([^)#"\s]+)""", FENCE.sub("", page))
        if "://" not in target
    ]
    assert [(name, file) for name, file in targets if not (ROOT / name).parent.joinpath(file).exists()] == []


def test_named_functions_and_tests_exist_and_shown_commands_are_commands() -> None:
    """`cgraph.jvp`: what is written with its package can be found there."""
    for page in PAGES.values():
        for dotted in re.findall(r"`((?:cgraph|dynamics|viz)(?:\.\w+)+)", page):
            if not dotted.endswith((".py", ".svg")):
                resolve_name(dotted)
        for file, test in re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", page):
            text = (ROOT / file).read_text(encoding="utf-8")
            assert not test or f"def {test}(" in text, f"{file}::{test}"
        for command in commands(page):
            parse(shlex.split(command))


def test_the_reading_edition_of_the_core_is_short_and_names_files_that_exist() -> None:
    page = PAGES["docs/core.md"]
    lines = [line for _, code, _ in examples(page) for line in code.splitlines() if line.strip()]
    library = lines[: lines.index("def torques(lagrangian, q, qd, qdd):")]
    assert len(library) <= 150
    files = re.findall(r"`(cgraph/[\w/]+\.py)`", page)
    assert len(files) > 10
    assert [file for file in files if not (ROOT / file).is_file()] == []


def test_the_command_reference_has_all_that_the_parsers_have() -> None:
    """Every argument of every command is there, with what it is; what a help says in words of its own stays text."""
    parsers = complete()
    page = markdown(parsers)
    assert re.findall(r"^## cgraph (.*)$", page, re.MULTILINE) == list(parsers)
    for section, command in zip(page.split("\n## "), parsers.values(), strict=True):
        listed = re.findall(r"^`(.*)`\n: (.+)$", section, re.MULTILINE)
        arguments = [action for action in command._actions if action.dest != "help"]
        assert len(listed) == len(arguments)
        for (name, said), action in zip(listed, arguments, strict=True):
            assert set(action.option_strings) <= set(re.findall(r"--?[\w-]+", name))
            assert said.rstrip(".") or not action.help


def test_the_reference_has_every_public_name_once() -> None:
    listed = [pair for name, page in PAGES.items() if name != RESULTS for pair in listed_names(page)]
    assert sorted(listed) == sorted((each.__name__, name) for each in (cg, dyn, viz) for name in each.__all__)


def test_a_type_that_is_only_returned_is_on_the_page_of_results_and_no_public_name() -> None:
    public = [getattr(each, name) for each in (cg, extend, dyn, viz) for name in each.__all__]
    assert len(result_types()) > 20
    assert [name for name, result in result_types().items() if result in public] == []


def test_the_tests_of_the_paper_s_equations_are_named() -> None:
    assert len(re.findall(r"`tests/[\w/]+\.py::\w+`", PAGES["docs/paper.md"])) >= 10


def test_the_citation_is_of_this_version_and_of_the_paper() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    (version,) = re.findall(r"^version: (\S+)$", citation, re.MULTILINE)
    (doi,) = re.findall(r"^ +doi: (\S+)$", citation, re.MULTILINE)
    assert version == cg.__version__
    assert f"https://doi.org/{doi}" in PAGES["docs/paper.md"]
