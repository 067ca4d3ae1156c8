"""Exponents: the slope of a power law through measured points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def exponent(x: Sequence[float], y: Sequence[float]) -> float:
    """The p of the least-squares fit y = c x^p on logarithms; x and y positive."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
