"""Solution of symmetric equations over any numbers, by an LDL^T factorization."""

from collections.abc import Sequence
from typing import Any


def ldl_elimination(lower: Sequence[Sequence[Any]], rhs: Sequence[object]) -> tuple[list[Any], list[Any]]:
    """The solution x of A x = rhs and the pivots of A, over any numbers with + - * /.

    For i = n - 1 .. 0:  g_ij = A_ij / A_ii,  A_jk -= g_ij A_ik,  b_j -= g_ij b_i  (j, k < i);
    for i = 0 .. n - 1:  x_i = b_i / A_ii - sum_j g_ij x_j.  Row i of `lower` has at least i + 1 entries.
    """
    n = len(rhs)
    a = [list(row) for row in lower]
    b = list(rhs)
    gains: list[list[Any]] = [[] for _ in range(n)]
    for i in reversed(range(n)):
        pivot = a[i][i]
        gains[i] = [a[i][j] / pivot for j in range(i)]
        for j in range(i):
            for k in range(j + 1):
                a[j][k] = a[j][k] - gains[i][j] * a[i][k]
            b[j] = b[j] - gains[i][j] * b[i]
    x: list[Any] = []
    for i in range(n):
        total = b[i] / a[i][i]
        for gain, known in zip(gains[i], x, strict=True):
            total = total - gain * known
        x.append(total)
    return x, [a[i][i] for i in range(n)]
