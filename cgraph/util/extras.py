"""The extras of the distribution: what errors about missing packages say, and SciPy, which is imported here alone."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def install(extra: str) -> str:
    """Command that installs the packages of an extra, such as "viz", as the end of an error's sentence.

    The argument of the command is quoted, since some shells expand brackets.
    """
    return f"in a checkout of cgraph, pip install -e '.[{extra}]'"


def scipy_module(name: str, what: str) -> ModuleType:
    """SciPy's module `integrate` or `sparse`. Raises ImportError, that `what` needs it, where there is none."""
    return required(f"scipy.{name}", f"{what} needs SciPy", "scipy")


def required(module: str, needs: str, extra: str) -> ModuleType:
    """A package's module. Raises ImportError, that something needs it and the extra has it, where there is none."""
    try:
        return import_module(module)
    except ImportError as error:
        raise ImportError(f"{needs}: {install(extra)}") from error
