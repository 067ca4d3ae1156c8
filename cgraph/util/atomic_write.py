"""Writing a file so that a reader sees either the old one or the whole new one."""

from __future__ import annotations

import secrets
from pathlib import Path


def atomic_write(path: str | Path, data: str | bytes) -> Path:
    """Write data (text as UTF-8) to path by way of a temporary file beside it; returns the path.

    Raises OSError, with the path in its message, when the folder is missing or must not be written to; what was at
    the path then stays, and nothing else is left behind.
    """
    target = Path(path).resolve()  # through a link, so that the link stays one
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.tmp")
    try:
        try:
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
