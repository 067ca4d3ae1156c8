"""Ctrl-C in a command: its status, no file, no verdict."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
import os, signal, sys, threading, time
from viz import cli
def interrupt():
    while signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        time.sleep(0.01)  # until the command awaits it
    time.sleep({seconds})
    os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.argv = ["cgraph", *{arguments}]
threading.Thread(target=interrupt, daemon=True).start()
sys.exit(cli.start())
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
@pytest.mark.parametrize(
    ("command", "seconds"),
    [
        ("inspect chain --out a.html", 0.1),  # while the library loads
        ("simulate triple_pendulum --t-end 1e6 --csv a.csv", 4.0),  # a simulation, which would keep its rows
        ("report --stability --quick", 6.0),
    ],
)
def test_an_interrupted_command_writes_nothing_and_judges_nothing(command: str, seconds: float, tmp_path: Path) -> None:
    program = PROGRAM.format(arguments=command.split(), seconds=seconds)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.splitlines()[-1] == "cgraph: interrupted"
    assert "Traceback" not in done.stderr
    assert not [*tmp_path.iterdir()]
