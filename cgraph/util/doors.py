"""The names of a package that are loaded when they are first asked for (PEP 562), and methods that became functions."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Collection
from importlib import import_module

Homes = dict[str, tuple[str, str | None]]  # {name: (module that has it, its name there; None for the module itself)}


def doors(
    package: str,
    file: str,
    otherwise: Callable[[str], object] | None = None,
    *,
    first: str = "",
    explained: Collection[str] = (),
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """The `__getattr__` and `__dir__` of a module whose names are written elsewhere, by its `__name__` and `__file__`.

    The imports of the file under `if TYPE_CHECKING:`, which type checkers read, say where each name is written. A
    module is imported when one of its names is first asked for, and the name then stays in the package. `__all__` is
    the list of these names.

    otherwise: what gives a name that no import brings, or raises AttributeError.  first: a module that is imported
    before any of those that have the names.  explained: functions of the core whose wrong arguments are told in a
    sentence, see `explain_failure`.

    >>> import cgraph as cg
    >>> "jvp" in dir(cg)
    True
    """
    homes: Homes = {}

    def names() -> Homes:
        if not homes:
            homes.update(_homes(file))
        return homes

    def load(name: str) -> object:
        if name == "__all__":
            return [each for each in sorted(names()) if not each.startswith("_")]
        if name not in names():
            if otherwise is not None and not name.startswith("_"):
                return otherwise(name)
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        place, inner = homes[name]
        if first:
            import_module(first)
        module = import_module(place, getattr(sys.modules[package], "__package__", package))
        if inner is not None and not hasattr(module, inner):  # a module of that package
            import_module(f"{module.__name__}.{inner}")
        value = module if inner is None else getattr(module, inner)
        if name in explained:
            value = import_module("cgraph.util.explain_failure").explain_failure(value)
        setattr(sys.modules[package], name, value)
        return value

    return load, lambda: sorted({*vars(sys.modules[package]), *names()})


def moved_methods(kind: type, package: str, names: Collection[str], alone: Collection[str] = ()) -> None:
    """Keep, with a warning, methods of a class that are functions now.  alone: those that took no object."""

    def moved(name: str) -> Callable[..., object]:
        def call(*args: object, **named: object) -> object:
            text = f"{kind.__name__}.{name} goes with the next version: call {package}.{name}"
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return getattr(sys.modules[package], name)(*args, **named)

        return call

    for name in names:
        setattr(kind, name, staticmethod(moved(name)) if name in alone else moved(name))


def _homes(file: str) -> Homes:
    """Homes of the names that a file imports for type checkers."""
    import ast

    with open(file, encoding="utf-8") as source:  # noqa: PTH123 (pathlib takes longer to load than this file)
        tree = ast.parse(source.read())
    homes: Homes = {}
    for block in tree.body:
        if isinstance(block, ast.If) and isinstance(block.test, ast.Name) and block.test.id == "TYPE_CHECKING":
            for line in block.body:
                assert isinstance(line, ast.ImportFrom)
                above = "." * line.level
                for name in line.names:
                    whole = line.module is None
                    home = (above + name.name, None) if whole else (f"{above}{line.module}", name.name)
                    homes[name.asname or name.name] = home
    return homes
