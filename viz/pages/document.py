"""Documents: headings, words, tables and pictures, as one HTML page or as Markdown, and the files of one."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryFile

from cgraph.extend import Json

from . import html


@dataclass(frozen=True)
class Paragraph:
    """Words.  point: the one thing to see in a section, set apart.  warning: set apart, as what is wrong."""

    text: str
    point: bool = False
    warning: bool = False


@dataclass(frozen=True)
class Table:
    """Texts in rows; the first column is read to the left, the others to the right.  folded: shown when asked for."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    folded: bool = False


@dataclass(frozen=True)
class Picture:
    """SVG whose ink takes the page's colors, see `plot.to_adaptive_svg`.  name: of its file, without suffix."""

    name: str
    svg: str
    caption: str


Block = Paragraph | Table | Picture


@dataclass(frozen=True)
class Section:
    """A part of a document.  anchor: where links lead."""

    anchor: str
    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Document:
    """A title, what comes before the first heading, and sections."""

    title: str
    introduction: Sequence[Block]
    sections: Sequence[Section] = field(default_factory=tuple)

    def pictures(self) -> list[Picture]:
        """All pictures, in order."""
        blocks = [*self.introduction, *(block for section in self.sections for block in section.blocks)]
        return [block for block in blocks if isinstance(block, Picture)]


def left_out(what: Sequence[str]) -> list[Block]:
    """Blocks at the top of a page on what its model has not of the file that it was read from."""
    return [Paragraph(f"Left out of the model: {'; '.join(what)}.", warning=True)] if what else []


def to_html(document: Document) -> str:
    """The document as a page that needs no other file."""
    sections = [(section.anchor, section.heading, _html(section.blocks)) for section in document.sections]
    return html.page(document.title, _html(document.introduction), sections)


def _html(blocks: Sequence[Block]) -> str:
    parts = []
    for block in blocks:
        match block:
            case Paragraph(text, point, warning):
                parts.append(html.point(text, warning=warning) if point or warning else html.paragraph(text))
            case Table(caption, header, rows, folded):
                table = html.table(caption, header, rows)
                parts.append(html.folded(caption, table) if folded else table)
            case Picture(_, svg, caption):
                parts.append(html.figure(svg, caption, adapts=True))
    return "\n".join(parts)


def to_markdown(document: Document, folder: str = "") -> str:
    """The document as Markdown.  folder: where its pictures are, `<name>.svg` each, relative to the text."""
    lines = [f"# {document.title}", "", *_markdown(document.introduction, folder)]
    for section in document.sections:
        lines += [f"## {section.heading}", "", *_markdown(section.blocks, folder)]
    return "\n".join(lines).rstrip() + "\n"


def _markdown(blocks: Sequence[Block], folder: str) -> list[str]:
    lines: list[str] = []
    for block in blocks:
        match block:
            case Paragraph(text, point, warning):
                lines += [f"> {text}" if point or warning else text, ""]
            case Table(caption, header, rows, _):
                lines += [
                    f"**{caption}**",
                    "",
                    _row(header),
                    "|" + "|".join([":--", *["--:"] * (len(header) - 1)]) + "|",
                ]
                lines += [*map(_row, rows), ""]
            case Picture(name, _, caption):
                lines += [f"![{caption}]({folder}{name}.svg)", ""]
    return lines


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join([cell.replace("|", "\\|") for cell in cells]) + " |"


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
