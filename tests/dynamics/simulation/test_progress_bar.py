"""Progress: when a line is written to standard error, and what it says."""

import sys
from typing import Any

import pytest
from pytest import mark, raises

import dynamics as dyn
from dynamics.simulation.progress_bar import Progress
from tests.dynamics.models import oscillator


class Clock:
    """Stands in for the time module: each look at it takes `tick` seconds."""

    def __init__(self, tick: float) -> None:
        self.now, self.tick = 0.0, tick

    def perf_counter(self) -> float:
        self.now += self.tick
        return self.now


def printed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tick: float, **options: Any) -> str:
    """What a run of ten rows, in blocks of one, writes to standard error, on a clock of that tick."""
    monkeypatch.setattr("dynamics.simulation.progress_bar.time", Clock(tick))
    monkeypatch.setattr("dynamics.simulation.steps.stepping.FIRST_PASSES", 1)
    monkeypatch.setattr("dynamics.simulation.steps.stepping.BLOCK_TIME", 0.0)
    dyn.simulate(oscillator(), [1.0], [0.0], 1.0, "rk4", dt=0.1, **{"estimate_error": False, **options})
    out, err = capsys.readouterr()
    assert out == ""
    return err


def test_a_long_run_writes_a_progress_line_on_request(capsys, monkeypatch) -> None:
    err = printed(capsys, monkeypatch, tick=0.5, progress=True)
    lines = err.rstrip("\n").split("\r")
    assert err.endswith("\n")
    assert err.count("\n") == 1
    assert lines[-1] == "simulate [########################] 100%  5 s"
    assert any("50%" in line and "[############            ]" in line for line in lines)


def test_a_short_run_writes_nothing(capsys, monkeypatch) -> None:
    assert printed(capsys, monkeypatch, tick=0.05, progress=True) == ""


def test_progress_is_written_at_most_ten_times_a_second(capsys, monkeypatch) -> None:
    monkeypatch.setattr("dynamics.simulation.progress_bar.time", Clock(0.03))
    with Progress("count", total=1000.0, show=True) as progress:
        for i in range(1000):
            progress(i)
    lines = capsys.readouterr().err.count("\r")
    assert 0.5 * 10 * 29 < lines <= 10 * 29 + 1  # a thousand looks of 0.03 s, less the first second


def test_nothing_is_written_when_not_asked_for(capsys, monkeypatch) -> None:
    assert printed(capsys, monkeypatch, tick=1.0, progress=False) == ""


@mark.parametrize("terminal", [False, True])
def test_by_default_progress_is_for_terminals(terminal: bool, capsys, monkeypatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    assert bool(printed(capsys, monkeypatch, tick=1.0)) == terminal


def test_an_interrupted_run_ends_its_progress_line(capsys, monkeypatch) -> None:
    def interrupted() -> None:
        with Progress("simulate", 1.0, show=True) as progress:
            progress(0.5)
            raise KeyboardInterrupt

    monkeypatch.setattr("dynamics.simulation.progress_bar.time", Clock(2.0))
    with raises(KeyboardInterrupt):
        interrupted()
    assert capsys.readouterr().err.endswith(" 50%  2 s\n")
