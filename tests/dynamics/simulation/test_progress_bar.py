"""Progress: when a line is written to standard error, and what it says."""

import sys
from unittest.mock import patch

import pytest
from pytest import mark, raises

from dynamics.simulation.outcome import Progress


class Clock:
    """Each look at it takes `tick` seconds."""

    def __init__(self, tick: float) -> None:
        self.now, self.tick = 0.0, tick

    def __call__(self) -> float:
        self.now += self.tick
        return self.now


def printed(capsys: pytest.CaptureFixture[str], tick: float, count: int = 10, show: bool | None = True) -> str:
    """What so many looks write to standard error, on a clock of that tick."""
    with Progress("simulate", total=float(count), show=show, clock=Clock(tick)) as progress:
        for i in range(1, count + 1):
            progress(float(i))
    out, err = capsys.readouterr()
    assert out == ""
    return err


def test_a_long_run_writes_a_progress_line(capsys) -> None:
    err = printed(capsys, tick=0.5)
    lines = err.rstrip("\n").split("\r")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    assert lines[-1] == "simulate [########################] 100%  5 s"
    assert any("50%" in line and "[############            ]" in line for line in lines)


def test_a_short_run_and_one_that_is_not_asked_write_nothing(capsys) -> None:
    assert printed(capsys, tick=0.05) == printed(capsys, tick=1.0, show=False) == ""


def test_progress_is_written_at_most_ten_times_a_second(capsys) -> None:
    lines = printed(capsys, tick=0.03, count=1000).count("\r")
    assert 0.5 * 10 * 29 < lines <= 10 * 29 + 1  # a thousand looks of 0.03 s, less the first second


@mark.parametrize("terminal", [False, True])
def test_by_default_progress_is_for_terminals(terminal: bool, capsys) -> None:
    with patch.object(sys.stderr, "isatty", lambda: terminal):
        assert bool(printed(capsys, tick=1.0, show=None)) == terminal


def test_an_interrupted_run_ends_its_progress_line(capsys) -> None:
    def interrupted() -> None:
        with Progress("simulate", 1.0, show=True, clock=Clock(2.0)) as progress:
            progress(0.5)
            raise KeyboardInterrupt

    with raises(KeyboardInterrupt):
        interrupted()
    assert capsys.readouterr().err.endswith(" 50%  2 s\n")
