"""The command line `cgraph`: one command, its exit status, and a line for an error."""

import io
import os
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from .commands.command import parse, say

SUCCESS, FINDING, ERROR, INTERRUPTED, UNREAD = 0, 1, 2, 130, 141  # exit statuses, as docs/commands.md has them
ERRORS = (ValueError, TypeError, OSError, ImportError, RuntimeError, MemoryError, ArithmeticError)


def start() -> int:
    """The process's command: `main`, which Ctrl-C ends, and warnings in a line.

    A letter that standard output cannot encode is written as its number, as Python does on standard error.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # it is ignored in a background job
        signal.signal(signal.SIGINT, _interrupt)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = main()
    except Exception:  # noqa: BLE001 (a mistake of ours must not look like a finding, which status 1 is)
        sys.excepthook(*sys.exc_info())
        return ERROR
    if status == INTERRUPTED:  # threads may still be in machine code, which the end of Python may not survive
        os._exit(status)
    return status


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status.

    0 fine, 1 a finding, 2 an error (one line on standard error), 130 interrupted by Ctrl-C, 141 where nobody reads
    standard output any more. Raises SystemExit with status 2, after the usage, for wrong arguments.
    """
    try:
        options = parse(arguments)
        with _shown_warnings():
            status: int | None = options.run(options)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status or SUCCESS
    except (KeyboardInterrupt, SystemExit) as error:
        if isinstance(error, SystemExit) and error.code != INTERRUPTED:
            raise
        say("interrupted")
        return INTERRUPTED
    except ERRORS as error:
        _discard_output()
        if isinstance(error, BrokenPipeError):  # the reader, such as `head`, has had enough
            return UNREAD
        say(f"error: {' '.join(_sentence(error).split())}")
        return ERROR


def _interrupt(*_: object) -> None:
    """End the command by Ctrl-C: a KeyboardInterrupt ends a simulation alone, which keeps the rows that it has."""
    raise SystemExit(INTERRUPTED)


@contextmanager
def _shown_warnings() -> Iterator[None]:
    """Show a warning as a line of standard error, once, without the line of our code that gave it."""
    with warnings.catch_warnings():
        shown: set[str] = set()

        def show(message: Warning | str, *_: object, **__: object) -> None:
            if str(message) not in shown:
                shown.add(str(message))
                say(f"warning: {message}")

        warnings.showwarning = show
        yield


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
