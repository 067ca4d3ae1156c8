"""The rule of direction: which folder may import which, as one table."""

from __future__ import annotations

import itertools

PACKAGES = ("cgraph", "dynamics", "viz")

# "a <- b": b may import a, and all that a may import. Names are folders of the package, or modules beside them;
# those of the last group are whole packages, or folders of one.
TABLE = {
    "cgraph": (
        "core <- util <- operations <- writing <- simplification <- autodiff <- explain",
        "autodiff <- codegen <- program",
    ),
    "dynamics": (
        "systems <- equations <- multibody <- io",
        "equations <- integrators <- simulation",
        "equations, multibody <- multiprecision",
        "simulation, io <- scenes",
        "scenes, multiprecision <- peers <- verification, experiments",
    ),
    "viz": (
        "theme <- graph_drawing, plots <- pages <- inspector, paper <- models <- commands <- cli <- __main__",
        "theme <- animation <- models",
        "graph_drawing <- architecture <- commands",
        "pages <- live <- models",
        "inspector <- lessons <- commands",
        "inspector <- typed <- models, commands",
    ),
    "": (
        "cgraph <- dynamics <- viz.paper, viz.models, viz.lessons, viz.commands",
        "cgraph <- viz",
    ),
}  # fmt: skip


# Methods of a module that import when they are called, so that a person finds `graph.latex()`; nothing of the module
# itself is made of what they import.
DOORS = {
    "cgraph.core.graph": ("cgraph.writing", "cgraph.util"),
    "cgraph.core.node": ("cgraph.operations", "cgraph.util"),
}


def may_import(importer: str, imported: str) -> bool:
    """Whether one folder, such as "viz.pages", may import another, such as "viz.plots"."""
    if importer == imported:
        return True
    return any(low in _BELOW.get(high, ()) for high in _with_package(importer) for low in _with_package(imported))


def _with_package(folder: str) -> tuple[str, ...]:
    package = folder.partition(".")[0]
    return (folder, package) if folder != package else (package,)


def _below() -> dict[str, set[str]]:
    """{folder: all that the table lets it import}: the chains of the table, closed under composition."""
    below: dict[str, set[str]] = {}
    for package, chains in TABLE.items():
        for chain in chains:
            layers = [
                [f"{package}.{name}" if package else name for name in layer.split(", ")]
                for layer in chain.split(" <- ")
            ]
            for low, high in itertools.pairwise(layers):
                for name in high:
                    below.setdefault(name, set()).update(low)
    for _ in below:
        for names in below.values():
            names.update(*(below.get(name, ()) for name in tuple(names)))
    return below


_BELOW = _below()
