"""Colorings: every entry can be read from a product, and the colors are few."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from cgraph.autodiff import coloring
from cgraph.autodiff.coloring import NONE, jacobian_coloring, star_coloring
from cgraph.autodiff.sparsity import Pattern, symmetric

LANES = 8


def pattern(matrix):
    return Pattern(*np.nonzero(matrix), np.shape(matrix))


def random_matrix(seed, m, n, density, dense_rows, dense_columns):
    rng = np.random.default_rng(seed)
    matrix = rng.random((m, n)) < density
    matrix[rng.integers(0, m, dense_rows)] = True
    matrix[:, rng.integers(0, n, dense_columns)] = True
    return matrix


MATRICES = st.builds(
    random_matrix, st.integers(0, 999), st.integers(1, 30), st.integers(1, 30), st.sampled_from((0.0, 0.05, 0.2, 0.7)),
    st.integers(0, 2), st.integers(0, 2)
)  # fmt: skip


@given(MATRICES)
def test_products_with_sums_of_columns_and_of_rows_give_every_entry(matrix):
    """Numbers in place of the entries come back, though none but the entry itself may enter its sum."""
    entries = pattern(matrix)
    coloring = jacobian_coloring(entries, LANES)
    values = np.where(matrix, np.random.default_rng(0).random(matrix.shape), 0.0)
    columns = np.array([np.equal(coloring.columns, c) for c in range(coloring.counts[0])]).T
    rows = np.array([np.equal(coloring.rows, c) for c in range(coloring.counts[1])])
    for i, j, by_row in zip(entries.rows, entries.columns, coloring.by_row, strict=True):
        if by_row:
            assert coloring.rows[i] != NONE
            assert rows[coloring.rows[i]] @ values[:, j] == values[i, j]
        else:
            assert coloring.columns[j] != NONE
            assert values[i] @ columns[:, coloring.columns[j]] == values[i, j]


@given(MATRICES)
def test_a_star_coloring_gives_every_entry_of_a_symmetric_matrix_or_its_mirror_image(matrix):
    matrix = matrix[:, : len(matrix)]
    matrix = matrix[: matrix.shape[1]]
    matrix = matrix | matrix.T
    colors = np.array(star_coloring(pattern(matrix)))
    for i, j in zip(*np.nonzero(matrix), strict=True):
        in_row, in_column = np.sum(colors[matrix[i]] == colors[j]), np.sum(colors[matrix[j]] == colors[i])
        assert in_row == 1 or in_column == 1


def band(n, width):
    return np.abs(np.subtract.outer(np.arange(n), np.arange(n))) <= width


def arrow(n, at):
    matrix = np.eye(n, dtype=bool)
    matrix[at] = matrix[:, at] = True
    return matrix


def binary_tree(n, *, ancestors):
    """Bodies and their parents, or all their ancestors, as in a mass matrix."""
    matrix = np.eye(n, dtype=bool)
    for i in range(1, n):
        parents = [(i - 1) // 2]
        while ancestors and parents[-1]:
            parents.append((parents[-1] - 1) // 2)
        matrix[i, parents] = matrix[parents, i] = True
    return matrix


def grid(n):
    line, one = band(n, 1), np.eye(n, dtype=bool)
    return np.kron(line, one) | np.kron(one, line)


# At most so many directions, (a Jacobian's, a Hessian's): what CasADi 3.7 needs for columns or rows, and for a star.
CASES = {
    "band of 3": (band(1000, 1), 3, 3),
    "band of 5": (band(1000, 2), 5, 5),
    "arrow": (arrow(1000, 0), 3, 2),  # 1000 there: columns or rows, never both
    "arrow, turned": (arrow(1000, -1), 3, 2),
    "tree": (binary_tree(255, ancestors=False), 4, 3),
    "mass matrix of a tree": (binary_tree(255, ancestors=True), 255, 8),
    "grid": (grid(20), 7, 6),
    "full": (np.ones((60, 60), dtype=bool), 60, 60),
    "gradient": (np.ones((1, 1000), dtype=bool), 1, None),
    "rows below": (np.vstack([np.ones((2, 500), dtype=bool), np.eye(500, dtype=bool)]), 3, None),
}


@pytest.mark.parametrize("name", CASES)
def test_the_colors_are_few(name):
    matrix, directions, star = CASES[name]
    coloring = jacobian_coloring(pattern(matrix), LANES)
    assert sum(coloring.counts) <= directions
    if star is not None:
        assert 1 + max(star_coloring(pattern(matrix))) <= star


def test_nothing_needs_no_directions():
    for shape in ((0, 0), (3, 0), (0, 3), (3, 4)):
        assert jacobian_coloring(pattern(np.zeros(shape, dtype=bool)), LANES).counts == (0, 0)
    assert star_coloring(pattern(np.zeros((3, 3), dtype=bool))) == [0, 0, 0]


def test_a_full_matrix_is_not_searched(monkeypatch):
    """What would take n^2 steps of Python for each of two orders."""
    monkeypatch.setattr(coloring, "_star", None)
    entries = pattern(np.ones((4, 4), dtype=bool))
    assert star_coloring(entries) == [0, 1, 2, 3]
    assert symmetric(entries) is entries
