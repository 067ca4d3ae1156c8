"""Runs with default arguments are right, or say that they are not; the kept answers are what `reference` computes."""

import pytest
from pytest import mark

from tests.trust.random_motions import EACH, FAMILIES, LAGRANGIANS, STARTS, random_motion, random_task
from tests.trust.trust import ADAPTIVE, COUNT, RIGHT, SAID, SILENT, answer, compute, judge

QUICK = 8  # of the random Lagrangians: one of each family; of the random starts, too
SPREAD = 1e-2  # relative: growth is measured by differences


@mark.parametrize("number", [*range(QUICK), *range(LAGRANGIANS, LAGRANGIANS + len(STARTS))])
def test_a_default_run_is_right_or_says_that_it_is_not(number: int) -> None:
    verdict = judge(number, "radau" if random_motion(number).stiff else None)
    assert verdict.verdict in (RIGHT, SAID), verdict


@mark.slow
@mark.timeout(600)
@mark.parametrize("number", [1, 4, 6, 7, 200, 201, 202])
def test_kept_answers_are_computed_again(number: int) -> None:
    pytest.importorskip("scipy")
    kept, again = answer(number), compute(random_motion(number))
    assert (kept.end is None) == (again.end is None)
    if kept.end is not None:
        assert again.end is not None
        assert kept.end.x == pytest.approx(again.end.x, rel=1e-14)  # constants of a graph are rounded as it is built
        assert kept.growth == pytest.approx(again.growth, rel=SPREAD)


def test_the_same_number_is_the_same_system() -> None:
    names = [random_task(number).name for number in range(2 * len(FAMILIES))]
    assert len(set(names)) == len(names)
    first, second = random_task(11), random_task(11)
    assert (first.start, first.t_end) == (second.start, second.t_end)
    assert first.system.lagrangian.op is second.system.lagrangian.op


@mark.slow
@mark.timeout(3600)
@mark.parametrize("method", [None, *ADAPTIVE])
def test_no_run_is_wrong_in_silence(method: str | None) -> None:
    silent = [verdict for number in range(COUNT) if (verdict := judge(number, method)).verdict == SILENT]
    assert silent == []


@mark.slow
@mark.timeout(3600)
@mark.parametrize("method", [None, *ADAPTIVE])
def test_no_run_from_rest_past_jumps_or_of_a_chain_stops(method: str | None) -> None:
    judged = [judge(number, method) for number in range(LAGRANGIANS, COUNT)]
    refused = [each for each in judged if each.words.startswith("method 'taylor' needs equations that are smooth")]
    assert [each for each in judged if each.verdict != RIGHT and each not in refused] == []
    assert len(refused) == (EACH if method == "taylor" else 0)
