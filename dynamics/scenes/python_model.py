"""Models of Python files and modules, by a name such as `arm.py:system` or `package.module:system`."""

import importlib
import inspect
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import TypeGuard, TypeVar

from cgraph._shared import or_nearest

from ..systems.model import Model

SUFFIX = ".py"
NEEDED = "a System, an OdeSystem, a Mechanism, a Scene, or a function without arguments that returns one"
_FILE = re.compile(r"(?P<source>.+\.py)(?::(?P<name>.*))?", re.DOTALL)
_MODULE = re.compile(r"(?P<source>[^\W\d]\w*(?:\.[^\W\d]\w*)*):(?P<name>[^\W\d]\w*)")

Made = TypeVar("Made")


def is_python(name: str) -> bool:
    """Whether a name stands for a model in Python: FILE.py:NAME or MODULE:NAME."""
    return bool(_FILE.fullmatch(name) or _MODULE.fullmatch(name))


def short_name(name: str) -> str:
    """Name of a model in titles and files: `arm.system` for `models/arm.py:system`."""
    source, _, what = name.rpartition(":")
    return f"{Path(source).stem if source.endswith(SUFFIX) else source.rpartition('.')[2]}.{what}"


def python_model(name: str) -> Model:
    """The model of FILE.py:NAME or MODULE:NAME; the file is executed, as Python would.

    What it prints goes to standard error: standard output is for the answer of a command.
    Raises ValueError for a file, a module or a name that is not there, for what is no model, and, with its line and its
    message, for an error that the file raises.
    """
    match = _FILE.fullmatch(name) or _MODULE.fullmatch(name)
    assert match is not None
    source, what = match["source"], match["name"]
    if not what:
        raise ValueError(f"{source!r:.200} is a Python file: name the model in it, as in {source + ':system'!r:.200}")
    of_file = source.endswith(SUFFIX)
    if Path(source).is_dir() and (of_file or not Path(source, "__init__.py").is_file()):
        more = "" if of_file else f", as in {source + '/model.py:system'!r:.200}"
        raise ValueError(f"{source!r:.200} is a folder, and a model is in a file{more}")
    if of_file and not Path(source).is_file():
        raise ValueError(f"there is no file {source!r:.200}")
    folder = Path(source).resolve().parent if of_file else Path.cwd()
    with _first_on_path(folder), redirect_stdout(sys.stderr):
        module = _told(source, lambda: _executed(Path(source)) if of_file else importlib.import_module(source))
        return _model(module, source, what)


def _model(module: ModuleType, source: str, what: str) -> Model:
    known = vars(module)
    if what not in known:
        public = [name for name, value in known.items() if name[0] != "_" and not inspect.ismodule(value)]
        models = [name for name in public if _is_model(known[name])]
        raise ValueError(f"{source!r:.200} has no {what!r:.80}; {or_nearest(what, models or public)}")
    found, called = known[what], f"{source}:{what}"
    if not _is_model(found) and callable(found):
        try:
            inspect.signature(found).bind()
        except TypeError:
            takes = inspect.signature(found)
            raise ValueError(f"{called!r:.200} takes {str(takes)!s:.80}; needed is {NEEDED}") from None
        except ValueError:  # nobody knows what it takes
            pass
        found, called = _told(source, found), f"{called}()"
    if not _is_model(found):
        raise ValueError(f"{called!r:.200} is no model but {type(found).__name__}: {found!r:.60}; needed is {NEEDED}")
    return found


def _is_model(value: object) -> TypeGuard[Model]:
    return not isinstance(value, type) and hasattr(value, "coordinates") and hasattr(value, "velocities")


class _Uncached(SourceFileLoader):
    """A file as it is now: that of a second ago may be taken for it, by its size and time, and bytecode is left."""

    def get_code(self, fullname: str) -> CodeType:
        """The compiled source."""
        return self.source_to_code(self.get_data(self.path), self.path)


def _executed(path: Path) -> ModuleType:
    """The module of a file, executed; it is called as the file, so that no module of a library is in its place."""
    loader = _Uncached(path.name, str(path.resolve()))
    spec = spec_from_file_location(path.name, loader.path, loader=loader)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[path.name] = module  # where dataclasses look for it
    try:
        loader.exec_module(module)
    except BaseException:
        del sys.modules[path.name]
        raise
    return module


def _told(source: str, function: Callable[[], Made]) -> Made:
    """Result of a function of the user's. Raises ValueError, with the line in the source, for an error of its own."""
    try:
        return function()
    except (Exception, SystemExit) as error:
        if isinstance(error, SystemExit) and type(error) is not SystemExit:  # a signal's
            raise
        if isinstance(error, ModuleNotFoundError) and error.name and f"{source}.".startswith(f"{error.name}."):
            raise ValueError(f"there is no module {error.name!r:.200}") from error
        raise ValueError(_where(source, error)) from error


def _where(source: str, error: BaseException) -> str:
    """`arm.py, line 3: ZeroDivisionError: division by zero`: the last line of the file that the error came by."""
    if source.endswith(SUFFIX):
        ends = [str(Path(source).resolve())]
    else:
        ends = [f"{os.sep}{source.replace('.', os.sep)}{end}" for end in (SUFFIX, f"{os.sep}__init__{SUFFIX}")]
    places = [(each.filename, each.lineno) for each in traceback.extract_tb(error.__traceback__)]
    if isinstance(error, SyntaxError):
        places.append((error.filename or "", error.lineno))
    lines = [line for file, line in places if line and file.endswith(tuple(ends))]
    line = f", line {lines[-1]}" if lines else ""
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    return f"{source}{line}: {type(error).__name__}{': ' if message else ''}{message:.500}"


@contextmanager
def _first_on_path(folder: Path) -> Iterator[None]:
    """Look for modules in that folder first, as Python does for a file that it runs."""
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        if str(folder) in sys.path:
            sys.path.remove(str(folder))
