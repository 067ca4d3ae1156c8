"""What a command prints, with its exit status checked, and a file of models that stand where scenes do."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from viz import cli

OWN = """import cgraph as cg
import dynamics as dyn

def lagrangian(q, qd, t):
    return 0.5 * qd[0] ** 2 + qd[1] ** 2 + cg.cos(q[0] - q[1]) + cg.cos(q[0])

print("made")
system = dyn.System(lagrangian, "hip knee")
slow = dyn.OdeSystem(lambda x, t: [-x[0]], ["decay"])
atwood = dyn.System(lambda q, qd, t, p: p["m"] * qd[0] ** 2 + p["w"] * q[0], ["x"], {"m": 1.5, "w": 9.81})
ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["y"])
free = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"])
planet = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2) + 1.0 / q[0], "r phi")
runaway = dyn.System(lambda q, qd, t: qd[0] ** 2 / 2 + q[0] ** 4, "x")
belt = dyn.System(lambda q, qd, t: qd[0] ** 2 / 2, "x", forces=lambda q, qd, t: [-2.0 * cg.sign(qd[0] - 0.5)])
ring = dyn.System(lambda q, qd, t: qd[0] ** 2 + qd[1] ** 2, "x y", constraints=lambda q, t: {"ring": q[0] * q[1] - 1.0})
named = dyn.System(lambda q, qd, t, p: p["p0"] * qd[0] ** 2, ["x"], {"p0": 1.0})
away = dyn.System(lambda q, qd, t: qd[0] ** 2 + cg.log(q[0]) * qd[0] ** 2, "x")
body = dyn.Body("box", dyn.Joint("free"), mass=1.0, inertia=(0.1, 0.2, 0.3), center=(0.1, 0.0, 0.0))
flying = dyn.Mechanism([body])
late = dyn.Scene("late", "it ends at infinity", runaway, (1.0,), (0.0,), 9.0)
"""


@pytest.fixture
def own(here: Path) -> Path:
    (here / "own.py").write_text(OWN)
    return here


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    def run(*arguments: str, status: int = 0) -> str:
        assert cli.main(arguments) == status
        return capsys.readouterr().out

    return run


@pytest.fixture
def figures(said: Callable[..., str]) -> Callable[..., dict]:
    return lambda *arguments, status=0: json.loads(said(*arguments, "--json", status=status))
