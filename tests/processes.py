"""Programs in processes of their own."""

import os
import subprocess
import sys
from pathlib import Path

from tests.sources import ROOT


def printed_by(code: str, *arguments: str, folder: Path = ROOT, **environment: str) -> str:
    """What a program prints that a fresh process runs to its end in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        capture_output=True,
        encoding="utf-8",
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    return done.stdout
