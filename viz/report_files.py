"""Files of a report: one page, its Markdown with pictures, its points as CSV, and all of it as JSON."""

from __future__ import annotations

import json
import re
from pathlib import Path

from cgraph.files import write

from .document import to_html, to_markdown
from .report import Content, work_precision


def write_report(folder: Path, content: Content, points: str) -> Path:
    """Write the files of one report into a folder, each at once; returns the page.  points: as CSV."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = re.sub(r"[^A-Za-z0-9.+-]+", "_", content["name"]).strip("_")
    document = work_precision(content)
    for picture in document.pictures():
        write(folder / f"{stem}-{picture.name}.svg", picture.svg)
    write(folder / f"{stem}.json", json.dumps(content, indent=1))
    write(folder / f"{stem}.csv", points)
    write(folder / f"{stem}.md", to_markdown(document, f"{stem}-"))
    return write(folder / f"{stem}.html", to_html(document))
