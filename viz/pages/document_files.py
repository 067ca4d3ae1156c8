"""Files of a document: one page, its Markdown with pictures, its rows as CSV, and its data as JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING

from .document import Document, to_html, to_markdown

if TYPE_CHECKING:
    from cgraph.extend import Json


def check_folder(folder: Path) -> None:
    """Write a file into the folder and leave nothing behind, the folder included: before the work of filling it.

    Raises OSError, with the folder in its message.
    """
    ancestors = [folder, *folder.parents]
    missing = [path for path in ancestors if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        files = [path for path in ancestors if path.exists() and not path.is_dir()]
        why = f"{files[0]} is a file" if files else error.strerror or str(error)
        raise OSError(error.errno, f"cannot write into the folder {folder}: {why}") from error
    finally:
        for path in missing:
            with suppress(OSError):  # not made, or somebody else has put something there
                path.rmdir()


def document_files(
    folder: Path, name: str, document: Document, data: Mapping[str, Json], rows: str | None = None, *, kind: str = ""
) -> dict[Path, str]:
    """The files of one document in a folder, {path: text}, the page last.

    They are called by the name, with `_` for what a file's name should not have, and `-kind` where there is a kind.
    data: what the document was made of.  rows: as CSV; without them that file is left out.
    """
    stem = "-".join(filter(None, [re.sub(r"[^A-Za-z0-9.+-]+", "_", name).strip("_"), kind]))
    files = {f"-{picture.name}.svg": picture.svg for picture in document.pictures()}
    files[".json"] = json.dumps(data, indent=1)
    if rows is not None:
        files[".csv"] = rows
    files |= {".md": to_markdown(document, f"{stem}-"), ".html": to_html(document)}
    return {folder / f"{stem}{ending}": text for ending, text in files.items()}
