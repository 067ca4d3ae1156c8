"""Identities: what is constant, zero or shorter by them is so in the graph, with the tags of what it came from."""

import math
from collections.abc import Callable

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import shortened
from cgraph.extend import topological
from tests.each_row import each_row

X, Y, A = cg.variables("x y a")
ZEROS: dict[str, Node] = {
    "sin^2 + cos^2": cg.sin(X) ** 2 + cg.cos(X) ** 2 - 1.0,
    "cosh^2 - sinh^2": cg.cosh(X) ** 2 - cg.sinh(X) ** 2 - 1.0,
    "square of a root": cg.sqrt(X * X + Y * Y) ** 2 - X * X - Y * Y,
    "cosine of a sum": cg.cos(X + Y) - cg.cos(X) * cg.cos(Y) + cg.sin(X) * cg.sin(Y),
    "sine of a difference": cg.sin(X - Y) - cg.sin(X) * cg.cos(Y) + cg.cos(X) * cg.sin(Y),
    "twice an angle": cg.cos(2.0 * X) - cg.cos(X) ** 2 + cg.sin(X) ** 2,
    "half an angle, seen later": cg.cos(X) + 2.0 * cg.sin(0.5 * X) ** 2 - 1.0,
    "three times an angle": cg.sin(3.0 * X) + 4.0 * cg.sin(X) ** 3 - 3.0 * cg.sin(X),
    "a function of equal sums": cg.exp(cg.sin(X) ** 2) - cg.exp(1.0 - cg.cos(X) ** 2),
    "quotient": cg.sin(X) ** 2 / Y + cg.cos(X) ** 2 / Y - 1.0 / Y,
    "quotient of multiples": (X + Y) / (2.0 * X + 2.0 * Y) - 0.5,
    "negative power": (cg.sin(X) * Y) ** -2 * cg.sin(X) ** 2 * Y**3 - Y,
}
SHORTER: dict[str, tuple[Node, int]] = {  # expression: nodes that are enough
    "addition theorem": (cg.cos(X) * cg.cos(X + Y) + cg.sin(X) * cg.sin(X + Y), 2),
    "common factor": (A * X * cg.cos(Y) ** 2 + A * X * cg.sin(Y) ** 2 + A * Y, 5),
    "cosine of a difference": (A * cg.cos(X) * cg.cos(Y) + A * cg.sin(X) * cg.sin(Y) + 0.0 * cg.cos(X - Y), 6),
    "common divisor": (X / Y + A / Y, 5),
    "cosine squared": (3.0 - 3.0 * cg.cos(X) ** 2, 5),
}


@each_row("name", ZEROS)
def test_what_is_zero_by_an_identity_is_the_number(name: str) -> None:
    assert shortened([ZEROS[name]])[0].value == 0.0


@each_row("name", SHORTER)
def test_what_is_shorter_is_taken_and_has_the_same_values(name: str) -> None:
    node, most = SHORTER[name]
    (new,) = shortened([node])
    assert len(topological([new])) <= most
    at = {"x": 0.7, "y": -1.9, "a": 1.3}
    values = [cg.Graph([X, Y, A], {"f": each}).evaluate(at)["f"] for each in (node, new)]
    assert math.isclose(*values, rel_tol=1e-14)


@each_row("seed", range(20))
def test_random_polynomials_in_sines_keep_their_values(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = [X, Y, X + Y, X - Y, 2.0 * X, 0.5 * Y + 0.3]
    functions: list[Callable[[Node], Node]] = [cg.sin, cg.cos]
    terms = [
        float(rng.normal()) * A ** int(rng.integers(3)) * math.prod(
            [functions[rng.integers(2)](angles[rng.integers(len(angles))]) for _ in range(rng.integers(1, 4))],
            start=cg.constant(1.0),
        )
        for _ in range(6)
    ]  # fmt: skip
    node = sum(terms[1:], terms[0])
    (new,) = shortened([node])
    at = {name: rng.normal(size=10) for name in "xya"}
    old_values, new_values = (cg.Graph([X, Y, A], {"f": each}).evaluate(at)["f"] for each in (node, new))
    np.testing.assert_allclose(new_values, old_values, rtol=0.0, atol=1e-13)


def test_differences_that_keep_their_digits_stay() -> None:
    height = X * (1.0 - cg.cos(Y))
    assert shortened([height]) == [height]


def test_tags_stay() -> None:
    with cg.tag("link"):
        square = A * cg.sin(X) ** 2 + A * cg.cos(X) ** 2
    (new,) = shortened([Y * square])
    assert len(topological([new])) == 3
    assert "link" in new.tags
