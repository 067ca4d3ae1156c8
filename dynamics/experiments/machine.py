"""The machine that measured times belong to, in words, and a fresh process on it."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
from contextlib import suppress
from importlib import metadata
from pathlib import Path


def machine() -> str:
    """The processor and the versions that the figures belong to."""
    packages = []
    for name in ("numpy", "llvmlite", "casadi", "pin", "mujoco", "heyoka", "jax", "sympy", "torch"):
        with suppress(metadata.PackageNotFoundError):
            packages.append(f"{name} {metadata.version(name)}")
    return f"{_processor()}, Python {platform.python_version()}, {', '.join(packages)}"


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    facts = dict(re.findall(r"^(model name|flags)\s*:\s*(.*)$", text, flags=re.MULTILINE))
    vectors = next((name for name in ("avx512f", "avx2") if name in facts.get("flags", "").split()), "")
    return " ".join(filter(None, [facts.get("model name", platform.machine()), vectors and f"({vectors})"]))


def load() -> float | None:
    """Processes that want to run, mean over the last minute; None where the system does not tell."""
    with suppress(OSError, AttributeError):
        return os.getloadavg()[0]
    return None


def run_fresh(module: str, call: str, text: str = "", timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    """Output and errors of a call, of a name of that module, in a process of its own. `text` is its standard input.

    Raises subprocess.TimeoutExpired after `timeout` s.
    """
    command = [sys.executable, "-c", f"from {module} import {call.partition('(')[0]}; {call}"]
    path = os.pathsep.join(filter(None, sys.path))
    environment = os.environ | {"PYTHONPATH": path}
    return subprocess.run(
        command, input=text, capture_output=True, text=True, timeout=timeout, check=False, env=environment
    )
