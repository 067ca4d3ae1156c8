"""A worker of the bench whose process ends at any instant: a sentence, never an error of a pipe, never a wait."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import pytest

from tests.bench.speed.worker import Refused, Worker, _interrupts_held

ECHO = "import os, sys; fd = int(sys.argv[1])\nwhile part := os.read(fd, 65536): os.write(fd, part)"


class Echo:
    """A process that sends back what it gets, for one that has to load the library; used as multiprocessing's are."""

    def __init__(self) -> None:
        self.pipe, theirs = Pipe()
        number = theirs.fileno()
        self.process = subprocess.Popen([sys.executable, "-S", "-E", "-c", ECHO, str(number)], pass_fds=[number])
        theirs.close()
        self.pid, self.kill = self.process.pid, self.process.kill

    def join(self, timeout: float | None = None) -> None:
        try:
            self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            assert timeout is not None

    def is_alive(self) -> bool:
        return self.process.poll() is None

    @property
    def exitcode(self) -> int | None:
        return self.process.poll()


def worker(process: Echo, pipe: Connection) -> Worker:
    made = Worker.__new__(Worker)
    made._process, made._pipe = process, pipe
    return made


def ask_on(asked: Worker) -> None:
    while True:
        asked.turn("inverse", "call")


def test_a_process_that_is_killed_at_any_instant_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pipe breaks at the question, at the answer, or between the two."""
    monkeypatch.setattr("tests.bench.speed.worker.float", lambda answer: 1.0, raising=False)
    rng = random.Random(0)
    for _ in range(10):
        process = Echo()
        asked = worker(process, process.pipe)
        assert asked.turn("inverse", "call") == 1.0
        killer = threading.Timer(rng.uniform(0.0, 0.01), process.kill)
        killer.start()
        with pytest.raises(RuntimeError, match=r"^its process ended with status -9$"):
            ask_on(asked)
        answer = asked.prepare("inverse", "call", 1.0)
        assert answer == Refused("its process ended with status -9")
        asked.end()
        killer.join()


def test_a_process_that_leaves_its_pipe_and_hangs_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.bench.speed.worker.GRACE", 0.05)
    process = Echo()
    ours, theirs = Pipe()
    theirs.close()
    began = time.monotonic()
    with pytest.raises(RuntimeError, match="its process ended with status -9"):
        worker(process, ours).turn("inverse", "call")
    assert time.monotonic() - began < 10.0
    process.pipe.close()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="this system has no masks of signals")
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_is_for_who_started_the_process_alone() -> None:
    program = "import signal, sys; sys.exit(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    with _interrupts_held():
        held = subprocess.run([sys.executable, "-S", "-c", program], check=False).returncode
    assert held == 1
    began = []

    def interrupted() -> None:
        with _interrupts_held():
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # the process's other threads hold none
            began.append(True)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert began
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
