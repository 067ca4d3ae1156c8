"""The picture of the architecture: folders on floors, with an arrow from every folder to each that it imports.

`make docs` writes it anew where the imports have changed.
"""

import re
from pathlib import Path

PACKAGES = ("cgraph", "dynamics", "viz")
WHOLE = ("cgraph", "viz")  # each is one box
PICTURE = Path(__file__).parents[1] / "images" / "architecture.svg"


def arrows():
    """{(importer, imported)} between the folders, of imports that run; those of a package's face are left out."""
    import grimp

    imports = grimp.build_graph(*PACKAGES, exclude_type_checking_imports=True, cache_dir=None)
    pairs = {(_box(a), _box(b)) for a in imports.modules for b in imports.find_modules_directly_imported_by(a)}
    return {(a, b) for a, b in pairs if a != b and "dynamics" not in (a, b)}


def _box(module):
    package, *rest = module.split(".")
    return package if package in WHOLE or not rest else f"{package}.{rest[0]}"


def picture(pairs):
    """The drawing as SVG: each folder above the highest that it imports; faint arrows follow from others."""
    import networkx as nx

    from viz import render_svg, theme
    from viz.graph_drawing.draw_shapes import digraph

    graph = nx.DiGraph(sorted(pairs))
    direct = nx.transitive_reduction(graph)
    colors = {"cgraph": theme.SKY_BLUE, "dynamics": theme.GREEN, "viz": theme.ORANGE}
    drawing = digraph("TB")
    drawing.attr(ranksep="0.55", nodesep="0.3")
    for floor in nx.topological_generations(graph.reverse()):
        with drawing.subgraph() as row:
            row.attr(rank="same")
            for box in sorted(floor):
                package, _, folder = box.partition(".")
                fill = {"fillcolor": theme.tint(colors[package], 0.3), "color": colors[package]}
                row.node(box, label=folder or box, shape="box", style="filled,rounded", height="0.42", **fill)
    for a, b in sorted(pairs):
        clear = {"penwidth": "1.5", "weight": "8"}
        faint = {"color": "#C4C4C0", "penwidth": "0.7", "arrowsize": "0.5", "weight": "0"}
        drawing.edge(a, b, id=f"{a}->{b}", **(clear if direct.has_edge(a, b) else faint))
    return render_svg(drawing)


def _write(app):
    pairs = arrows()
    shown = re.findall(r'id="([\w.]+)&#45;&gt;([\w.]+)"', PICTURE.read_text(encoding="utf-8"))
    if set(shown) != pairs:
        PICTURE.write_text(picture(pairs), encoding="utf-8")


def setup(app):
    """The extension, before any page is read."""
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True}
