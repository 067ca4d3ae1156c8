"""Free memory: how many bytes a result may take."""

from __future__ import annotations

import math
import os
from contextlib import suppress
from pathlib import Path

SHARE = 0.9  # of what is free


def room() -> float:
    """Bytes that a result may take."""
    return SHARE * _free()


def _free() -> float:
    """Bytes that can be taken without swapping; where the system does not say, all there are, or no limit."""
    with suppress(OSError, StopIteration):  # Linux
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    with suppress(OSError, ValueError, AttributeError):  # macOS
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    return math.inf
