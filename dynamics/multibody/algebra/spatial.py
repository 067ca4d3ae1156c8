"""Vectors and rotations of bodies: constants as arrays, moving quantities as triples of nodes.

An array may be one of objects: floats, and nodes where there are parameters. Rotations are floats alone.
"""

import math
from collections.abc import Sequence
from functools import reduce
from itertools import chain, permutations, product as cartesian

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array
from cgraph.extend import as_node

from ...systems.kinematics import ZERO as ZERO, dot as dot  # noqa: PLC0414 (of triples, too)

Triple = tuple[Node, Node, Node]
Matrix = Sequence[Sequence[float | Node]]  # (3, 3)
STILL: Triple = (ZERO, ZERO, ZERO)
UNITS = frozenset((0.0, 1.0, -1.0))  # the entries of quarter turns
_MIRRORED = [np.diag(signs) for signs in cartesian((1.0, -1.0), repeat=3)]
QUARTER_TURNS = {tuple(each[[*rows]].ravel().tolist()) for each in _MIRRORED for rows in permutations(range(3))}
UNTURNED = np.eye(3).tolist()
SNAP = 1e-14  # of length 1: a component of a rotation that is no more comes from a quarter turn, or one in text
SUM_ROUNDING = 2.0**-48  # of the terms of a sum: what is left is their rounding if it is no more


def rotation(axis: Array, angle: float) -> Array:
    """The matrix, (3, 3), that turns by `angle` [rad] about the unit vector `axis` (Rodrigues)."""
    x, y, z = axis.tolist()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return snapped(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))


def unit(vector: Array) -> Array:
    """The vector, which is not zero, at length 1."""
    vector = np.ldexp(vector, -math.frexp(max(map(abs, vector.tolist())))[1])  # else squares of small numbers vanish
    result: Array = vector / math.sqrt(vector @ vector)
    return result


def snapped(columns: Array) -> Array:
    """Columns of length 1, or one, without components that are rounding; 1 where the others leave no other number.

    So a component near 1 stays where the others say that it is the cosine of a small angle.
    """
    known = columns.T.tolist()
    if UNITS.issuperset(known if columns.ndim == 1 else chain(*known)):
        return np.add(columns, 0.0, dtype=np.float64)
    result = np.empty_like(columns, dtype=np.float64)
    result.T[...] = _snapped(known) if columns.ndim == 1 else [_snapped(column) for column in known]
    return result


def _snapped(column: list[float]) -> list[float]:
    kept = [0.0 if abs(x) <= SNAP else x + 0.0 for x in column]
    if not sum([x * x for x in kept if not abs(x) > 0.9]) <= 2.0**-53:  # one component of a column is above, at most
        return kept
    return [math.copysign(1.0, x) if abs(x) > 0.9 else x for x in kept]


def cleaned(array: Array) -> Array:
    """Numbers that another program computed from shapes, without those that are its rounding beside the largest."""
    return np.where(np.abs(array) <= SNAP * np.abs(array).max(), 0.0, array) + 0.0


def without_rounding(total: Array, terms: Array) -> Array:
    """The sums, with those that are the rounding of their terms set to zero.  terms: the sum of their absolute values.

    Entry by entry: one that is small beside other entries has a meaning of its own. Nodes stay.
    """
    if total.dtype == object:
        pairs = zip(map(plain, total.flat), terms.flat, strict=True)
        result = np.empty(total.size, dtype=object)
        result[:] = [x if isinstance(x, Node) else 0.0 if abs(x) <= SUM_ROUNDING * size else x for x, size in pairs]
        return result.reshape(total.shape)
    return np.where(np.abs(total) <= SUM_ROUNDING * terms, 0.0, total) + 0.0


def plain(value: float | Node) -> float | Node:
    """The number of a constant, else the node."""
    if isinstance(value, Node):
        return value if value.value is None else value.value
    return float(value)


def _sizes(array: Array) -> Array:
    """Absolute values, 0 for nodes."""
    if array.dtype != object:
        return np.abs(array)
    sizes: Array = np.frompyfunc(lambda each: 0.0 if isinstance(each, Node) else abs(each), 1, 1)(array).astype(float)
    return sizes


