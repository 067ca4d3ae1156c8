"""Real numbers, and arrays of them, from what callers pass: checked. what: the value, for the error's sentence."""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np

from .evaluation import Array

_KINDS = {"c": "complex numbers", "U": "text", "S": "text", "M": "dates", "m": "time spans"}


def real_array(what: str, value: object) -> Array:
    """The value as an array of float64, itself if it is one, but not from what NumPy would silently make numbers of.

    Raises TypeError for complex numbers (their imaginary part would be lost), text, dates and masked values, ValueError
    for rows of different lengths and a number too large for float64.

    >>> from cgraph._shared import real_array
    >>> real_array("q", [1, 2])
    array([1., 2.])
    >>> real_array("q", [1, 2j])
    Traceback (most recent call last):
    TypeError: q must be real numbers, got complex numbers
    """
    value = floats(value)
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if np.ma.is_masked(value) or (isinstance(value, list | tuple) and any([each is np.ma.masked for each in value])):
        raise TypeError(f"{what} must be real numbers, got an array with masked values")
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{what} must be an array of real numbers, got rows of different lengths") from None
    except OverflowError:
        raise ValueError(f"{what} must be real numbers, got one that is too large for float64") from None
    if array.dtype.kind == "O":
        bad = next((item for item in array.ravel() if not isinstance(item, numbers.Real)), None)
        if bad is not None or None in array.ravel().tolist():
            raise TypeError(f"{what} must be real numbers, got {type(bad).__name__}: {bad!r:.60}")
    elif array.dtype.kind not in "biuf":
        raise TypeError(f"{what} must be real numbers, got {_KINDS.get(array.dtype.kind, str(array.dtype))}")
    try:
        return array.astype(np.float64)
    except OverflowError:
        raise ValueError(f"{what} must be real numbers, got one that is too large for float64") from None


def floats(value: Any) -> Any:
    """A list or tuple of floats as an array, which needs no more checks; any other value as it is."""
    return np.array(value) if type(value) in (list, tuple) and {*map(type, value)} == {float} else value


def real_number(what: str, value: object) -> float:
    """The value as a float. Raises TypeError for what is no real number, ValueError for one too large for float64."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{what} must be a number, got {type(value).__name__}: {value!r:.60}")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{what} must be a number, got one that is too large for float64") from None


def is_finite(value: object) -> bool:
    """Whether a value is a real number that is finite in float64."""
    try:
        return isinstance(value, numbers.Real) and math.isfinite(value)
    except OverflowError:
        return False
