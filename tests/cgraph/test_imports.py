"""What importing costs: a package loads NumPy and the standard library, a program what it uses."""

import json
import sys
from pathlib import Path
from types import ModuleType

import cgraph as cg
import dynamics as dyn
import viz
from tests.processes import printed_by
from tests.sources import PACKAGES, ROOT

PLAIN = {*sys.stdlib_module_names, "numpy"}
LABORATORY = tuple([f"dynamics.{room}" for room in ("experiments", "verification", "multiprecision")])
MOST = {"viz": 10, "equations": 110, "simulation": 201}  # {step: modules of ours that are loaded up to there, at most}


def loaded(program: str, folder: Path) -> dict[str, set[str]]:
    """{step: modules loaded up to there} of a program that calls `step(name)`, run in a process of its own."""
    text = (
        "import contextlib, io, json, sys\n"
        "old, steps = set(sys.modules), {}\n"
        "def step(name): steps[name] = sorted(set(sys.modules) - old - {'__mp_main__'})\n"
        f"{program}\n"
        "print(json.dumps(steps))"
    )
    return {name: set(modules) for name, modules in json.loads(printed_by(text, folder=folder)).items()}


def roots(modules: set[str]) -> set[str]:
    return {name.partition(".")[0] for name in modules}


def ours(modules: set[str]) -> list[str]:
    return sorted(name for name in modules if name.partition(".")[0] in PACKAGES)


def test_a_program_loads_what_it_uses(tmp_path: Path) -> None:
    steps = loaded(
        "import cgraph as cg; step('cgraph')\n"
        "import dynamics; step('dynamics')\n"
        "import viz; step('viz')\n"
        "x = cg.variable('x')\n"
        "graph = cg.simplify(cg.hessian(cg.Graph([x], {'f': cg.sin(x)})))\n"
        "graph.evaluate({'x': 1.0}), graph.counts(), graph.listing(); step('cgraph at work')\n"
        "import cgraph.extend\n"
        "packages = cgraph, cgraph.extend, dynamics, viz\n"
        "assert [set(each.__all__) - set(dir(each)) for each in packages] == [set()] * 4\n"  # names before modules
        "import networkx; step('networkx')\n",
        tmp_path,
    )
    for name, own in (("cgraph", 1), ("dynamics", 2), ("viz", 3), ("cgraph at work", 3)):
        assert set(PACKAGES[:own]) <= roots(steps[name]) <= PLAIN | set(PACKAGES[:own]), name
    steps |= loaded(
        "import dynamics as dyn\n"
        "arm = dyn.planar_arm([1.0, 1.0], [1.0, 1.0]); dyn.inverse_dynamics(arm); step('equations')\n"
        "dyn.simulate(arm, [0.0, 1.0], [0.0, 0.0], 0.1); step('simulation')\n",
        tmp_path,
    )
    assert {name: len(ours(steps[name])) for name in MOST if len(ours(steps[name])) > MOST[name]} == {}
    assert "dynamics.simulation.simulate" in steps["simulation"]
    assert [name for name in steps["simulation"] if name.startswith(LABORATORY)] == []
    assert "networkx" in steps["networkx"]  # test the tests: a module from outside is seen


def test_the_core_loads_nothing_else_of_ours(tmp_path: Path) -> None:
    modules = [f"cgraph.core.{path.stem}" for path in (ROOT / "cgraph" / "core").glob("[!_]*.py")]
    found = loaded(f"import {', '.join(modules)}; step('core')", tmp_path)["core"]
    others = {"cgraph", "cgraph.core", "cgraph.util", "cgraph.util.doors", "cgraph.util.version"}
    assert set(ours(found)) - set(modules) == others


def test_drawing_knows_nothing_of_mechanics(tmp_path: Path) -> None:
    drawing = sorted({*viz.__all__} - {"animate", "draw", "driven", "inspect", "lesson", "live", "typed_text"})
    assert "dynamics" not in loaded(f"from viz import {', '.join(drawing)}; step('viz')", tmp_path)["viz"]


USAGE = """
from viz.cli import main
from viz.commands.command import COMMANDS
known = ["draw chain --out a.svg --formulation best", "code chain", "simulate chain --t-end 0", "lint chain --box q0=1"]
for line in ["", "--help", "--version", "best", "draw", *known, *[f"{name} --best" for name in COMMANDS]]:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), contextlib.suppress(SystemExit):
        raise ValueError(f"cgraph {line} runs and ends with {main(line.split())}")
    assert said.getvalue().startswith("cgraph " if line == "--version" else "usage: "), line
step("usage")
import numpy.random
old |= set(sys.modules)
for line in ("scenes", "draw --help", "report --help", "draw chain --out a.dot"):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main(line.split())
    step(line)
"""


def test_help_comes_before_the_library_and_a_command_loads_no_optional_dependency_that_it_does_not_use(
    tmp_path: Path,
) -> None:
    steps = loaded(USAGE, tmp_path)
    usage = steps.pop("usage")
    assert "viz.commands.draw" in usage
    library = [name for name in usage if name.partition(".")[0] in ("numpy", "dynamics", "viz") and "." in name]
    assert [name for name in library if not name.startswith(("viz.cli", "viz.commands"))] == []
    for command, modules in steps.items():
        assert roots(modules) <= PLAIN | {*PACKAGES} | ({"graphviz"} if ".dot" in command else set()), command


def test_a_function_stays_when_modules_are_loaded() -> None:
    """A package that had its name would take its place."""
    names = [(module, name) for module in (cg, dyn, viz) for name in module.__all__]
    for module, name in names:
        getattr(module, name)
    modules = {f"{module.__name__}.{name}" for module, name in names if isinstance(getattr(module, name), ModuleType)}
    assert modules <= {"dynamics.scenes", "dynamics.cases"}
