"""Operations of robots' equations: no row of the page grows, and published formulas are as they were printed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import dynamics as dyn
from tests.bench.speed.counts import (
    QUANTITIES,
    ROBOTS,
    models,
    operation_counts,
    operations,
    published_forward,
    published_inverse,
    published_mass_matrix,
    robot,
)
from tests.each_row import each_row
from tests.slow import slow

PAGE = Path(__file__).parents[3] / "docs/operations.md"
MODELS = models()
SMALL = 7  # links of what is counted in every run


def rows() -> Iterator[tuple[str, str, list[int]]]:
    """Quantity, model and numbers of the page, row by row."""
    tables = PAGE.read_text().split("```text\n")[1].split("```")[0].strip().split("\n\n")
    for block in tables:
        head, *lines = block.splitlines()
        what = next(name for name in QUANTITIES if head.startswith(name))
        for line in lines:
            name = next(name for name in MODELS if line.startswith(f"{name} "))
            yield what, name, [int(number) for number in line.removeprefix(name).split()]


ROWS = {(what, name): numbers for what, name, numbers in rows()}


@each_row(
    ("what", "name"),
    [each for each in ROWS if len(MODELS[each[1]].moving) <= SMALL]
    + slow(*[each for each in ROWS if len(MODELS[each[1]].moving) > SMALL]),
)
def test_no_row_of_the_page_grows(what: str, name: str) -> None:
    equations, _ = QUANTITIES[what]
    own, base = (operations(equations(each)) for each in (MODELS[name], replace(MODELS[name], base_parameters=True)))
    said, products, sums, divisions, turns, depth, of_base, *_ = ROWS[what, name]
    assert own.total <= said == products + sums + divisions
    assert base.total <= of_base
    assert own.turns <= turns
    assert own.depth <= depth


def test_the_page_has_every_row() -> None:
    assert set(ROWS) == {(what, name) for what in QUANTITIES for name in MODELS}
    printed = [str(each).splitlines()[-1].split() for each in operation_counts(3) if each]
    assert [line[:2] for line in printed] == [["planar", "3"]] * len(QUANTITIES)
    for what, (_, _, *numbers) in zip(QUANTITIES, printed, strict=True):
        assert all(int(now) <= said for now, said in zip(numbers, ROWS[what, "planar 3"], strict=True))


def test_published_formulas_give_the_numbers_that_are_printed() -> None:
    assert [published_inverse(n) for n in (6, 7, 30)] == [836, 1010, 5012]
    assert [published_mass_matrix(n) for n in (6, 7, 18)] == [855, 1122, 6171]
    assert [published_forward(n) for n in (6, 7, 12, 18)] == [1842, 2356, 4641, 7215]


def test_every_row_of_inverse_dynamics_is_below_the_published_one() -> None:
    for name in (*ROBOTS, "general 6", "general 7", "general 30"):
        total, (*_, theirs, by_chain_rule) = ROWS["inverse dynamics", name][0], ROWS["inverse dynamics", name]
        assert total < theirs < by_chain_rule


def test_a_robot_stands_as_its_rows_say() -> None:
    """At q = 0, links one on another: the sum of rotations and offsets, of the Stanford arm by hand."""
    arm = robot(ROBOTS["Stanford arm"])
    assert [body.joint.kind for body in arm.bodies] == ["revolute"] * 2 + ["prismatic"] + ["revolute"] * 3
    at = dict.fromkeys(arm.position("link 3").input_names, 0.0) | {"q2": 0.5}
    place = list(arm.position("link 3").evaluate(at).values())
    assert np.allclose(place, [0.0, 0.1524, 0.5], rtol=0.0, atol=1e-15)
    assert len(dyn.inverse_dynamics(arm).outputs) == 6
