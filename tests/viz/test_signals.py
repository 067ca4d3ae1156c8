"""Ctrl-C and SIGTERM at any instant of a command: its status, no file, no verdict."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from viz.commands import signals

ROOT = Path(__file__).parents[2]
PROGRAM = """
import os, sys
if {bare}:
    sys.modules["llvmlite"] = None
sys.argv = ["cgraph", *{arguments}]
from viz.cli import start, watch_loading
watch_loading()
os.write({ready}, b"!")
sys.exit(start())
"""
VERDICTS = ("meets", "unexplained", "ok  ", "FAIL", "Holds", "nodes")
QUICK = ("inspect chain --out a.html", "report --stability --quick", "paper --quick")
LONG = {  # command: s of it in which the signal comes
    "inspect chain --out a.html": 5.0,
    "report spring_mass --quick": 15.0,
    "report --stability --quick": 12.0,
    "report chain --pruning": 3.0,
    "paper --quick": 15.0,
    "lesson --out a.html": 5.0,
    "draw chain --out a.svg": 3.0,
    "certify chain": 4.0,
    "compare chain --svg a.svg": 4.0,
}


@dataclass
class Cut:
    """A command that gets a signal; as a terminal sends it, to all of its processes, or to itself alone."""

    command: str
    folder: Path
    bare: bool = False

    def __post_init__(self) -> None:
        self.ready, writer = os.pipe()
        text = PROGRAM.format(bare=self.bare, arguments=self.command.split(), ready=writer)
        environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "start_new_session": True}
        self.folder.mkdir()
        command = [sys.executable, "-c", text]
        self.process = subprocess.Popen(command, cwd=self.folder, env=environment, pass_fds=[writer], **pipes)
        os.close(writer)

    def end(self, after: float, number: int = signal.SIGINT, *, all_of_them: bool = True) -> bool:
        """Send the signal some seconds after Python has started; False if the command had come to its end before."""
        assert os.read(self.ready, 1) == b"!"
        os.close(self.ready)
        try:
            self.process.wait(after)
        except subprocess.TimeoutExpired:
            (os.killpg if all_of_them else os.kill)(self.process.pid, number)
        began = time.monotonic()
        self.out, self.err = self.process.communicate()
        self.seconds = time.monotonic() - began
        return self.process.returncode not in (0, 1)

    def check(self, number: int = signal.SIGINT) -> None:
        """The command has its status, has written nothing and judged nothing."""
        told = f"{self.command}, {'bare' if self.bare else 'all'}: {self.process.returncode} {self.err[-2000:]}"
        assert self.process.returncode == 128 + number, told
        assert self.err.splitlines()[-1] == f"cgraph: {signals.ENDING[signal.Signals(number)]}", told
        assert "Traceback" not in self.err, told
        assert not list(self.folder.rglob("*")), told
        if "did not come to its end" not in self.err:
            assert not any(verdict in self.out for verdict in VERDICTS), self.out


@pytest.mark.usefixtures("ctrl_c")
def test_an_interrupted_command_writes_nothing_and_judges_nothing(tmp_path: Path) -> None:
    """Four long commands side by side, with and without llvmlite, while they load and while they work."""
    rng = random.Random(0)
    cuts = [Cut(command, tmp_path / f"{i}", bare=i % 2 == 0) for i, command in enumerate(QUICK)]
    for i, cut in enumerate(cuts):  # one after the other, so the last has worked longest
        assert cut.end(rng.uniform(0.0, 0.8), all_of_them=i % 2 == 0)
        cut.check()


@pytest.mark.usefixtures("ctrl_c")
def test_sigterm_ends_a_command_alike(tmp_path: Path) -> None:
    cut = Cut("report --stability --quick", tmp_path / "a")
    assert cut.end(0.5, signal.SIGTERM)
    cut.check(signal.SIGTERM)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("bare", [False, True], ids=["all", "bare"])
@pytest.mark.parametrize("command", LONG)
def test_ten_random_instants_of_each_long_command(
    command: str, bare: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    rng = random.Random(f"{command} {bare}")
    seconds: list[float] = []
    span = LONG[command]
    for folder in map(str, range(100)):
        after = rng.uniform(0.0, span)
        cut = Cut(command, tmp_path / folder, bare)
        if cut.end(after, all_of_them=rng.random() < 0.5):
            cut.check()
            seconds.append(cut.seconds)
        else:  # it takes less on this machine
            span = after
        if len(seconds) == 10:
            break
    record_property("s until the command had ended, at most", round(max(seconds), 2))
    assert len(seconds) == 10


# --- the handler


def send(number: int = signal.SIGINT) -> None:
    signal.raise_signal(number)


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_raises_what_no_simulation_keeps_rows_for() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    for number in signals.ENDING:
        with pytest.raises(signals.Stopped) as stop, signals.stoppable():
            send(number)
        assert stop.value.code == 128 + number
        assert not isinstance(stop.value, (Exception, KeyboardInterrupt))
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


@pytest.mark.usefixtures("ctrl_c")
def test_a_second_signal_does_not_cut_the_cleaning_up() -> None:
    cleaned = []

    def work() -> None:
        try:
            send()
        finally:
            send()
            cleaned.append(True)

    with pytest.raises(signals.Stopped), signals.stoppable():
        work()
    assert cleaned


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_that_was_swallowed_still_ends_the_command_before_its_answer() -> None:
    with signals.stoppable():
        with suppress(BaseException):  # as what is raised in a callback is
            send()
        assert signals.stopped() == signal.SIGINT
        with pytest.raises(signals.Stopped):
            signals.settled()


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("number", signals.ENDING)
def test_a_signal_that_comes_in_a_callback_is_raised_after_it(number: int, capsys: pytest.CaptureFixture[str]) -> None:
    """From a finalizer nothing can be raised: Python prints it and goes on."""

    class Finalized:
        def __del__(self) -> None:
            send(number)

    def work() -> None:
        Finalized()
        for _ in range(10**8):
            pass

    with pytest.raises(signals.Stopped) as stop, signals.stoppable():
        work()
    assert stop.value.code == 128 + number
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_that_a_library_takes_for_an_error_is_raised_again_but_not_into_the_cleaning_up() -> None:
    done = []

    def work() -> None:
        try:
            with suppress(BaseException):
                send()
            for _ in range(10**8):
                pass
        finally:
            for _ in range(10**7):  # longer than it takes to be sent again
                pass
            done.append(True)

    with pytest.raises(signals.Stopped), signals.stoppable():
        work()
    assert done


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_that_comes_after_the_answer_comes_too_late() -> None:
    with signals.stoppable():
        signals.settled()
        send()
        send(signal.SIGTERM)
    assert signals.stopped() == 0


def test_a_signal_while_python_ends_does_not_change_the_status() -> None:
    program = (
        "import atexit, signal, sys\n"
        "class Last:\n"
        "    def __del__(self): signal.raise_signal(signal.SIGINT); signal.raise_signal(signal.SIGTERM)\n"
        "sys.modules['last'] = last = Last()\n"
        "from viz import cli\n"
        "cli.main = lambda: cli.settled() or 1\n"
        "atexit.register(signal.raise_signal, signal.SIGINT)\n"
        "sys.exit(cli.start())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (1, b"")


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_that_is_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with signals.stoppable():
        send()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


@pytest.mark.usefixtures("ctrl_c")
def test_a_second_signal_after_a_while_ends_a_process_that_hangs() -> None:
    program = (
        "import signal, time\nfrom viz.commands import signals\nsignals.PATIENCE = 0.0\nsignals.watch_loading()\n"
        "with signals.stoppable():\n"
        "    try: signal.raise_signal(signal.SIGINT)\n"
        "    finally: time.sleep(0.01); signal.raise_signal(signal.SIGINT); print('still there')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"cgraph: interrupted\n")
