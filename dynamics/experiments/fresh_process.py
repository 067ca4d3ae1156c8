"""A fresh process: a function of the library run where nothing is loaded, compiled or kept yet."""

from __future__ import annotations

import os
import subprocess
import sys


def run_fresh(module: str, call: str, text: str = "", timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    """What the call, of a name of that module, wrote to its standard output and error. `text` is its standard input.

    Raises subprocess.TimeoutExpired after `timeout` s.
    """
    command = [sys.executable, "-c", f"from {module} import {call.partition('(')[0]}; {call}"]
    path = os.pathsep.join(filter(None, sys.path))
    environment = os.environ | {"PYTHONPATH": path}
    return subprocess.run(
        command, input=text, capture_output=True, text=True, timeout=timeout, check=False, env=environment
    )
