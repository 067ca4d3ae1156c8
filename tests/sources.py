"""The library's source files: their syntax trees and what they import."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("cgraph", "dynamics", "viz")


@dataclass(frozen=True)
class Source:
    file: str  # from the root of the checkout

    @cached_property
    def text(self) -> str:
        return (ROOT / self.file).read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        return list(ast.walk(self.tree))

    @property
    def module(self) -> str:
        return self.file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    def imports(self, for_types: bool = True) -> Iterator[str]:
        """Absolute names of the modules that it imports, in functions, too; under `if TYPE_CHECKING:`, if asked."""
        typing = {
            id(inner)
            for node in self.nodes
            if isinstance(node, ast.If) and isinstance(node.test, ast.Name | ast.Attribute)
            if ast.unparse(node.test).endswith("TYPE_CHECKING")
            for line in node.body
            for inner in ast.walk(line)
        }
        package = Path(self.file).parent.parts
        for node in self.nodes:
            if id(node) in typing and not for_types:
                continue
            if isinstance(node, ast.Import):
                yield from [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                above = package[: len(package) - node.level + 1] if node.level else ()
                yield ".".join([*above, *([node.module] if node.module else [])])


@cache
def sources() -> dict[str, Source]:
    """{file: its source} of all three packages."""
    files = [path.relative_to(ROOT).as_posix() for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
    return {file: Source(file) for file in files}


def listed_names(page: str) -> list[tuple[str, str]]:
    """(package or module, name) of all names in the `{names}` blocks of a page."""
    blocks = re.findall(r"^```{names} ([\w.]+)\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    return [(module, name) for module, names in blocks for name in names.split()]


def result_types() -> dict[str, type]:
    """{dotted name: type} of what functions return and no public list has: the types of docs/reference/results.md."""
    page = (ROOT / "docs" / "reference" / "results.md").read_text(encoding="utf-8")
    return {f"{module}.{name}": getattr(import_module(module), name) for module, name in listed_names(page)}
