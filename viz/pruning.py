"""The page of what was left out of a scene's graphs: tables and words from the plain data of a report."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cgraph.files import write as write_file

from .document import Block, Document, Paragraph, Section, Table, to_html, to_markdown

Content = Mapping[str, Any]  # what `dynamics.reports.pruning.report` gives
HEADER = ["", "why", "nodes", "edges"]


def document(content: Content) -> Document:
    """The document of one scene."""
    sizes = [
        [each["equations"], *(f"{each[part][what]}" for what in ("nodes", "edges") for part in ("full", "pruned"))]
        for each in content["graphs"]
    ]
    introduction: list[Block] = [
        Paragraph(f"{content['about']}. Effects that are on: {', '.join(content['effects']) or 'none'}."),
        Table("Sizes of the graphs", ["", "nodes, as given", "nodes, left", "edges, as given", "edges, left"], sizes),
        Paragraph("All counts are exact; inputs that are used and constants are nodes."),
    ]
    return Document(
        f"What {content['name']} does not need", introduction, [_section(each) for each in content["graphs"]]
    )


def _section(graph: Content) -> Section:
    saved = graph["full"]["nodes"] - graph["pruned"]["nodes"]
    share = f"{saved / graph['full']['nodes']:.0%}" if saved else "nothing"
    blocks: list[Block] = [Paragraph(f"{saved} of {graph['full']['nodes']} nodes are left out: {share}.", point=True)]
    if graph["left_out"]:
        blocks.append(Table("Left out, in this order", HEADER, _rows(graph["left_out"])))
    if graph["absent"]:
        blocks.append(Table("Not in the model; nodes and edges that it would add", HEADER, _rows(graph["absent"])))
    if graph["remains"]:
        blocks.append(Table("Remains, though no motion shows it", HEADER, _rows(graph["remains"])))
    tags = [[tag, f"{full}", f"{left}"] for tag, (full, left) in graph["by_tag"].items()]
    if tags:
        blocks.append(Table("Nodes by tag; a node may have several", ["", "as given", "left"], tags, folded=True))
    return Section(graph["equations"].replace(" ", "-"), graph["equations"].capitalize(), blocks)


def _rows(found: Sequence[Content]) -> list[list[str]]:
    return [[each["what"], each["why"], f"{each['nodes']}", f"{each['edges']}"] for each in found]


def write(folder: Path, content: Content) -> Path:
    """Write page, Markdown and JSON into a folder, each at once; returns the page."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = re.sub(r"[^A-Za-z0-9.+-]+", "_", content["name"]).strip("_") + "-pruning"
    made = document(content)
    write_file(folder / f"{stem}.json", json.dumps(content, indent=1))
    write_file(folder / f"{stem}.md", to_markdown(made))
    return write_file(folder / f"{stem}.html", to_html(made))
