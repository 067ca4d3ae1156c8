"""Documents: headings, words, tables and pictures, as one HTML page or as Markdown, and the files of one."""

import base64
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from cgraph._shared import Json

from .html import STYLE, compose

ReportData = Mapping[str, Any]  # a report, or a part of one, as plain data: `to_dict()` of it, or its JSON file


@dataclass(frozen=True)
class Paragraph:
    """Words.  point: the one thing to see in a section, set apart.  warning: set apart, as what is wrong."""

    text: str
    point: bool = False
    warning: bool = False

    def html(self) -> str:
        """The words as HTML."""
        kind = ' class="warning"' if self.warning else ' class="point"' if self.point else ""
        return f"<p{kind}>{escape(self.text)}</p>"

    def markdown(self, folder: str) -> list[str]:
        """Lines of Markdown."""
        return [f"> {self.text}" if self.point or self.warning else self.text, ""]


@dataclass(frozen=True)
class Markup:
    """HTML as it is, such as words with formulas or what moves.  words: what stands for it in Markdown."""

    markup: str
    words: str

    def html(self) -> str:
        """The HTML."""
        return self.markup

    def markdown(self, folder: str) -> list[str]:
        """Lines of Markdown."""
        return [self.words, ""]


@dataclass(frozen=True)
class Table:
    """Texts in rows; the first column is read to the left, the others to the right.

    folded: shown when asked for.  file: the name of its CSV, without suffix; empty for none.
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    folded: bool = False
    file: str = ""

    def html(self) -> str:
        """The table as HTML."""
        head = "".join([f'<th scope="col">{escape(name)}</th>' if name else "<td></td>" for name in self.header])
        body = "\n".join(
            ["<tr>" + "".join([f"<td>{escape(cell)}</td>" for cell in row]) + "</tr>" for row in self.rows]
        )
        table = (
            f'<div class="scroll" tabindex="0" role="group"><table>'
            f"<caption><span>{escape(self.caption)}</span></caption>"
            f"<thead><tr>{head}</tr></thead>"
            f"<tbody>\n{body}\n</tbody></table></div>"
        )
        return f"<details><summary>{escape(self.caption)}</summary>\n{table}\n</details>" if self.folded else table

    def markdown(self, folder: str) -> list[str]:
        """Lines of Markdown."""
        rule = "|" + "|".join([":--", *["--:"] * (len(self.header) - 1)]) + "|"
        lines = [" | ".join([cell.replace("|", "\\|") for cell in cells]) for cells in (self.header, *self.rows)]
        head, *rows = [f"| {line} |" for line in lines]
        return [f"**{self.caption}**", "", head, rule, *rows, ""]


@dataclass(frozen=True)
class Picture:
    """SVG whose ink takes the page's colors, see `plot.to_adaptive_svg`.

    name: of its file, without suffix; empty for none.  width: in the page, "100%" or "auto"; None leaves it to the
    page's style.  png: the scale of a PNG beside the SVG, as of `render_png`; 0 for none.  alt: what is seen, for who
    does not see it; the caption where there is none.
    """

    name: str
    svg: str
    caption: str
    width: str | None = "100%"
    png: float = 0.0
    alt: str = ""

    def html(self) -> str:
        """The picture inside the page, with its caption below."""
        data, caption = base64.b64encode(self.svg.encode()).decode(), escape(self.caption)
        kind = "" if self.width is None else ' class="plot"' if self.width == "100%" else ' class="drawing"'
        wide = ' class="wide"' if self.width == "100%" else ""
        alt = escape(self.alt) or caption
        return (
            f'<figure{wide} tabindex="0"><img{kind} src="data:image/svg+xml;base64,{data}" alt="{alt}">'
            f"<figcaption>{caption}</figcaption></figure>"
        )

    def markdown(self, folder: str) -> list[str]:
        """Lines of Markdown.  folder: where the picture is, relative to the text."""
        return [f"![{self.caption}]({folder}{self.name}.svg)", ""]


Block = Paragraph | Markup | Table | Picture


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
        """List of all pictures, in order."""
        blocks = [*self.introduction, *(block for section in self.sections for block in section.blocks)]
        return [block for block in blocks if isinstance(block, Picture)]


def left_out(what: Sequence[str]) -> list[Block]:
    """Blocks at the top of a page on what its model has not of the file that it was read from."""
    return [Paragraph(f"Left out of the model: {'; '.join(what)}.", warning=True)] if what else []


def to_html(document: Document, style: str = "", script: str = "", data: Mapping[str, object] | None = None) -> str:
    """The document as a page that needs no other file, with a line of links to its sections.

    style, script, data: of blocks that move, as `compose` takes them.
    """
    title, sections = escape(document.title), document.sections
    links = " ".join([f'<a href="#{escape(each.anchor)}">{escape(each.heading)}</a>' for each in sections])
    body = "\n".join(
        [
            f'<section id="{escape(each.anchor)}">\n<h2>{escape(each.heading)}</h2>\n{_html(each.blocks)}\n</section>'
            for each in sections
        ]
    )
    text = f"<main>\n<h1>{title}</h1>\n{_html(document.introduction)}\n<nav>{links}</nav>\n{body}\n</main>"
    return compose(document.title, text, STYLE + style, script, data)


def _html(blocks: Sequence[Block]) -> str:
    return "".join([block.html() for block in blocks])


def to_markdown(document: Document, folder: str = "") -> str:
    """The document as Markdown.  folder: where its pictures are, `<name>.svg` each, relative to the text."""
    parts = [(f"# {document.title}", document.introduction)]
    parts += [(f"## {section.heading}", section.blocks) for section in document.sections]
    lines: list[str] = []
    for heading, blocks in parts:
        lines += [heading, "", *[line for block in blocks for line in block.markdown(folder)]]
    return "\n".join(lines).rstrip() + "\n"


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
