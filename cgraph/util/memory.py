"""Arrays that machine code uses as they lie: checked."""

import numpy as np

from ..core.checks import GraphError
from ..core.evaluation import Array


def require_memory(name: str, array: object, *shapes: tuple[int, ...]) -> None:
    """Raise GraphError unless machine code can use the array as it lies."""
    array = _require_shape(name, array, *shapes)
    if not array.flags.c_contiguous or not array.flags.aligned:
        raise GraphError(f"{name} must be contiguous and aligned, got strides {array.strides}")


def require_target(name: str, target: Array, of: str, read: Array) -> None:
    """Raise GraphError unless an array can be written while another one is read."""
    if not target.flags.writeable:
        raise GraphError(f"{name} must be an array that can be written, got one that is read-only")
    if np.may_share_memory(target, read):
        raise GraphError(f"{of} and {name} must not share memory")


def require_out(out: Array, shape: tuple[int, int], points: Array) -> None:
    """Raise GraphError unless results of that shape can be written there while the points are read."""
    require_target("out", _require_shape("out", out, shape), "X", points)


def _require_shape(name: str, array: object, *shapes: tuple[int, ...]) -> Array:
    """The value, if it is an array of float64 of one of these shapes."""
    if isinstance(array, np.ndarray) and array.dtype == np.float64 and array.shape in shapes:
        return array
    wanted = " or ".join(map(str, shapes))
    got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
    raise GraphError(f"{name} must be an array of float64 in shape {wanted}, got {got}")


def lies_in_rows(points: Array) -> bool:
    """Whether points, (n, N), lie in memory one after another, n numbers each."""
    return points.flags.f_contiguous and not points.flags.c_contiguous


def aligned(size: int) -> Array:
    """An array that begins where a line of the cache does: a vector then lies in one."""
    memory = np.empty(size + 7)
    start = -(memory.ctypes.data // 8) % 8
    return memory[start : start + size]
