"""Writing a file so that a reader sees either the old one or the whole new one."""

from __future__ import annotations

import secrets
from pathlib import Path


def atomic_write(path: str | Path, data: str | bytes, *, mode: int = 0o666) -> Path:
    """Write a file whole or not at all, by way of a temporary file beside it.

    Parameters
    ----------
    path : str or Path
        Where to; a link is followed, and stays a link.
    data : str or bytes
        What to write; text as UTF-8.
    mode : int
        Permissions of the file, less the process's umask: 0o600 keeps it from others.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    OSError
        With the path in its message, if the folder is missing or must not be written to. What was at the path stays,
        and nothing else is left behind.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from cgraph.extend import atomic_write
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     atomic_write(Path(folder, "notes.txt"), "done").read_text()
    'done'
    """
    target = Path(path).resolve()  # through a link, so that the link stays one
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        try:
            temporary.touch(mode, exist_ok=False)
            temporary.write_bytes(data.encode() if isinstance(data, str) else data)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        if not target.parent.is_dir():
            why = f"the folder {target.parent} does not exist"
        elif target.is_dir():
            why = "that is a folder"
        else:
            why = error.strerror or str(error)
        raise OSError(error.errno, f"cannot write {target}: {why}") from error
    return Path(path)