def added(a: Array, b: Array) -> Array:
    """a + b, where they cancel zero."""
    if a.dtype == object or b.dtype == object:
        return without_rounding(a + b, _sizes(a) + _sizes(b))
    pairs = zip(a.ravel().tolist(), b.ravel().tolist(), strict=True)
    sums = [0.0 if abs(total := x + y) <= SUM_ROUNDING * (abs(x) + abs(y)) else total for x, y in pairs]
    return np.array(sums, dtype=np.float64).reshape(a.shape)


def product(*factors: Array) -> Array:
    """The matrix product, with entries whose terms cancel zero."""
    if not any([each.dtype == object for each in factors]):
        turned = [each for each in factors if each.tolist() != UNTURNED] or factors[:1]
        if sum([tuple(each.ravel().tolist()) not in QUARTER_TURNS for each in turned[len(turned) == 1 :]]) <= 1:
            return np.add(reduce(np.matmul, turned), 0.0, order="C")  # type: ignore[no-any-return]
    return without_rounding(reduce(np.matmul, factors), reduce(np.matmul, [_sizes(each) for each in factors]))


def placed(position: Array, orientation: Array, at: ArrayLike) -> Array:
    """A point of a frame in the axes that the frame is placed in, with components whose terms cancel zero."""
    at = np.asarray(at)
    terms = _sizes(position) + np.abs(orientation) @ _sizes(at)
    return without_rounding(position + orientation @ at, terms)


def from_quaternion(quaternion: ArrayLike) -> Array:
    """The rotation matrix of a quaternion (w, x, y, z), normalized here."""
    w, x, y, z = np.asarray(quaternion, dtype=np.float64) / np.linalg.norm(np.asarray(quaternion))
    return snapped(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
    )


def to_quaternion(matrix: Array) -> Array:
    """The quaternion (w, x, y, z), (4,), of a rotation matrix; of the two, the one whose largest entry is positive."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix
    products = np.array(  # 4 q q^T
        [
            [1 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, 1 + xx - yy - zz, yx + xy, xz + zx],
            [xz - zx, yx + xy, 1 - xx + yy - zz, zy + yz],
            [yx - xy, xz + zx, zy + yz, 1 - xx - yy + zz],
        ]
    )
    row: Array = products[products.diagonal().argmax()]
    return row / np.linalg.norm(row)


def to_z(axis: Array) -> Array:
    """A rotation whose third column is the unit vector `axis`: the nearest turn of the coordinate axes."""
    a, b, c = known = axis.tolist()
    least = [abs(each) for each in known].index(min(abs(a), abs(b), abs(c)))
    across = np.array([(i == least) - known[least] * each for i, each in enumerate(known)])
    x, y, z = (across / math.sqrt(across @ across)).tolist() if known[least] else across.tolist()
    return snapped(np.array([[x, b * z - c * y, a], [y, c * x - a * z, b], [z, a * y - b * x, c]]))


def parallel_axis(inertia: Array, mass: float | Node, offset: Array) -> Array:
    """Inertia about a point `offset` away from the center of mass (parallel axes)."""
    x, y, z = offset.tolist()
    if type(mass) is float and inertia.dtype == offset.dtype != object and x == y == z == 0.0:
        return inertia + 0.0
    return added(inertia, mass * np.array([[y * y + z * z, -x * y, -x * z],
                                           [-x * y, x * x + z * z, -y * z],
                                           [-x * z, -y * z, x * x + y * y]]))  # fmt: skip


def cross(a: Triple, b: Triple) -> Triple:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def plus(a: Triple, b: Triple) -> Triple:
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def scaled(factor: float | Node, vector: Triple) -> Triple:
    """Multiple."""
    x, y, z = (factor * each for each in vector)
    return x, y, z


def constant(vector: Array) -> Triple:
    """A constant vector as nodes."""
    x, y, z = (as_node(each) for each in vector.tolist())
    return x, y, z


def rotate_transpose(matrix: Matrix, vector: Triple) -> Triple:
    """matrix^T vector: what a parent's vector is in a child's axes, the columns of `matrix`."""
    return rotate([*zip(*matrix, strict=True)], vector)


def rotate(matrix: Matrix, vector: Triple) -> Triple:
    """matrix vector: what a child's vector is in its parent's axes."""
    x, y, z = (sum([row[i] * vector[i] for i in range(3)], ZERO) for row in matrix)
    return x, y, z


def combined(columns: Sequence[Triple], vector: Triple) -> Triple:
    """The vector whose components are along these columns."""
    x, y, z = (scaled(factor, column) for factor, column in zip(vector, columns, strict=True))
    return plus(plus(x, y), z)
