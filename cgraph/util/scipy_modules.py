"""SciPy's modules, asked for where they are used: the one place that imports them."""

from __future__ import annotations

from types import ModuleType

from .extras import install


def scipy_sparse(what: str) -> ModuleType:
    """The module `scipy.sparse`. Raises ImportError, saying that `what` needs SciPy, where there is none."""
    try:
        from scipy import sparse
    except ImportError:
        raise ImportError(f"{what} needs SciPy: {install('scipy')}") from None
    found: ModuleType = sparse  # it has no types for everybody
    return found


def scipy_integrate(what: str) -> ModuleType:
    """The module `scipy.integrate`. Raises ImportError, saying that `what` needs SciPy, where there is none.

    >>> from cgraph.extend import scipy_integrate
    >>> scipy_integrate("method 'scipy:BDF'").__name__
    'scipy.integrate'
    """
    try:
        from scipy import integrate
    except ImportError:
        raise ImportError(f"{what} needs SciPy: {install('scipy')}") from None
    found: ModuleType = integrate  # it has no types for everybody
    return found
