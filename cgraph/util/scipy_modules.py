"""SciPy's modules, asked for where they are used: the one place that imports them."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from .extras import install
from .require import require_choice


def scipy_module(name: str, what: str) -> ModuleType:
    """SciPy's module `integrate` or `sparse`. Raises ImportError, saying that `what` needs SciPy, where there is none.

    >>> from cgraph.extend import scipy_module
    >>> scipy_module("integrate", "method 'scipy:BDF'").__name__
    'scipy.integrate'
    """
    require_choice("name", name, ("integrate", "sparse"))
    try:
        return import_module(f"scipy.{name}")
    except ImportError:
        raise ImportError(f"{what} needs SciPy: {install('scipy')}") from None
