"""How long the simplified forward-dynamics graph takes to build: `python tests/benchmarks/build_time.py`.

Prints medians on this machine, one core; asserts nothing.
"""

import argparse
import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import dynamics as dyn


def build_times(n: int, repeats: int) -> tuple[list[float], int, int]:
    """Seconds of each build, and the nodes and edges built, for an arm of n unlike links."""
    arm = dyn.planar_arm([1.0 - 0.3 * i / n for i in range(n)], [1.1 - 0.4 * i / n for i in range(n)], damping=0.1)
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        fresh = dyn.Mechanism(arm.bodies, arm.gravity)  # its Lagrangian is built anew too
        graph = dyn.forward_dynamics(fresh)
        seconds.append(time.perf_counter() - start)
    return seconds, len(graph.nodes), len(graph.edges)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--links", type=int, nargs="+", default=[3, 20], help="sizes of the arm (default: 3 20)")
    parser.add_argument("--repeats", type=int, default=7, help="builds of each size (default: 7)")
    arguments = parser.parse_args()
    print("forward dynamics of a planar arm, from its Lagrangian to the simplified graph")
    print(f"{'links':>5}  {'median':>9}  {'fastest':>9}  {'slowest':>9}  {'nodes':>6}  {'edges':>6}")
    for n in arguments.links:
        seconds, nodes, edges = build_times(n, arguments.repeats)
        columns = [f"{1e3 * each:6.1f} ms" for each in (statistics.median(seconds), min(seconds), max(seconds))]
        print(f"{n:>5}  {'  '.join(columns)}  {nodes:>6}  {edges:>6}")


if __name__ == "__main__":
    main()
