"""Writing a file so that a reader sees either the old one or the whole new one."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path


def atomic_write(path: str | Path, data: str | bytes) -> Path:
    """Write a file whole or not at all, by a temporary file beside it; its path. Text is UTF-8, links are followed.

    Raises OSError with the path in its message; nothing is left behind.
    """
    write_files({Path(path): data})
    return Path(path)


def write_files(files: Mapping[Path, str | bytes]) -> None:
    """Write several files, all or none: they take their places once all are written beside them. As `atomic_write`.

    A device or a pipe, such as /dev/null or /dev/stdout, is written to where it is, after the files.
    """
    with ExitStack() as temporaries:
        written, others = [], []
        for path, data in files.items():
            if _is_device(path):
                others.append((path, data))
                continue
            target = path.resolve()  # through a link, so that the link stays one
            temporary = temporaries.enter_context(_beside(target))
            with _named(target):
                temporary.write_bytes(data.encode() if isinstance(data, str) else data)
            written.append((temporary, target))
        for temporary, target in written:
            with _named(target):
                temporary.replace(target)
        for path, data in others:
            with _named(path):
                path.write_bytes(data.encode() if isinstance(data, str) else data)


def check_writable(path: str | Path) -> None:
    """Find out whether a file could be written, before the work of making what goes there. Leaves nothing behind.

    Raises OSError as `atomic_write` would for the place alone.
    """
    if _is_device(Path(path)):
        if not os.access(path, os.W_OK):  # opening a pipe would wait for its reader
            raise PermissionError(errno.EACCES, f"cannot write {path}: {os.strerror(errno.EACCES)}")
        return
    with _beside(Path(path).resolve()):
        pass


def _is_device(path: Path) -> bool:
    """Whether there is something that is neither a file nor a folder: a device, a pipe, a socket."""
    try:
        kind = path.stat().st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(kind) or stat.S_ISDIR(kind))


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """A new empty file beside a file that is to be written; what is left of it goes in the end."""
    with _named(target):
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "that is a folder")
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        with _named(target):
            temporary.touch(exist_ok=False)
        yield temporary
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


@contextmanager
def _named(target: Path) -> Iterator[None]:
    """Errors of the system within name the file that was to be written, and why it cannot be."""
    try:
        yield
    except OSError as error:
        if not target.parent.is_dir():
            why = f"the folder {target.parent} does not exist"
        else:
            why = error.strerror or str(error)
        raise OSError(error.errno, f"cannot write {target}: {why}") from error
