"""The page of what was left out of a scene's graphs: tables and words from the plain data of a report."""

from .document import Block, Document, Paragraph, ReportData, Section, Table, left_out

CAPTIONS = {  # of the tables of terms
    "left_out": "Left out, in this order",
    "absent": "Not in the model; nodes and edges that it would add",
    "remains": "Remains, though no motion shows it",
}


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
    sections = [_section(graph) for graph in content["graphs"]]
    return Document(f"What {content['name']} does not need", introduction, sections)


def _section(graph: ReportData) -> Section:
    saved = graph["full"]["nodes"] - graph["pruned"]["nodes"]
    share = f": {saved / graph['full']['nodes']:.0%}" if saved else ""
    blocks: list[Block] = [Paragraph(f"{saved} of {graph['full']['nodes']} nodes are left out{share}.", point=True)]
    for kind, caption in CAPTIONS.items():
        rows = [[term["what"], term["why"], f"{term['nodes']}", f"{term['edges']}"] for term in graph[kind]]
        if rows:
            blocks.append(Table(caption, ["", "why", "nodes", "edges"], rows))
    tags = [[tag, f"{full}", f"{left}"] for tag, (full, left) in graph["by_tag"].items()]
    if tags:
        blocks.append(Table("Nodes by tag; a node may have several", ["", "as given", "left"], tags, folded=True))
    return Section(graph["equations"].replace(" ", "-"), graph["equations"].capitalize(), blocks)
