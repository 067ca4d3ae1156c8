"""The page of what was left out of a scene's graphs: tables and words from the plain data of a report."""

from collections.abc import Sequence

from .document import Block, Document, Paragraph, ReportData, Section, Table, left_out

HEADER = ["", "why", "nodes", "edges"]


def document(content: ReportData) -> Document:
    """The document of one scene."""
    sizes = [
        [graph["equations"], *(f"{graph[part][what]}" for what in ("nodes", "edges") for part in ("full", "pruned"))]
        for graph in content["graphs"]
    ]
    introduction: list[Block] = [
        *left_out(content["left_out"]),
        Paragraph(f"{content['about']}. Effects that are on: {', '.join(content['effects']) or 'none'}."),
        Table("Sizes of the graphs", ["", "nodes, as given", "nodes, left", "edges, as given", "edges, left"], sizes),
        Paragraph("All counts are exact; inputs that are used and constants are nodes."),
    ]
    return Document(
        f"What {content['name']} does not need", introduction, [_section(graph) for graph in content["graphs"]]
    )


def _section(graph: ReportData) -> Section:
    saved = graph["full"]["nodes"] - graph["pruned"]["nodes"]
    share = f": {saved / graph['full']['nodes']:.0%}" if saved else ""
    blocks: list[Block] = [Paragraph(f"{saved} of {graph['full']['nodes']} nodes are left out{share}.", point=True)]
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


def _rows(terms: Sequence[ReportData]) -> list[list[str]]:
    return [[term["what"], term["why"], f"{term['nodes']}", f"{term['edges']}"] for term in terms]
