"""What importing cgraph costs: NumPy and the standard library, nothing else."""

import os
import subprocess
import sys
from pathlib import Path

import cgraph as cg

LIST_MODULES = "import sys; before = set(sys.modules); import {}; print(*sorted(set(sys.modules) - before))"


def loaded_by(module: str) -> set[str]:
    """Top-level modules that importing this one loads, in a fresh interpreter."""
    code = LIST_MODULES.format(module)
    env = os.environ | {"PYTHONPATH": str(Path(cg.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True, text=True)
    return {name.partition(".")[0] for name in done.stdout.split()}


def test_importing_cgraph_loads_nothing_but_numpy_and_the_standard_library():
    outside = loaded_by("cgraph") - set(sys.stdlib_module_names) - loaded_by("numpy")
    assert outside == {"cgraph"}


def test_a_module_from_outside_is_seen():
    """Test the tests."""
    assert "networkx" in loaded_by("networkx") - set(sys.stdlib_module_names)


def test_evaluating_and_differentiating_load_nothing_more():
    code = (
        "import cgraph as cg, sys; before = set(sys.modules); x = cg.variable('x');"
        "g = cg.simplify(cg.hessian(cg.Graph([x], {'f': cg.sin(x)}))); g.evaluate({'x': 1.0}); g.counts(); g.listing();"
        "print(*sorted(set(sys.modules) - before))"
    )
    env = os.environ | {"PYTHONPATH": str(Path(cg.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True, text=True)
    assert {name.partition(".")[0] for name in done.stdout.split()} <= set(sys.stdlib_module_names)
