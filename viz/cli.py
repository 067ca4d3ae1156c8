"""The command line `cgraph`: the signals first, then the imports, which take a while, then one command."""

from __future__ import annotations

import io
import os
import select
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from .commands.signals import ENDING, ignore_late, settled, stoppable, stopped, watch_loading

SUCCESS, FINDING, ERROR = 0, 1, 2  # exit statuses, as docs/commands.md has them
ERRORS = (ValueError, TypeError, OSError, ImportError, RuntimeError, MemoryError, ArithmeticError)


def start() -> int:
    """The process's command: `main` with the signals of the first second, and warnings in a line.

    A letter that standard output cannot encode is written as its number, as Python does on standard error.
    """
    watch_loading()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = main()
        if stopped() and status == 128 + stopped():  # all is cleaned up, but threads may still be in machine code,
            os._exit(status)  # which the end of Python does not wait for, and may not survive
        return status
    except Exception:  # noqa: BLE001 (a mistake of ours must not look like a finding, which status 1 is)
        sys.excepthook(*sys.exc_info())
        return ERROR
    finally:
        ignore_late()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status.

    0 fine, 1 a finding, 2 an error (one line on standard error), 128 and the number of a signal that ended it:
    130 Ctrl-C, 143 SIGTERM, 141 where nobody reads standard output any more.
    Raises SystemExit with status 2, after the usage, for wrong arguments.
    """
    with stoppable():
        try:
            return _command(arguments)
        except BaseException as error:
            if stopped() or isinstance(error, KeyboardInterrupt):  # whatever became of the exception on its way
                number = stopped() or signal.SIGINT
                _say(ENDING[signal.Signals(number)])
                return 128 + number
            if isinstance(error, BrokenPipeError) and _nobody_reads():  # the reader, such as `head`, has had enough
                _discard_output()
                return 128 + getattr(signal, "SIGPIPE", 13)
            if isinstance(error, ERRORS):
                _discard_output()
                _say(f"error: {' '.join(_sentence(error).split())}")
                return ERROR
            raise


def _command(arguments: Sequence[str] | None) -> int:
    from .commands.command import parse  # here, where a signal is awaited: with all else it takes a second

    options = parse(arguments)
    with _shown_warnings():
        status: int | None = options.run(options)
    settled()
    if sys.stdout is not None:
        sys.stdout.flush()
    return status or SUCCESS


@contextmanager
def _shown_warnings() -> Iterator[None]:
    """Show a warning as a line of standard error, once, without the line of our code that gave it."""
    with warnings.catch_warnings():
        shown: set[str] = set()

        def show(message: Warning | str, *_: object, **__: object) -> None:
            if str(message) not in shown:
                shown.add(str(message))
                _say(f"warning: {message}")

        warnings.showwarning = show
        yield


def _say(line: str) -> None:
    if sys.stderr is not None:
        print(f"cgraph: {line}", file=sys.stderr, flush=True)


def _nobody_reads() -> bool:
    """Whether the pipe that broke is standard output."""
    if not hasattr(select, "poll"):
        return True
    output = select.poll()
    output.register(sys.stdout, 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in output.poll(0))


def _discard_output() -> None:
    """Send standard output nowhere if it takes nothing any more: Python would say so once more at its end."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: BaseException) -> str:
    """Text of an error, without the number that the system has for it."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror if error.filename is None else f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__
