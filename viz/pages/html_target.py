"""HTML target: the file that a page is to be written to, looked at before the work."""

from __future__ import annotations

import os
from pathlib import Path

from cgraph.extend import check_writable, require_path


def html_target(what: str, path: str | os.PathLike[str] | None) -> Path | None:
    """The path, if there is one.

    Raises TypeError for what is no path, ValueError for one that does not end in .html, OSError for one that cannot be
    written.
    """
    if path is None:
        return None
    target = require_path(what, path)
    if target.suffix != ".html":
        raise ValueError(f"{what} must end in .html, got {os.fspath(target)!r:.80}")
    check_writable(target)
    return target
