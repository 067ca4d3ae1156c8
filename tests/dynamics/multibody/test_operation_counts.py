"""Operations of robots' equations: no row of the page grows, and published formulas are as they were printed."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from tests.bench.speed.counts import QUANTITIES, ROBOTS, VARIANTS, models, operation_counts, operations
from tests.each_row import each_row
from tests.slow import slow
from viz.paper.mechanisms import turned_arm

ROUNDING = 1e-11  # relative, of accelerations of seven bodies by another order of operations
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


def test_every_row_of_inverse_dynamics_is_below_the_published_one() -> None:
    for name in (*ROBOTS, "general 6", "general 7", "general 30"):
        total, (*_, theirs, by_chain_rule) = ROWS["inverse dynamics", name][0], ROWS["inverse dynamics", name]
        assert total < theirs < by_chain_rule


def accelerations(graph: Any) -> Any:
    x = np.random.default_rng(3).normal(size=len(graph.inputs))
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, x.tolist(), strict=True))).values()))


@each_row("name", VARIANTS)
def test_a_variant_computes_the_same_with_other_nodes(name: str) -> None:
    variant = VARIANTS[name]
    model = dyn.planar_arm([0.9] * 3, [0.7] * 3, damping=0.1) if variant.planar else turned_arm(7)
    base, other = dyn.forward_dynamics(model, "recursive"), variant.graph(model)
    assert accelerations(other) == pytest.approx(accelerations(base), rel=ROUNDING)
    assert (len(other.nodes) > len(base.nodes)) is (name not in ("every idea", "dense"))  # dense is smaller at seven
