"""Real: numbers and arrays of them as callers give them, checked."""

from __future__ import annotations

import numbers
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
_KINDS = {"c": "complex numbers", "U": "text", "S": "text", "M": "dates", "m": "time spans"}


def real_array(what: str, value: Any) -> Array:
    """The value as an array of float64. Raises TypeError, naming `what`, for what NumPy would make numbers of silently.

    That is complex numbers (their imaginary part would go), text, dates, and arrays with masked values.
    Raises ValueError for rows of different lengths.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if np.ma.is_masked(value):
        raise TypeError(f"{what} must be real numbers, got an array with masked values")
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{what} must be an array of real numbers, got rows of different lengths") from None
    if array.dtype.kind == "O":
        bad = next((each for each in array.ravel() if not isinstance(each, numbers.Real)), None)
        if bad is not None or None in array.ravel().tolist():
            raise TypeError(f"{what} must be real numbers, got {type(bad).__name__}: {bad!r:.60}")
    elif array.dtype.kind not in "biuf":
        raise TypeError(f"{what} must be real numbers, got {_KINDS.get(array.dtype.kind, str(array.dtype))}")
    return array.astype(np.float64)


def real_number(what: str, value: Any) -> float:
    """The value as a float. Raises TypeError, naming `what`, for anything but a real number."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{what} must be a number, got {type(value).__name__}: {value!r:.60}")
    return float(value)
