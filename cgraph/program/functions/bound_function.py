"""BoundFunction: y = f(x) through arrays that are bound once."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...util.words import listed

Bind = Callable[[Array, Array], Callable[[], None]]  # x, y -> a function of nothing
_Buffers = tuple[Any, Array, memoryview, Callable[[], None]]  # memory of x; y, as an array and as memory; the call


class BoundFunction:
    """A function of n_in numbers that gives an array of some shape; any number of threads may call it at once.

    What `bind` gives may leave numbers of y as they are, zeros.
    """

    def __init__(self, bind: Bind, n_in: int, shape: tuple[int, ...], names: Sequence[str] = ()) -> None:
        """names: of the inputs, for errors."""
        self._bind, self._sizes, self._names = bind, (n_in, shape), names
        self._free: list[_Buffers] = []  # pop and append are atomic: no lock, and a call inside a call is safe
        self._pack, self._unpack = Struct(f"{n_in}d").pack_into, Struct(f"{math.prod(shape)}d").unpack_from

    def __call__(self, x: ArrayLike) -> Array:
        """The outputs at one point, through buffers that a call at a time has for itself."""
        buffers = self._take()
        x_memory, y, _, run = buffers
        point = x if type(x) is np.ndarray else self._point(x)
        try:
            x_memory[:] = point  # compares shape and type, and copies: quicker than to look at them first
        except ValueError:
            x_memory[:] = self._point(point).copy()
        run()
        result = y.copy()
        self._free.append(buffers)
        return result

    def values(self, x: list[float]) -> tuple[float, ...]:
        """The outputs as floats at a list of floats."""
        buffers = self._take()
        x_memory, _, y_memory, run = buffers
        self._pack(x_memory, 0, *x)
        run()
        result = self._unpack(y_memory)
        self._free.append(buffers)
        return result

    def _take(self) -> _Buffers:
        """Buffers of one call at a time: its point, its result."""
        try:
            return self._free.pop()
        except IndexError:
            x, y = np.empty(self._sizes[0]), np.zeros(self._sizes[1])
            return x.data, y, y.data, self._bind(x, y)

    def _point(self, x: ArrayLike) -> Array:
        point, n_in = real_array("x", x), self._sizes[0]
        if point.shape != (n_in,):
            these = f" ({listed(self._names)})" if self._names else ""
            raise GraphError(f"x must have shape ({n_in},), one value for each input{these}, got {point.shape}")
        return point
