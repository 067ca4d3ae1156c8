"""The extras of the distribution: what errors about missing packages say."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def install(extra: str) -> str:
    """Command that installs the packages of an extra, such as "viz", as the end of an error's sentence.

    The argument of the command is quoted, since some shells expand brackets.
    """
    return f"in a checkout of cgraph, pip install -e '.[{extra}]'"


def required(module: str, needs: str, extra: str) -> ModuleType:
    """A package's module. Raises ImportError, that something needs it and the extra has it, where there is none."""
    try:
        return import_module(module)
    except ImportError as error:
        raise ImportError(f"{needs}: {install(extra)}") from error
