"""Signals: what Ctrl-C and SIGTERM do to a command while the library loads, while it works, and once it has its answer.

A command answers whole or not at all. So the signal is no KeyboardInterrupt here, for which a simulation keeps the rows
that it has: it is the end of the process, and nothing on the way takes it for an answer.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
AGAIN = 0.1  # s of work after which what a signal raised should have arrived
PATIENCE = 1.0  # s in which a signal that comes again is one with the first: cleaning up is not to be cut


class Stopped(SystemExit):
    """The process is asked to end; its code is 128 and the signal's number."""


class _Process:
    """State of the process."""

    loading = False  # nothing is begun, so there is nothing to clean up
    settled = False  # the answer is complete: what comes now comes too late
    number = 0  # of the signal that came
    hook: Callable[[sys.UnraisableHookArgs], object] = sys.unraisablehook  # what is told of others that do
    came = 0.0  # s


def stopped() -> int:
    """The number of the signal that came, 0 for none."""
    return _Process.number


def settled() -> None:
    """The answer is complete and about to be written: from here on no signal cuts it. Raises Stopped if one came."""
    if _Process.number:  # and was taken for an error by who called a library
        raise Stopped(128 + _Process.number)
    _Process.settled = True


def ignore_late() -> None:
    """The answer is out: what comes while Python ends, which sets handlers back, must not change the status."""
    if _Process.settled:
        for number in _watch():
            signal.signal(number, signal.SIG_IGN)


def watch_loading() -> None:
    """Let a signal end the process at once, until a command begins."""
    _Process.loading = True
    _watch()


@contextmanager
def stoppable() -> Iterator[None]:
    """Let a signal raise Stopped; handlers that were there before are so afterwards, but in a process of ours."""
    before = {} if _Process.loading else _watch()
    _Process.loading = _Process.settled = False
    _Process.number = 0
    _Process.hook, sys.unraisablehook = sys.unraisablehook, _unraisable
    try:
        yield
    finally:
        _Process.settled = True
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        sys.unraisablehook = _Process.hook
        for number, handler in before.items():
            signal.signal(number, handler)


def _watch() -> dict[signal.Signals, signal._HANDLER]:
    """Handle the signals that are not ignored, as those of a background job are. The handlers that were there."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    before = {number: signal.getsignal(number) for number in ENDING}
    watched = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
    for number in watched:
        signal.signal(number, _handle)
    if hasattr(signal, "setitimer"):
        watched[signal.SIGVTALRM] = signal.signal(signal.SIGVTALRM, _insist)
    return watched


def _unraisable(lost: sys.UnraisableHookArgs) -> None:
    """Silence Python's line that an exception in a callback or finalizer is ignored: ours is raised again."""
    if not issubclass(lost.exc_type, Stopped):
        _Process.hook(lost)


def _insist(number: int, frame: FrameType | None) -> None:
    """Raise again while the command goes on: what the signal raised may go lost in a callback, or be swallowed."""
    if _Process.number and not (_Process.settled or _cleaning_up()):
        raise Stopped(128 + _Process.number)


def _cleaning_up() -> bool:
    """Whether what the signal raised is on its way: in a `finally`, or where a `with` ends."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, Stopped):
        error = error.__context__
    return error is not None


def _handle(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if _Process.settled or (_Process.number and now - _Process.came < PATIENCE):
        return
    if _Process.loading or _Process.number:
        try:
            os.write(2, f"cgraph: {ENDING[signal.Signals(number)]}\n".encode())
        finally:
            os._exit(128 + number)
    _Process.number, _Process.came = number, now
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_VIRTUAL, AGAIN, AGAIN)
    raise Stopped(128 + number)
