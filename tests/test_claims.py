"""The page of claims: each quick command prints what the page says, to the tolerance that it says."""

import math
import re
import shlex

import pytest

from tests.bench.__main__ import parser
from tests.test_docs import PAGES
from viz import cli
from viz.commands.command import parse

NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
ROWS = [line.strip("| ").split(" | ") for line in PAGES["docs/claims.md"].splitlines() if line.count(" | ") == 3]
QUICK = [(row[1].strip("`"), row[2].strip("`"), row[3]) for row in ROWS if row[2][0] == "`" and row[3] != "1 minute"]
COMMANDS = list(dict.fromkeys(command for command, _, _ in QUICK))


def holds(within: str, seen: float, claimed: float) -> bool:
    """Whether a number is as the page says."""
    if bound := re.fullmatch(rf"at (most|least) ({NUMBER})", within):
        return seen <= float(bound[2]) if bound[1] == "most" else seen >= float(bound[2])
    if share := re.fullmatch(r"(\d+) %", within):
        return math.isclose(seen, claimed, rel_tol=int(share[1]) / 100)
    assert within == "exact"
    return seen == claimed


def shown(text: str, claim: str, within: str) -> bool:
    """Whether a text has the words of a claim, with numbers that are near enough."""
    words = [re.escape(part) for part in re.split(NUMBER, claim)]
    claimed = [float(each) for each in re.findall(NUMBER, claim)]
    found = re.finditer(r"(?<![\d.])" + f"({NUMBER})".join(words), text)
    return any(
        all(holds(within, float(seen), number) for seen, number in zip(each.groups(), claimed, strict=True))
        for each in found
    )


def test_a_claim_is_found_to_its_tolerance_and_no_further() -> None:
    text = "a.txt: 97 nodes, 146 edges; error 3e-16"
    assert shown(text, "97 nodes, 146 edges", "exact")
    assert not shown(text, "97 nodes, 147 edges", "exact")
    assert shown(text, "error 1e-17", "at most 1e-15")
    assert not shown(text, "error 1e-17", "at most 1e-16")
    assert shown(text, "100 nodes", "5 %")
    assert not shown(text, "100 nodes", "1 %")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_shows_what_is_claimed_of_it(command, here, capsys) -> None:
    if "certify" in command:
        pytest.importorskip("mujoco")
    assert cli.main(shlex.split(command)) in (cli.SUCCESS, cli.FINDING)
    text = " ".join(capsys.readouterr().out.split())
    claims = [(claim, within) for each, claim, within in QUICK if each == command]
    assert [claim for claim, within in claims if not shown(text, claim, within)] == [], text


def test_commands_that_take_minutes_are_commands() -> None:
    assert len(QUICK) > 12
    slow = [row[1].strip("`") for row in ROWS[1:] if row[1].strip("`") not in COMMANDS and row[1][0] == "`"]
    assert len(slow) > 5
    for command in slow:
        words = shlex.split(command)
        if words[:2] == ["make", "bench"]:
            assert parser().parse_intermixed_args(shlex.split(words[2].removeprefix("ARGS="))).what
        else:
            assert parse(words).run
