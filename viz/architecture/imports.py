"""The imports of packages, read from their sources: which module uses which, wherever in a file it says so."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path

from .import_rule import DOORS


@dataclass(frozen=True)
class Import:
    """One imported name.  module: absolute.  name: what comes from it, or None for the module as a whole.

    bound: the name that it has in the importing file.  for_types: it stands under `if TYPE_CHECKING:` and never runs.
    """

    module: str
    name: str | None
    bound: str
    for_types: bool = False


@dataclass(frozen=True)
class Module:
    """A source file as a module; a package's `__init__` has the package's name."""

    name: str
    path: Path

    @property
    def is_package(self) -> bool:
        """It is an `__init__`."""
        return self.path.name == "__init__.py"

    @cached_property
    def tree(self) -> ast.Module:
        """The syntax tree of its source."""
        return ast.parse(self.path.read_text(encoding="utf-8"))

    @cached_property
    def imports(self) -> tuple[Import, ...]:
        """All imports of the file: in functions and for types, too."""
        return tuple(imports_of(self.tree, self.name if self.is_package else self.name.rpartition(".")[0]))

    @cached_property
    def attributes(self) -> dict[str, set[str]]:
        """{name: attributes that the file takes of it}, of names that it uses in no other way."""
        taken: dict[str, set[str]] = {}
        used, nodes = set(), list(ast.walk(self.tree))
        for node in nodes:
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                taken.setdefault(node.value.id, set()).add(node.attr)
                used.add(id(node.value))
        bare = {node.id for node in nodes if isinstance(node, ast.Name) and id(node) not in used}
        return {name: names for name, names in taken.items() if name not in bare}

    @cached_property
    def is_face(self) -> bool:
        """It holds a docstring, imports, also on demand, and `__all__` alone: what it shows is written elsewhere."""
        body = [inner for line in self.tree.body for inner in (line.body if isinstance(line, ast.If) else [line])]
        return all(
            isinstance(line, ast.Import | ast.ImportFrom)
            or (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            or (isinstance(line, ast.FunctionDef) and line.name in ("_of_row", "__getattr__", "__dir__"))
            or (
                isinstance(line, ast.Assign)
                and ast.unparse(line.targets[0]) in ("__all__", "TYPE_CHECKING", "(__getattr__, __dir__)")
            )
            for line in body
        )


_OF_A_FACE = ("__all__", "TYPE_CHECKING", "__getattr__, __dir__", "(__getattr__, __dir__)")


def imports_of(tree: ast.AST, package: str = "") -> Iterator[Import]:
    """The imports of a syntax tree at any depth.  package: where its file lies, for relative imports."""
    nodes = list(ast.walk(tree))
    for_types = {
        id(inner)
        for node in nodes
        if isinstance(node, ast.If) and _is_type_checking(node.test)
        for line in node.body
        for inner in ast.walk(line)
    }
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(alias.name, None, alias.asname or alias.name.partition(".")[0], id(node) in for_types)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: -node.level + 1 or None] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                yield Import(module, alias.name, alias.asname or alias.name, id(node) in for_types)


def _is_type_checking(test: ast.expr) -> bool:
    return getattr(test, "id", getattr(test, "attr", "")) == "TYPE_CHECKING"


def modules(packages: Iterable[str]) -> dict[str, Module]:
    """{name: module} of installed packages, in the order of their files. Raises ValueError for one that is missing."""
    found = {}
    for package in packages:
        spec = find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            raise ValueError(f"there is no package {package!r} with sources to read")
        root = Path(next(iter(spec.submodule_search_locations)))
        for path in sorted(root.rglob("*.py")):
            parts = [package, *path.relative_to(root).with_suffix("").parts]
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = Module(name, path)
    return found


def uses(known: Mapping[str, Module]) -> dict[str, set[str]]:
    """{module: modules that it imports}, faces left out.

    A name that comes through a package's `__init__` or a face leads to the module in which it is written; a face that
    is imported as a whole, as by `import cgraph as cg`, to those of the names that are taken of it, as `cg.Graph`.
    """
    return {
        name: {
            target
            for line in module.imports
            if not line.module.startswith(DOORS.get(name, ("-",)))
            for shown, taken in _taken(known, module, line)
            for target in _targets(known, shown, taken)
        }
        - {name}
        for name, module in known.items()
        if not module.is_face
    }


def _taken(known: Mapping[str, Module], importer: Module, line: Import) -> list[tuple[str, str | None]]:
    """What an import brings, (module, name): of a face as a whole, each name that the importer takes of it."""
    whole = line.module if line.name is None else f"{line.module}.{line.name}"
    if whole in known and known[whole].is_face and line.bound in importer.attributes:
        return [(whole, name) for name in sorted(importer.attributes[line.bound])]
    return [(line.module, line.name)]


def _targets(
    known: Mapping[str, Module], module: str, name: str | None, through: frozenset[str] = frozenset()
) -> set[str]:
    """The modules in which what `from module import name` binds is written.  through: faces on the way to here."""
    if name is not None and f"{module}.{name}" in known:
        return _targets(known, f"{module}.{name}", None, through)
    if module not in known or module in through:
        return set()
    at = known[module]
    shown = at.imports if at.is_face or at.is_package else ()
    chosen = [line for line in shown if line.bound == name] or (at.imports if at.is_face else [])
    if not chosen:
        return {module}
    return {target for line in chosen for target in _targets(known, line.module, line.name, through | {module})}
