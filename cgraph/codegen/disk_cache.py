"""Machine code kept on disk: what was compiled once on a machine is read there instead of compiled again."""

from __future__ import annotations

import os
import stat
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import numpy as np

from ..util.require import require_path

FORMAT = "cgraph machine code, 1"  # part of every name: entries of another format are other entries
SUFFIX, UNFINISHED = ".code", ".unfinished"
LARGEST_ENTRY = 2**28  # bytes of an entry; the machine code of a million nodes takes a tenth


def cached_code(folder: Path, recipe: str, make: Callable[[], bytes]) -> bytes:
    """The bytes kept in a folder for a recipe, the text of all that they depend on; else `make()`, kept from now on.

    The folder is made at the first entry, for its owner alone; an entry is the checksum of what follows, and what
    follows. Any number of threads and processes may use it at once: an entry appears whole or not at all. One that is
    damaged, or that another user could have written, is made anew.
    Warns (RuntimeWarning) when they cannot be kept: the result is right, but the time that was to be saved is not.
    """
    name = sha256(f"{FORMAT}\n{recipe}".encode()).hexdigest()
    path = folder / f"{name}{SUFFIX}"
    content = _read(path)
    if content is None:
        content = make()
        try:
            _write(path, content)
        except OSError as error:
            if _read(path) is None:  # Windows replaces no file that another process has just written and reads
                _warn(f" in {folder}: {error.strerror or error}")
    return content


def cache_choice(cache: object) -> bool | str:
    """True, False or the path of a folder, which holds in another folder and another process. Raises TypeError."""
    if isinstance(cache, (bool, np.bool_)):
        return bool(cache)
    if isinstance(cache, (str, os.PathLike)) and os.fspath(cache):
        return str(Path(cache).expanduser().absolute())
    raise TypeError(f"cache must be True, False or the path of a folder, got {cache!r:.60}")


def cache_folder(choice: bool | str) -> Path | None:
    """The folder of a cache; True: in the platform's folder for caches; False: none."""
    if choice is False:
        return None
    try:
        return default_folder() if choice is True else Path(choice)
    except RuntimeError as error:  # this user has no home
        _warn(f": {error}")
        return None


def clear_cache(folder: str | os.PathLike[str] | None = None) -> int:
    """Remove the machine code that `compile(..., cache=True)` has kept, or `cache=folder`; give the number of entries.

    Nothing else in the folder is touched.

    Parameters
    ----------
    folder : path or None
        The folder that was given to `compile`; None: the platform's for caches.

    Returns
    -------
    int
        The number of entries removed.

    Raises
    ------
    OSError
        For an entry that cannot be removed.

    Examples
    --------
    >>> import cgraph as cg
    >>> cg.clear_cache("a folder without code")
    0
    """
    place = default_folder() if folder is None else require_path("folder", folder)
    name = "[0-9a-f]" * 64
    entries = list(place.glob(f"{name}{SUFFIX}"))
    unfinished = place.glob(f"{name}.*{UNFINISHED}")  # left by a process that was killed
    for path in (*entries, *unfinished):
        path.unlink(missing_ok=True)
    return len(entries)


def default_folder() -> Path:
    """Folder `cgraph` in the platform's for caches: $XDG_CACHE_HOME, or ~/.cache, ~/Library/Caches, %LOCALAPPDATA%.

    Raises RuntimeError for a user without a home.
    """
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "cgraph"
    chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if chosen.is_absolute():  # the XDG specification: any other is to be ignored
        return chosen / "cgraph"
    return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "cgraph"


def _read(path: Path) -> bytes | None:
    """Content of an entry; None if there is none to trust: whoever writes an entry decides what this process runs."""
    try:
        # Without waiting for somebody who writes where the name is a pipe's.
        at_once = getattr(os, "O_NONBLOCK", 0)
        with open(path, "rb", opener=lambda name, flags: os.open(name, flags | at_once)) as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_ENTRY or not _ours(status):
                return None
            checksum, content = file.read(32), file.read()
    except OSError:
        return None
    return content if checksum == _checksum(path, content) else None


def _write(path: Path, content: bytes) -> None:
    if len(content) > LARGEST_ENTRY:
        raise OSError(f"{len(content)} bytes are more than the {LARGEST_ENTRY} of an entry")
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    unfinished = path.with_suffix(f".{os.urandom(8).hex()}{UNFINISHED}")
    try:
        with open(unfinished, "xb", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
            file.write(_checksum(path, content) + content)
        unfinished.replace(path)
    except BaseException:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise


def _checksum(path: Path, content: bytes) -> bytes:
    """Checksum of an entry's name and content: one that was renamed is another's."""
    return sha256(path.stem.encode() + content).digest()


def _ours(status: os.stat_result) -> bool:
    """Whether nobody but this user and the administrator could have written the file."""
    if sys.platform == "win32":  # there, the folder of a user's caches is closed to others
        return True
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & 0o022


def _warn(why: str) -> None:
    warnings.warn(f"machine code is not kept{why}", RuntimeWarning, stacklevel=3)
