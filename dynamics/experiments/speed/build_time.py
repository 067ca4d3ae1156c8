"""Build time: how long the simplified forward-dynamics graph of a planar arm takes, from its Lagrangian on."""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator

from ...equations.equations_of_motion import forward_dynamics
from ...multibody.planar_arm import planar_arm
from ..text_table import table

SIZES = (3, 20)  # links
REPEATS = 7  # builds of each size


def build_time(links: int | None = None, repeats: int = REPEATS) -> Iterator[str]:
    """Median, fastest and slowest build, and the size of what is built. links: this size alone."""
    rows = []
    for n in SIZES if links is None else (links,):
        seconds = []
        for _ in range(repeats):
            begin = time.perf_counter()  # an arm anew each time: its Lagrangian is kept
            arm = planar_arm([1.0 - 0.3 * i / n for i in range(n)], [1.1 - 0.4 * i / n for i in range(n)], damping=0.1)
            graph = forward_dynamics(arm)
            seconds.append(time.perf_counter() - begin)
        times = [f"{1e3 * each:.1f} ms" for each in (statistics.median(seconds), min(seconds), max(seconds))]
        rows.append([str(n), *times, str(len(graph.nodes)), str(len(graph.edges))])
    header = ["links", "median", "fastest", "slowest", "nodes", "edges"]
    title = "forward dynamics of a planar arm, from its Lagrangian to the simplified graph"
    yield "\n".join([title, *table(header, rows, left=())])
