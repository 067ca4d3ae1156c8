"""Pruning report: what a scene's graphs hold and what was left out of them, as plain data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from cgraph import Graph

from ..equations.equations_of_motion import forward_dynamics
from ..equations.formulations.formulations import inverse_dynamics
from ..multibody.changes.pruning import EFFECTS, Equations, OmittedTerm, PruneResult, prune
from ..scenes.scenes import Scene

EQUATIONS: dict[str, Equations] = {"inverse dynamics": inverse_dynamics, "forward dynamics": forward_dynamics}


def report(
    scene: Scene,
    *,
    effects: Iterable[str] = EFFECTS,
    lock: Mapping[str, float] | None = None,
    values: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Report of `prune` on a scene's inverse and forward dynamics, for JSON.

    effects, lock: as of `prune`.  values: the same, where the equations have that input.
    """
    kept = tuple(effects)
    graphs = []
    for title, equations in EQUATIONS.items():
        known = _inputs(equations(scene))
        bound = {name: value for name, value in (values or {}).items() if name in known}
        pruned = prune(scene, equations, effects=kept, lock=lock, values=bound)
        graphs.append({"equations": title, **_account(pruned)})
    described = {"name": scene.name, "about": scene.about, "left_out": list(scene.left_out)}
    return {**described, "effects": list(kept), "graphs": graphs}


def _inputs(graph: Graph) -> set[str]:
    """Names of the inputs, and of their groups."""
    return {part for name in graph.input_names for part in (name, name.rstrip("0123456789"))}


def _account(pruned: PruneResult) -> dict[str, object]:
    full, left = pruned.full.counts().by_tag, pruned.graph.counts().by_tag
    return {
        "full": _size(pruned.full),
        "pruned": _size(pruned.graph),
        "left_out": [_row(each) for each in pruned.omitted],
        "absent": [_row(each) for each in pruned.absent],
        "remains": [_row(each) for each in pruned.remains],
        "by_tag": {tag: [full.get(tag, 0), left.get(tag, 0)] for tag in sorted({*full, *left})},
    }


def _size(graph: Graph) -> dict[str, int]:
    counts = graph.counts()
    return {"nodes": counts.nodes, "edges": counts.edges, "depth": counts.depth}


def _row(each: OmittedTerm) -> dict[str, object]:
    return {"what": each.what, "why": each.why, "nodes": each.nodes, "edges": each.edges}
