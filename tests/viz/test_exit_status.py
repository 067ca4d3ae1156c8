"""Exit statuses: every row of the table in docs/commands.md, run."""

from __future__ import annotations

import errno
import os
import re
import shlex
import sys
import tempfile
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
    assert list(MEANS) == [cli.SUCCESS, cli.FINDING, cli.ERROR, 130, 141, 143]
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
    command: str, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert ended(command) == status
    printed = capsys.readouterr()
    assert bool(printed.out) == (status != cli.ERROR)
    assert status != cli.ERROR or "error: " in printed.err.splitlines()[-1]
    assert status != cli.ERROR or not [*tmp_path.iterdir()]


@pytest.mark.parametrize("arguments", ["completion bash", "why chain tau0 q9 --k 2000"], ids=["short", "long"])
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


def test_a_pipe_that_breaks_elsewhere_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(_: object) -> None:
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))

    monkeypatch.setattr("viz.commands.scenes.run", broken)
    with tempfile.TemporaryFile("w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        assert cli.main(["scenes"]) == cli.ERROR


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_an_error_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with Path("/dev/full").open("w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        assert cli.main(["completion", "bash"]) == cli.ERROR
    assert capsys.readouterr().err == "cgraph: error: No space left on device\n"


def test_a_closed_output_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", None)
    assert cli.main(["completion", "bash"]) == cli.SUCCESS


def test_a_mistake_of_ours_is_no_finding(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def mistake(_: object) -> None:
        raise KeyError("ours")

    monkeypatch.setattr("viz.commands.scenes.run", mistake)
    for of_a_process in ("watch_loading", "ignore_late"):
        monkeypatch.setattr(cli, of_a_process, lambda: None)
    monkeypatch.setattr(sys, "argv", ["cgraph", "scenes"])
    assert cli.start() == cli.ERROR
    assert "KeyError: 'ours'" in capsys.readouterr().err
