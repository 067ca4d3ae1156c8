"""Worker: a process of its own for one peer on one scene, which prepares tasks and runs them when told.

A peer that takes too long or falls over is ended with its process; the others go on.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from cgraph._shared import Array
from dynamics.multibody.trees.mechanism import MechanismWarning
from dynamics.scenes import Scene
from dynamics.verification.residual import UnavailableError
from tests.bench.peers import PEERS, PeerModel
from tests.bench.peers.peer import EVALUATIONS
from tests.bench.timing import repetitions, single_core, timed

Load = Callable[[], Scene]  # makes the model anew in the worker; lambdas do not travel
GRACE = 1.0  # s for a process that has left its pipe to end


@dataclass(frozen=True)
class Prepared:
    """A timed task that is ready.  seconds: from the model to its first result.  values: that result."""

    seconds: float
    values: Array
    size: int | None


@dataclass(frozen=True)
class Refused:
    """Reason why a task is not ready."""

    reason: str


class Worker:
    """One peer on one scene, in a process of its own."""

    def __init__(self, load: Load, peer: str) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, load, peer), daemon=True)
        with single_core():
            self._process.start()
        theirs.close()

    def prepare(self, task: str, mode: str, budget: float) -> Prepared | Refused:
        if (told := self._tell(task, mode)) is not None:
            return told
        if not self._pipe.poll(budget):
            self.end()
            return Refused(f"not ready within {budget:g} s")
        answer: Prepared | Refused = self._answer()
        return answer

    def turn(self, task: str, mode: str) -> float:
        """Seconds for an evaluation, over as many runs as make a measurable time. Raises RuntimeError when it dies."""
        answer = self._tell(task, mode) or self._answer()
        if isinstance(answer, Refused):
            raise RuntimeError(answer.reason)
        return float(answer)

    def _tell(self, task: str, mode: str) -> Refused | None:
        """Send what is asked for; a refusal when nobody is there to read it."""
        try:
            self._pipe.send((task, mode))
        except OSError:  # the pipe broke, or `end` has closed it
            return self._ended()
        return None

    def _answer(self) -> Any:
        try:
            return self._pipe.recv()
        except (EOFError, OSError):
            return self._ended()

    def _ended(self) -> Refused:
        self._process.join(GRACE)
        self._process.kill()  # it answers no more, and may have hung in ending
        self._process.join()
        return Refused(f"its process ended with status {self._process.exitcode}")

    @property
    def alive(self) -> bool:
        """Whether the process can still be asked."""
        return self._process.is_alive()

    def end(self) -> None:
        """End the process, and a compiler that it may have started."""
        if self._process.is_alive() and self._process.pid:
            with suppress(ProcessLookupError, AttributeError):  # AttributeError: no process groups on this platform
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.kill()
        self._process.join()
        self._pipe.close()


def _serve(pipe: Connection, load: Load, name: str) -> None:
    """The process's side: (task, mode) is prepared when it is new, and timed when it is not."""
    with suppress(AttributeError, OSError):
        os.setsid()  # so that a compiler ends with it
    warnings.simplefilter("ignore", MechanismWarning)  # the first process has said what is left out
    with suppress(EOFError, BrokenPipeError):
        kind = PEERS[name]
        with suppress(Exception):  # loading a package is no part of making a task; what is wrong shows again there
            kind.load()
            import_module(kind.package)
        tasks: dict[tuple[str, str], tuple[Callable[[], object], int]] = {}
        case, peer = PeerModel(name, load()), None
        while True:
            asked = pipe.recv()
            if asked in tasks:
                pipe.send(timed(*tasks[asked]) / EVALUATIONS[asked[1]])
                continue
            start = time.perf_counter()
            try:
                peer = peer or kind.make(case)
                task = peer.prepare(*asked)
                result = task.run()
                seconds = time.perf_counter() - start
                tasks[asked] = task.run, repetitions(task.run)
                pipe.send(Prepared(seconds, task.result(result), task.size))
            except UnavailableError as error:
                pipe.send(Refused(str(error)))
            except Exception as error:  # noqa: BLE001 (whatever a peer's own code raises is a line in the report)
                pipe.send(Refused(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"))
