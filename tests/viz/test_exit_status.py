"""Exit statuses: every row of the table in docs/commands.md, run."""

import errno
import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from viz import cli
from viz.commands.command import COMMANDS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in PAGE.splitlines() if line[:1] == "|"]
MEANS = {int(row[0]): row[1] for row in ROWS if row[0].isdigit()}
EXAMPLES = {row[0].strip("`"): dict(enumerate(row[2:])) for row in ROWS if len(row) == 5 and row[0].startswith("`")}
LONG = ("paper", "lesson")  # seconds, and run by tests of their own
RUN = [
    (command, status)
    for name, row in EXAMPLES.items()
    for status, example in row.items()
    if (command := example.strip("`")) and not (name in LONG and status == 0)
]


def test_the_table_has_every_status_and_every_command() -> None:
    assert list(MEANS) == [cli.SUCCESS, cli.FINDING, cli.ERROR, cli.INTERRUPTED, cli.UNREAD]
    assert list(EXAMPLES) == list(COMMANDS)
    assert all(row[0] and row[2] for row in EXAMPLES.values())
    findings = {row[0].strip("`") for row in ROWS if len(row) == 5 and row[1]} - {"command"}
    assert {name for name, row in EXAMPLES.items() if row[1]} <= findings


def ended(command: str) -> object:
    """The status of a command that a person types."""
    try:
        return cli.main(shlex.split(command))
    except SystemExit as usage:
        return usage.code


@pytest.mark.parametrize(("command", "status"), RUN)
def test_an_example_ends_with_its_status(
    command: str, status: int, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ended(command) == status
    printed = capsys.readouterr()
    assert bool(printed.out) == (status != cli.ERROR)
    assert status != cli.ERROR or "error: " in printed.err.splitlines()[-1]
    assert status != cli.ERROR or not [*here.iterdir()]


@pytest.mark.parametrize("arguments", ["equations spring_mass", "why chain tau0 q9 --k 2000"], ids=["short", "long"])
def test_a_reader_who_leaves_ends_the_command_without_a_word(
    arguments: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of what is printed all is in a buffer until the end, or some is written before."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        assert cli.main(arguments.split()) == 141
    assert capsys.readouterr().err == ""


def raised(error: BaseException) -> Callable[[object], None]:
    """A command that fails."""

    def command(_: object) -> None:
        raise error

    return command


def warned(_: object) -> None:
    for _ in range(3):
        warnings.warn("this is odd", stacklevel=1)


ENDS = {  # of a command, its status and its last line
    "an error of the system": (raised(FileNotFoundError(errno.ENOENT, "No such file", "/nowhere")), cli.ERROR,
                               "cgraph: error: /nowhere: No such file"),
    "Ctrl-C": (raised(KeyboardInterrupt()), 130, "cgraph: interrupted"),
    "a mistake of ours": (raised(KeyError("ours")), cli.ERROR, "KeyError: 'ours'"),
    "a warning, given three times": (warned, cli.SUCCESS, "cgraph: warning: this is odd"),
}  # fmt: skip


@pytest.mark.parametrize("what", ENDS)
def test_a_command_that_fails_ends_with_a_status_and_a_line(
    what: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    command, status, line = ENDS[what]
    monkeypatch.setattr("viz.commands.scenes.run", command)
    monkeypatch.setattr(sys, "argv", ["cgraph", "scenes"])
    with warnings.catch_warnings(action="always"):
        assert (cli.main() if status == cli.INTERRUPTED else cli.start()) == status
    lines = capfd.readouterr().err.splitlines()
    assert lines[-1] == line
    assert len(lines) == 1 or "Traceback" in lines[0]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_an_error_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with Path("/dev/full").open("w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        assert cli.main(["equations", "spring_mass"]) == cli.ERROR
    assert capsys.readouterr().err == "cgraph: error: No space left on device\n"


def test_a_closed_output_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert cli.main(["equations", "spring_mass"]) == cli.SUCCESS
