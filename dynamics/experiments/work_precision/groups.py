"""Groups of solvers: ours, and those of each peer, by how their names begin; and the names of comparisons."""

from __future__ import annotations

OURS = "ours"
# How the names of peers' solvers begin.
PEERS = {"MuJoCo": "MuJoCo", "SciPy": "scipy:", "heyoka": "heyoka", "CasADi": "CVODES", "diffrax": "diffrax"}
COMPARISONS = ("orders", "taylor", "stiff", "loops", "energy")  # functions of the module `comparisons`


def group(name: str) -> str:
    """The peer that a solver of this name belongs to; ours for none."""
    return next((peer for peer, begin in PEERS.items() if name.startswith(begin)), OURS)
