"""Places of nodes in layers: arguments below their uses, and nothing on top of another."""

import numpy as np

from tests.each_row import each_row
from tests.page_script import run_script

STEP, GAP = run_script("() => [LAYERS.step, LAYERS.gap]")


@each_row("seed", range(4))
def test_layers_put_arguments_below_and_nothing_on_top_of_another(seed):
    rng = np.random.default_rng(seed)
    widths = rng.uniform(30, 90, 60).tolist()
    edges = sorted({(int(a), int(b)) for a, b in rng.integers(0, 60, (90, 2)) if a < b})
    layout = run_script("(widths, edges) => layered(widths, edges)", widths, edges)
    x, y = layout["x"], layout["y"]
    assert all(y[source] >= y[target] + STEP for source, target in edges)
    for a in range(60):
        assert widths[a] / 2 <= x[a] + 1e-9
        assert x[a] + widths[a] / 2 <= layout["width"] + 1e-9
        assert 0 < y[a] < layout["height"]
        for b in range(a):
            assert y[a] != y[b] or abs(x[a] - x[b]) >= (widths[a] + widths[b]) / 2 + GAP - 1e-6


def test_an_empty_cluster_has_no_size():
    assert run_script("() => layered([], [])") == {"x": [], "y": [], "width": 0.0, "height": 0.0}
