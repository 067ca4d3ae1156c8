"""What importing cgraph costs: NumPy and the standard library, nothing else."""

import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import cgraph as cg
import dynamics as dyn
import viz

OURS = ("cgraph", "dynamics", "viz")


def modules_of(code: str) -> list[str]:
    """Modules that a program loads beyond those that Python starts with, in a fresh interpreter."""
    code = f"import sys; before = set(sys.modules); {code}; print(*sorted(set(sys.modules) - before))"
    env = os.environ | {"PYTHONPATH": str(Path(cg.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, check=True, text=True)
    return done.stdout.split()


def loaded_by(module: str) -> set[str]:
    """Top-level modules that importing this one loads."""
    return {name.partition(".")[0] for name in modules_of(f"import {module}")}


ARM = "import dynamics as dyn; arm = dyn.planar_arm([1.0, 1.0], [1.0, 1.0])"


@pytest.mark.parametrize(
    ("code", "most"),
    [
        ("import cgraph", 10),
        ("import dynamics", 10),
        ("import viz", 10),
        (f"{ARM}; dyn.inverse_dynamics(arm)", 107),
        (f"{ARM}; dyn.simulate(arm, [0.0, 1.0], [0.0, 0.0], 0.1)", 200),
    ],
)
def test_a_program_loads_what_it_uses(code: str, most: int) -> None:
    loaded = [name for name in modules_of(code) if name.partition(".")[0] in OURS]
    assert len(loaded) <= most


USAGE = """
import contextlib, io
from viz.cli import main
from viz.commands.command import COMMANDS
known = ["draw chain --out a.svg --formulation best", "code chain", "simulate chain --t-end 0", "lint chain --box q0=1"]
for line in ["", "--help", "--version", "best", "draw", *known, *[f"{name} --best" for name in COMMANDS]]:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), contextlib.suppress(SystemExit):
        raise ValueError(f"cgraph {line} runs and ends with {main(line.split())}")
    assert said.getvalue().startswith("cgraph " if line == "--version" else "usage: "), line
"""


def test_the_help_and_a_wrong_argument_come_before_the_library() -> None:
    loaded = modules_of(f"exec({USAGE!r})")
    assert "viz.commands.draw" in loaded
    ours = [name for name in loaded if name.partition(".")[0] in ("numpy", "dynamics", "viz") and "." in name]
    assert [name for name in ours if not name.startswith(("viz.cli", "viz.commands"))] == []


def test_names_are_there_before_they_are_loaded() -> None:
    packages = "(cgraph, dynamics, viz, cgraph.extend)"
    code = f"import cgraph.extend, dynamics, viz; print([set(p.__all__) - set(dir(p)) for p in {packages}])"
    assert " ".join(modules_of(code)).startswith("[set(), set(), set(), set()]")


def test_a_function_stays_when_modules_are_loaded() -> None:
    """A package that had its name would take its place."""
    names = [(module, name) for module in (cg, dyn, viz) for name in module.__all__]
    for module, name in names:
        getattr(module, name)
    modules = {f"{module.__name__}.{name}" for module, name in names if isinstance(getattr(module, name), ModuleType)}
    assert modules <= {"dynamics.scenes", "dynamics.cases"}


def test_importing_cgraph_loads_nothing_but_numpy_and_the_standard_library():
    outside = loaded_by("cgraph") - set(sys.stdlib_module_names) - loaded_by("numpy")
    assert outside == {"cgraph"}


def test_a_module_from_outside_is_seen():
    """Test the tests."""
    assert "networkx" in loaded_by("networkx") - set(sys.stdlib_module_names)


def test_evaluating_and_differentiating_load_nothing_more():
    code = (
        "import cgraph as cg; x = cg.variable('x');"
        "g = cg.simplify(cg.hessian(cg.Graph([x], {'f': cg.sin(x)}))); g.evaluate({'x': 1.0}); g.counts(); g.listing()"
    )
    assert {name.partition(".")[0] for name in modules_of(code)} <= {*sys.stdlib_module_names, "cgraph", "numpy"}
